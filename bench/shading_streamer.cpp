#include "bench/shading_streamer.h"

#include <algorithm>
#include <map>

#include "base/log.h"
#include "bench/pairing_check.h"
#include "codec/yuv.h"
#include "shading/gather.h"

namespace tessera::bench {
namespace {

// Copies device images to the CPU through one reused buffer.
class ImageReader {
 public:
  static StatusOr<ImageReader> create(gpu::Device& device, uint32_t width, uint32_t height) {
    ImageReader reader(device);
    TESSERA_ASSIGN_OR_RETURN(reader.buffer_, gpu::Buffer::create(device, uint64_t{4} * width * height,
                                                                 gpu::Memory::readback, "atlas readback"));
    return reader;
  }

  StatusOr<Image8> read(const gpu::Image& image) {
    gpu::Commands commands = device_->begin();
    commands.copy_to_buffer(image, buffer_);
    commands.barrier();
    TESSERA_RETURN_IF_ERROR(device_->run(std::move(commands)));
    Image8 out(image.width(), image.height());
    const auto pixels = buffer_.as<uint8_t>();
    std::copy_n(pixels.begin(), out.rgba.size(), out.rgba.begin());
    return out;
  }

 private:
  explicit ImageReader(gpu::Device& device) : device_(&device) {}
  gpu::Device* device_;
  gpu::Buffer buffer_;
};

// What the server had for a frame that the client may still draw.
struct Snapshot {
  std::vector<atlas::Placement> placements;  // sorted by patch
  Image8 rgb;                                // empty without the split
};

}  // namespace

server::SessionSettings session_settings(const LoopbackSettings& s) {
  server::SessionSettings out;
  out.client_view = client_view(s);
  out.layout = atlas::layout_settings(s.layout, s.atlas.width, s.atlas.height);
  out.prediction.mode = s.pvs == Prediction::none ? pvs::PredictionMode::none : pvs::PredictionMode::linear;
  out.codec = s.codec;
  out.rate.bitrate_bps = s.bitrate_mbps * 1e6;
  out.rate.frames_per_second = s.server_fps;
  return out;
}

struct ShadingStreamer::Impl {
  std::shared_ptr<server::SharedScene> scene;
  bool split = false;
  std::unique_ptr<server::Session> session;
  std::unique_ptr<client::ClientCore> core;
  std::unique_ptr<client::Display> display;
  std::optional<ImageReader> reader;
  std::unique_ptr<shading::Gather> fresh_gather;  // only with the split

  // Coverage.
  CoverageMeter* meter = nullptr;
  std::function<Pose(TimeNs)> true_pose;
  View client;
  std::unique_ptr<pvs::Visibility> other_visibility;  // not the session's: it remembers what it saw
  std::unique_ptr<scene::SceneInstant> other_instant;

  server::FrameStats stats;
  std::map<FrameNumber, Snapshot> snapshots;
  const client::Pair* pair = nullptr;
  uint64_t violations = 0;

  const Snapshot& current() const { return snapshots.at(pair->frame); }

  Status keep_snapshot(FrameNumber number) {
    Snapshot& snapshot = snapshots[number];
    const auto placements = session->placements();
    snapshot.placements.assign(placements.begin(), placements.end());
    if (!split) return absl::OkStatus();
    TESSERA_ASSIGN_OR_RETURN(snapshot.rgb, reader->read(session->atlas_image()));
    return absl::OkStatus();
  }

