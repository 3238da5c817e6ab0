#include "server/session.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "base/log.h"
#include "codec/yuv_converter.h"
#include "pvs/retention.h"
#include "server/meta_builder.h"
#include "server/sample_map.h"
#include "server/viewers.h"

namespace tessera::server {
namespace {

constexpr double kRtpClockHz = 90'000;

// Wall time since the last lap.
class Stopwatch {
 public:
  double lap_ms() {
    const TimeNs now = clock_.now();
    const double ms = to_ms(now - last_);
    last_ = now;
    return ms;
  }

 private:
  SteadyClock clock_;
  TimeNs last_ = clock_.now();
};

MetaSettings meta_settings(const SessionSettings& settings) {
  return {.atlas_width = static_cast<uint16_t>(settings.layout.width),
          .atlas_height = static_cast<uint16_t>(settings.layout.height)};
}

}  // namespace

struct Session::Impl {
  SessionSettings settings;
  std::shared_ptr<SharedScene> scene;
  FramePlan plan;
  std::unique_ptr<scene::SceneInstant> instant;
  std::unique_ptr<pvs::Visibility> visibility;
  pvs::Retention retention;
  std::unique_ptr<atlas::Density> density;  // only where the settings ask for it
  std::unique_ptr<atlas::Layout> layout;
  std::unique_ptr<shading::Gather> gather;
  std::unique_ptr<codec::YuvConverter> converter;
  std::unique_ptr<codec::AtlasEncoder> encoder;
  codec::Occupancy used;  // of the atlas; only where the codec asks for it
  std::optional<MetaBuilder> meta;
  BitBalance balance;  // of video
  bool first = true;

  std::vector<Eye> eyes;
  View client_view;  // of the eye that needs the most
  std::vector<View> views;
  std::vector<TimeNs> view_times;
  DurationNs horizon_ns = 0;
  atlas::Viewers viewers;
  scene::VisiblePatches seen;

