// One client's frames: predict, find the visible set, place it, shade it, and encode both streams. Owns
// everything that is per session; shares the scene. Time comes in from outside, so the same code runs over
// sockets and in virtual time.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "atlas/blocks/layout.h"
#include "base/frame_number.h"
#include "base/view.h"
#include "codec/video_encoder.h"
#include "geometry-compression/meta_codec.h"
#include "pvs/prediction.h"
#include "pvs/visibility.h"
#include "server/frame_plan.h"
#include "server/rate_split.h"
#include "server/shared_scene.h"
#include "shading/gather.h"

namespace tessera::server {

struct SessionSettings {
  View client_view;  // the client's resolution and field of view; its pose is ignored
  atlas::blocks::LayoutSettings layout;
  pvs::PredictionSettings prediction;  // horizon_ns is set for every frame
  pvs::VisibilitySettings visibility;
  shading::GatherPath gather_path = shading::GatherPath::automatic;
  RateSplit rate;
  std::string encoder = "auto";
};

struct FrameInput {
  FrameNumber number = 0;
  std::span<const TimedPose> poses;  // received so far, by time, newest last; at least one
  DurationNs round_trip_ns = 0;      // from a pose to the picture that shows its frame
  TimeNs scene_time_ns = 0;          // animation
  bool key_frame = false;
};

// Wall time of each stage.
struct StageTimes {
  double visibility_ms = 0, layout_ms = 0, shading_ms = 0, encode_ms = 0;
  double total_ms() const { return visibility_ms + layout_ms + shading_ms + encode_ms; }
};

struct FrameStats {
  StageTimes times;
  uint32_t predicted_views = 0;
  size_t visible_patches = 0;  // seen in this frame's views
  size_t placed_patches = 0;   // with those that stay for one round trip
  pvs::VisibilityStats visibility;
  atlas::blocks::LayoutStats layout;
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

// Not thread-safe; uses the scene's device from the calling thread.
class Session {
 public:
  static StatusOr<std::unique_ptr<Session>> create(std::shared_ptr<SharedScene> scene,
                                                   const SessionSettings& settings);
  ~Session();

  // For the frames from now on.
  void set_rate(const RateSplit& rate);
  // Blocks until the frame is encoded. The first frame is a key frame.
  StatusOr<Frame> render(const FrameInput& input);

  const FramePlan& plan() const;
  const std::string& encoder() const;  // which one runs, and why

  // State of the last rendered frame, for harnesses.
  std::span<const View> views() const;         // predicted
  std::span<const TimeNs> view_times() const;  // for when, on the clock of the poses
  DurationNs horizon_ns() const;               // how far ahead they reach
  const scene::VisiblePatches& seen() const;   // in those views, without the patches that merely stay
  std::span<const atlas::Placement> placements() const;
  const gpu::Image& atlas_image() const;
  YuvView yuv() const;  // before coding

 private:
  struct Impl;
  explicit Session(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera::server