  // The visible sets that this frame is compared with: without prediction, and with the poses that really
  // come.
  Status meter_coverage(const ServeRequest& request) {
    const TimedPose& newest = request.poses.back();
    if (!meter->wants(newest.time_ns)) return absl::OkStatus();
    const std::span<const View> predicted = session->views();
    CoverageMeter::Frame frame{.from_ns = newest.time_ns, .to_ns = newest.time_ns + session->horizon_ns()};
    for (const atlas::Placement& p : session->placements()) {
      if (frame.placed.empty() || frame.placed.back().patch != p.patch) frame.placed.push_back({p.patch, {}});
    }
    frame.predicted = session->seen();

    View exact = client;
    exact.pose = newest.pose;
    other_instant->set(request.scene_time_ns, newest.pose.position);
    TESSERA_ASSIGN_OR_RETURN(frame.without_prediction,
                             other_visibility->determine(*other_instant, std::span(&exact, 1), client));
    std::vector<View> real(predicted.begin(), predicted.end());
    for (size_t i = 0; i < real.size(); ++i) real[i].pose = true_pose(session->view_times()[i]);
    TESSERA_ASSIGN_OR_RETURN(frame.with_true_path, other_visibility->determine(*other_instant, real, client));
    meter->add_frame(std::move(frame));
    return absl::OkStatus();
  }

  void check(const client::Pair& next) {
    const bool goes_back = pair && !is_newer(next.frame, pair->frame);
    const auto known = snapshots.find(next.frame);
    if (goes_back || known == snapshots.end() || next.state.frame != next.frame ||
        !matches(next.state, known->second.placements, scene->scene())) {
      ++violations;
      spdlog::error("frame {}: the client's pair breaks a pairing rule", next.frame);
    }
  }

