#include "bench/picture_streamer.h"

#include <map>
#include <utility>

#include "bench/mesh_warp.h"
#include "codec/video_decoder.h"
#include "codec/video_encoder.h"
#include "codec/yuv.h"
#include "server/rate_split.h"
#include "shading/reference.h"

namespace tessera::bench {
namespace {

struct SourcePicture {
  View view;
  RenderedImage rendered;
};

}  // namespace

struct PictureStreamer::Impl {
  PictureMethod method;
  TruthSource& source;
  View client;
  server::RateSplit rate;
  server::BitBalance balance;
  std::unique_ptr<codec::VideoEncoder> encoder;
  std::unique_ptr<codec::VideoDecoder> decoder;
  std::unique_ptr<MeshWarp> warp;

  std::map<FrameNumber, SourcePicture> sources;
  bool first = true;
  bool broken = false;
  std::optional<FrameNumber> arrived;
  Image8 picture;  // of `arrived`

  Impl(PictureMethod m, TruthSource& s) : method(m), source(s) {}

  View source_view(const Pose& pose) const {
    View view = method == PictureMethod::mesh_warp ? warp_source_view(client) : client;
    view.pose = pose;
    return view;
  }
};

PictureStreamer::PictureStreamer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
PictureStreamer::~PictureStreamer() = default;

StatusOr<std::unique_ptr<PictureStreamer>> PictureStreamer::create(PictureMethod method,
                                                                   std::shared_ptr<server::SharedScene> scene,
                                                                   TruthSource& source,
                                                                   const LoopbackSettings& settings) {
  auto impl = std::make_unique<Impl>(method, source);
  impl->client = client_view(settings);
  impl->rate = {.bitrate_bps = settings.bitrate_mbps * 1e6, .frames_per_second = settings.server_fps};
  const View view = impl->source_view({});
  const codec::EncoderSettings video{.width = view.width,
                                     .height = view.height,
                                     .frames_per_second = settings.server_fps,
                                     .bitrate_bps = settings.bitrate_mbps * 1e6};
  TESSERA_ASSIGN_OR_RETURN(impl->encoder, codec::VideoEncoder::create(video));
  TESSERA_ASSIGN_OR_RETURN(impl->decoder, codec::VideoDecoder::create());
  if (method == PictureMethod::mesh_warp) {
    TESSERA_ASSIGN_OR_RETURN(impl->warp,
                             MeshWarp::create(scene->device(), view.width, view.height, settings.size.width,
                                              settings.size.height, shading::kBackground));
  }
  return std::unique_ptr<PictureStreamer>(new PictureStreamer(std::move(impl)));
}

std::string PictureStreamer::name() const {
  return impl_->method == PictureMethod::mesh_warp ? "mesh-warp" : "plain-video";
}

StatusOr<std::vector<Packet>> PictureStreamer::serve(const ServeRequest& request) {
  const View view = impl_->source_view(request.poses.back().pose);
  const bool with_depth = impl_->method == PictureMethod::mesh_warp;
  TESSERA_ASSIGN_OR_RETURN(const RenderedImage rendered,
                           impl_->source.render(view, request.scene_time_ns, {.depth = with_depth}));
  const bool key_frame = std::exchange(impl_->first, false) || request.key_frame;
  const YuvImage yuv = codec::rgb_to_yuv(rendered->color);
  const double budget = impl_->balance.atlas_bits(impl_->rate, 0, key_frame);
  TESSERA_ASSIGN_OR_RETURN(codec::AccessUnit unit,
                           impl_->encoder->encode(request.number, codec::view_of(yuv), budget, key_frame));
  impl_->balance.spend(8.0 * static_cast<double>(unit.bytes.size()));
  impl_->sources[request.number] = {view, rendered};
  std::vector<Packet> packets;
  packets.push_back({Channel::atlas, std::move(unit.bytes)});
  return packets;
}

Status PictureStreamer::deliver(Channel, std::span<const uint8_t> bytes) {
  const StatusOr<codec::DecodedFrame> result = impl_->decoder->decode(bytes);
  impl_->broken = !result.ok();
  if (impl_->broken) return absl::OkStatus();  // the old picture stays until a key frame
  const codec::DecodedFrame& decoded = *result;
  impl_->picture = codec::yuv_to_rgb(decoded.picture);
  impl_->arrived = decoded.frame;
  std::erase_if(impl_->sources, [&](const auto& entry) { return is_newer(decoded.frame, entry.first); });
  if (!impl_->warp) return absl::OkStatus();
  const SourcePicture& source = impl_->sources.at(decoded.frame);
  return impl_->warp->set_source(source.view, impl_->picture, source.rendered->depth);
}

bool PictureStreamer::wants_key_frame() const {
  return impl_->broken;
}

std::optional<FrameNumber> PictureStreamer::newest_frame() {
  return impl_->arrived;
}

StatusOr<Image8> PictureStreamer::draw(const View& view) {
  if (impl_->warp) return impl_->warp->draw(view);
  return impl_->picture;
}

}  // namespace tessera::bench
