// What goes into a session's frame and what comes out, and who makes it.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "atlas/density.h"
#include "atlas/layout.h"
#include "base/atlas_codec.h"
#include "base/frame_number.h"
#include "base/status.h"
#include "base/view.h"
#include "codec/atlas_encoder.h"
#include "geometry-compression/meta_codec.h"
#include "pvs/prediction.h"
#include "pvs/visibility.h"
#include "server/rate_split.h"
#include "shading/gather.h"

namespace tessera::server {

struct SessionSettings {
  View client_view;       // the client's resolution, of one eye; its pose is ignored
  std::vector<Eye> eyes;  // of the client; none: one where the head is, with the client view's field
  atlas::DensitySettings density;
  atlas::LayoutSettings layout;
  pvs::PredictionSettings prediction;  // horizon_ns is set for every frame
  pvs::VisibilitySettings visibility;
  RateSplit rate;
  AtlasCodec codec = AtlasCodec::h264;
  std::string encoder = "auto";  // of H.264
};

struct FrameInput {
  FrameNumber number = 0;
  std::span<const TimedPose> poses;  // received so far, by time, newest last; at least one
  DurationNs round_trip_ns = 0;      // from a pose to the picture that shows its frame
  DurationNs interval_ns = 0;        // between frames, where it is longer than the rate says
  TimeNs scene_time_ns = 0;          // animation
  std::optional<vec3> gaze;          // the newest, in the head's axes; none: straight ahead
  bool key_frame = false;
};

// Wall time of each stage.
struct StageTimes {
  double visibility_ms = 0, density_ms = 0, layout_ms = 0, shading_ms = 0, encode_ms = 0;
  double total_ms() const { return visibility_ms + density_ms + layout_ms + shading_ms + encode_ms; }
};

struct FrameStats {
  StageTimes times;
  uint32_t predicted_views = 0;
  size_t visible_patches = 0;  // seen in this frame's views
  size_t placed_patches = 0;   // with those that merely stay
  pvs::VisibilityStats visibility;
  atlas::LayoutStats layout;
  shading::GatherStats gather;
  geometry_compression::MetaBits meta_bits;
};

struct Frame {
  FrameNumber number = 0;
  TimedPose pose;  // the newest pose that it was made for
  codec::AccessUnit atlas;
  std::vector<uint8_t> meta;
  FrameStats stats;
};

class FrameRenderer {
 public:
  virtual ~FrameRenderer() = default;
  // Blocks until the frame is encoded. The first frame is a key frame, with JPEG and raw each one.
  virtual StatusOr<Frame> render(const FrameInput& input) = 0;
  // For the frames from now on.
  virtual void set_rate(const RateSplit& rate) = 0;
  virtual const std::string& encoder() const = 0;  // which one runs, and why
};

// Called on the render thread, once the client's view is known. It holds what the renderer is made of; where
// that lies on a device, the factory is destroyed on the render thread, too.
using RendererFactory =
    std::function<StatusOr<std::unique_ptr<FrameRenderer>>(const SessionSettings& settings)>;

}  // namespace tessera::server