  StatusOr<Image8> draw(const Image8& atlas, const View& view) {
    TESSERA_RETURN_IF_ERROR(display->set_state(pair->state));
    TESSERA_RETURN_IF_ERROR(display->set_atlas(atlas));
    return display->draw(view);
  }
  StatusOr<Image8> draw(const YuvView& atlas, const View& view) {
    TESSERA_RETURN_IF_ERROR(display->set_state(pair->state));
    TESSERA_RETURN_IF_ERROR(display->set_atlas(atlas));
    return display->draw(view);
  }
};

ShadingStreamer::ShadingStreamer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
ShadingStreamer::~ShadingStreamer() = default;

StatusOr<std::unique_ptr<ShadingStreamer>> ShadingStreamer::create(std::shared_ptr<server::SharedScene> scene,
                                                                   const LoopbackSettings& settings) {
  return create(std::move(scene), settings, session_settings(settings));
}

StatusOr<std::unique_ptr<ShadingStreamer>> ShadingStreamer::create(std::shared_ptr<server::SharedScene> scene,
                                                                   const LoopbackSettings& settings,
                                                                   const server::SessionSettings& session) {
  auto impl = std::make_unique<Impl>();
  impl->scene = scene;
  impl->split = settings.split;
  impl->client = client_view(settings);
  TESSERA_ASSIGN_OR_RETURN(impl->session, server::Session::create(scene, session));
  TESSERA_ASSIGN_OR_RETURN(impl->core, client::ClientCore::create(settings.codec));
  const client::DisplaySettings display{.width = settings.size.width, .height = settings.size.height};
  TESSERA_ASSIGN_OR_RETURN(impl->display, client::Display::create(display));
  if (impl->split) {
    gpu::Device& device = scene->device();
    TESSERA_ASSIGN_OR_RETURN(impl->reader,
                             ImageReader::create(device, settings.atlas.width, settings.atlas.height));
    const shading::GatherSettings gather{settings.atlas.width, settings.atlas.height,
                                         shading::GatherPath::automatic, scene->gather_choice()};
    TESSERA_ASSIGN_OR_RETURN(impl->fresh_gather,
                             shading::Gather::create(device, scene->gpu_scene(), scene->lighting(), gather));
  }
  return std::unique_ptr<ShadingStreamer>(new ShadingStreamer(std::move(impl)));
}

StatusOr<std::vector<Packet>> ShadingStreamer::serve(const ServeRequest& request) {
  const server::FrameInput input{.number = request.number,
                                 .poses = request.poses,
                                 .round_trip_ns = request.round_trip_ns,
                                 .scene_time_ns = request.scene_time_ns,
                                 .key_frame = request.key_frame};
  TESSERA_ASSIGN_OR_RETURN(server::Frame frame, impl_->session->render(input));
  TESSERA_RETURN_IF_ERROR(impl_->keep_snapshot(request.number));
  impl_->stats = frame.stats;
  if (impl_->meter) TESSERA_RETURN_IF_ERROR(impl_->meter_coverage(request));
  std::vector<Packet> packets;
  packets.push_back({Channel::meta, std::move(frame.meta)});
  packets.push_back({Channel::atlas, std::move(frame.atlas.bytes)});
  return packets;
}

Status ShadingStreamer::deliver(Channel channel, std::span<const uint8_t> bytes) {
  if (channel == Channel::meta) return impl_->core->on_meta(bytes).status();
  // Late or missing pictures are part of a network: the core counts them and asks for a key frame.
  if (const auto frame = impl_->core->on_atlas(bytes); !frame.ok())
    spdlog::debug("client: {}", frame.status().ToString());
  return absl::OkStatus();
}

std::optional<FrameNumber> ShadingStreamer::newest_frame() {
  if (const client::Pair* next = impl_->core->take_newest()) {
    impl_->check(*next);
    impl_->pair = next;
    auto& snapshots = impl_->snapshots;
    std::erase_if(snapshots, [&](const auto& entry) { return is_newer(next->frame, entry.first); });
  }
  if (!impl_->pair) return std::nullopt;
  return impl_->pair->frame;
}

StatusOr<Image8> ShadingStreamer::draw(const View& view) {
  return draw_atlas(codec::view_of(impl_->pair->atlas), view);
}

StatusOr<Image8> ShadingStreamer::draw_uncoded_420(const View& view) {
  const YuvImage atlas = codec::rgb_to_yuv(impl_->current().rgb);
  return draw_atlas(codec::view_of(atlas), view);
}

StatusOr<Image8> ShadingStreamer::draw_uncoded(const View& view) {
  return impl_->draw(impl_->current().rgb, view);
}

StatusOr<Image8> ShadingStreamer::draw_fresh(const View& view, const scene::SceneInstant& instant) {
  gpu::Device& device = impl_->scene->device();
  TESSERA_RETURN_IF_ERROR(impl_->scene->lighting().update(instant));
  gpu::Commands commands = device.begin();
  TESSERA_RETURN_IF_ERROR(impl_->fresh_gather->record(commands, instant, view, impl_->current().placements));
  TESSERA_RETURN_IF_ERROR(device.run(std::move(commands)));
  TESSERA_ASSIGN_OR_RETURN(const Image8 atlas, impl_->reader->read(impl_->fresh_gather->image()));
  return impl_->draw(atlas, view);
}

Status ShadingStreamer::meter_coverage(CoverageMeter& meter, std::function<Pose(TimeNs)> true_pose) {
  gpu::Device& device = impl_->scene->device();
  TESSERA_ASSIGN_OR_RETURN(impl_->other_visibility,
                           pvs::Visibility::create(device, impl_->scene->gpu_scene(), {}));
  TESSERA_ASSIGN_OR_RETURN(impl_->other_instant,
                           scene::SceneInstant::create(device, impl_->scene->gpu_scene()));
  impl_->meter = &meter;
  impl_->true_pose = std::move(true_pose);
  return absl::OkStatus();
}

StatusOr<Image8> ShadingStreamer::draw_atlas(const YuvView& atlas, const View& view) {
  return impl_->draw(atlas, view);
}

bool ShadingStreamer::has_patch(scene::PatchId patch) const {
  const auto& placements = impl_->current().placements;
  const auto at = std::lower_bound(placements.begin(), placements.end(), patch,
                                   [](const atlas::Placement& p, scene::PatchId id) { return p.patch < id; });
  return at != placements.end() && at->patch == patch;
}

bool ShadingStreamer::wants_key_frame() const {
  return impl_->core->wants_key_frame();
}
uint64_t ShadingStreamer::violations() const {
  return impl_->violations;
}
const server::FrameStats& ShadingStreamer::last_stats() const {
  return impl_->stats;
}
const Image8& ShadingStreamer::uncoded_atlas() const {
  return impl_->current().rgb;
}
client::Display& ShadingStreamer::display() {
  return *impl_->display;
}
server::Session& ShadingStreamer::session() {
  return *impl_->session;
}

}  // namespace tessera::bench