  Status set_up();
  Status find_visible(const FrameInput& input, FrameStats& stats);
  Status shade(const Pose& pose, FrameStats& stats);
  codec::AtlasPicture coded_picture();
  Status encode(const FrameInput& input, const atlas::LayoutDelta& delta, Frame& frame);
};

Status Session::Impl::set_up() {
  gpu::Device& device = scene->device();
  plan = make_frame_plan(scene->scene().features, settings.density);
  eyes = eyes_of(settings);
  client_view = finest_view(settings.client_view, eyes);
  TESSERA_ASSIGN_OR_RETURN(instant, scene::SceneInstant::create(device, scene->gpu_scene()));
  TESSERA_ASSIGN_OR_RETURN(visibility,
                           pvs::Visibility::create(device, scene->gpu_scene(), settings.visibility));
  if (plan.includes("density")) {
    TESSERA_ASSIGN_OR_RETURN(
        density, atlas::Density::create(scene->scene(), settings.density, display_of(client_view, eyes)));
  }
  TESSERA_ASSIGN_OR_RETURN(layout, atlas::create_layout(scene->scene(), settings.layout));
  const shading::GatherSettings gather_settings{settings.layout.width, settings.layout.height,
                                                shading::GatherPath::automatic, scene->gather_choice()};
  TESSERA_ASSIGN_OR_RETURN(
      gather, shading::Gather::create(device, scene->gpu_scene(), scene->lighting(), gather_settings));
  TESSERA_ASSIGN_OR_RETURN(
      converter, codec::YuvConverter::create(device, settings.layout.width, settings.layout.height));
  const codec::EncoderSettings video{.width = settings.layout.width,
                                     .height = settings.layout.height,
                                     .frames_per_second = settings.rate.frames_per_second,
                                     .bitrate_bps = settings.rate.bitrate_bps,
                                     .encoder = settings.encoder};
  TESSERA_ASSIGN_OR_RETURN(encoder, codec::AtlasEncoder::create(settings.codec, video));
  if (settings.codec == AtlasCodec::jpeg)
    used = codec::Occupancy(settings.layout.width, settings.layout.height);
  meta.emplace(scene->scene(), meta_settings(settings));
  return absl::OkStatus();
}

Status Session::Impl::find_visible(const FrameInput& input, FrameStats& stats) {
  const TimedPose& newest = input.poses.back();
  pvs::PredictionSettings prediction = settings.prediction;
  prediction.max_views /= static_cast<uint32_t>(eyes.size());  // they share the time that id buffers take
  horizon_ns =
      input.round_trip_ns + std::max(input.interval_ns, from_seconds(1.0 / settings.rate.frames_per_second));
  prediction.horizon_ns = horizon_ns;
  views = pvs::predict_views(input.poses, newest.time_ns, client_view, eyes, prediction);
  view_times.clear();
  for (size_t eye = 0; eye < eyes.size(); ++eye) {
    for (const DurationNs ahead : pvs::prediction_times(prediction))
      view_times.push_back(newest.time_ns + ahead);
  }
  if (density) {
    const std::vector<View> heads = pvs::predict_views(input.poses, newest.time_ns, client_view, prediction);
    viewers = viewers_of(views, heads, input.gaze);
  }

  instant->set(input.scene_time_ns, newest.pose.position);
  TESSERA_RETURN_IF_ERROR(scene->lighting().update(*instant));
  TESSERA_ASSIGN_OR_RETURN(seen, visibility->determine(*instant, views, client_view));
  stats.predicted_views = static_cast<uint32_t>(views.size());
  stats.visible_patches = seen.size();
  stats.visibility = visibility->stats();
  return absl::OkStatus();
}

Status Session::Impl::shade(const Pose& pose, FrameStats& stats) {
  View viewer = client_view;
  viewer.pose = pose;
  gpu::Device& device = scene->device();
  gpu::Commands commands = device.begin();
  TESSERA_RETURN_IF_ERROR(gather->record(commands, *instant, viewer, layout->placements()));
  commands.barrier();
  TESSERA_RETURN_IF_ERROR(converter->record(commands, gather->image()));
  TESSERA_RETURN_IF_ERROR(device.run(std::move(commands)));
  stats.gather = gather->stats();
  return absl::OkStatus();
}

codec::AtlasPicture Session::Impl::coded_picture() {
  if (settings.codec != AtlasCodec::jpeg)
    return converter->result();  // video codes what stands still for nothing
  map_samples(layout->placements(), used);
  return {converter->result(), &used};
}

Status Session::Impl::encode(const FrameInput& input, const atlas::LayoutDelta& delta, Frame& frame) {
  geometry_compression::MetaFrame values = meta->build(
      frame.number, delta, {layout->placements(), gather->colors()}, instant->instance_transforms());
  values.rtp_timestamp =
      static_cast<uint32_t>(static_cast<uint64_t>(to_seconds(input.poses.back().time_ns) * kRtpClockHz));
  frame.meta = geometry_compression::encode(values, &frame.stats.meta_bits);

  // Only video has frames that cost more than others because nothing came before them; and JPEG takes nearly
  // all of each frame's bits by itself.
  const bool video = settings.codec == AtlasCodec::h264;
  const bool key_frame = (std::exchange(first, false) || input.key_frame) && video;
  const RateSplit rate = settings.rate.at_interval(input.interval_ns);
  const double meta_bits = 8.0 * static_cast<double>(frame.meta.size());
  const double budget =
      video ? balance.atlas_bits(rate, meta_bits, key_frame) : rate.atlas_bits(meta_bits, key_frame);
  TESSERA_ASSIGN_OR_RETURN(frame.atlas, encoder->encode(frame.number, coded_picture(), budget, key_frame));
  if (video) balance.spend(8.0 * static_cast<double>(frame.atlas.bytes.size()));
  return absl::OkStatus();
}

Session::Session(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Session::~Session() = default;

StatusOr<std::unique_ptr<Session>> Session::create(std::shared_ptr<SharedScene> scene,
                                                   const SessionSettings& settings) {
  auto impl = std::make_unique<Impl>();
  impl->settings = settings;
  impl->scene = std::move(scene);
  TESSERA_RETURN_IF_ERROR(impl->set_up());
  return std::unique_ptr<Session>(new Session(std::move(impl)));
}

void Session::set_rate(const RateSplit& rate) {
  impl_->settings.rate = rate;
}

StatusOr<Frame> Session::render(const FrameInput& input) {
  if (input.poses.empty()) return absl::InvalidArgumentError("session: a frame needs at least one pose");
  Frame frame;
  frame.number = input.number;
  frame.pose = input.poses.back();
  Stopwatch watch;
  StageTimes& times = frame.stats.times;

  TESSERA_RETURN_IF_ERROR(impl_->find_visible(input, frame.stats));
  scene::VisiblePatches kept = impl_->retention.update(frame.pose.time_ns, input.round_trip_ns, impl_->seen);
  times.visibility_ms = watch.lap_ms();

  if (impl_->density) impl_->density->scale(impl_->instant->instance_transforms(), impl_->viewers, kept);
  times.density_ms = watch.lap_ms();

  const atlas::LayoutDelta delta =
      impl_->layout->update({kept, frame.pose.pose.position, impl_->instant->instance_transforms()});
  frame.stats.placed_patches = kept.size();
  frame.stats.layout = impl_->layout->stats();
  times.layout_ms = watch.lap_ms();

  TESSERA_RETURN_IF_ERROR(impl_->shade(frame.pose.pose, frame.stats));
  times.shading_ms = watch.lap_ms();

  TESSERA_RETURN_IF_ERROR(impl_->encode(input, delta, frame));
  times.encode_ms = watch.lap_ms();
  const atlas::LayoutStats& layout = frame.stats.layout;
  spdlog::debug(
      "frame {}: {} views, {} patches seen, {} blocks + {} colours ({} for want of memory), bias {:.2f}, "
      "{:.0f} % of the "
      "atlas used, {} moved, atlas {} B, meta {} B; ms: visibility {:.0f}, layout {:.1f}, shading {:.0f}, "
      "encode {:.0f}",
      frame.number, frame.stats.predicted_views, frame.stats.visible_patches, layout.blocks, layout.colors,
      layout.colors_out_of_memory, layout.bias,
      100.0 * static_cast<double>(layout.used_texels) /
          (impl_->settings.layout.width * impl_->settings.layout.height),
      layout.changed, frame.atlas.bytes.size(), frame.meta.size(), times.visibility_ms, times.layout_ms,
      times.shading_ms, times.encode_ms);
  return frame;
}

RendererFactory renders(std::shared_ptr<SharedScene> scene) {
  return [scene =
              std::move(scene)](const SessionSettings& settings) -> StatusOr<std::unique_ptr<FrameRenderer>> {
    return Session::create(scene, settings);
  };
}

const FramePlan& Session::plan() const {
  return impl_->plan;
}
const std::string& Session::encoder() const {
  return impl_->encoder->choice();
}
std::span<const View> Session::views() const {
  return impl_->views;
}
std::span<const TimeNs> Session::view_times() const {
  return impl_->view_times;
}
DurationNs Session::horizon_ns() const {
  return impl_->horizon_ns;
}
const scene::VisiblePatches& Session::seen() const {
  return impl_->seen;
}
std::span<const atlas::Placement> Session::placements() const {
  return impl_->layout->placements();
}
const gpu::Image& Session::atlas_image() const {
  return impl_->gather->image();
}
YuvView Session::yuv() const {
  return impl_->converter->result();
}

}  // namespace tessera::server
