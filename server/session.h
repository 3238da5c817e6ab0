// One client's frames: predict, find the visible set, place it, shade it, and encode both streams. Owns
// everything that is per session; shares the scene. Time comes in from outside, so the same code runs over
// sockets and in virtual time.
#pragma once

#include <memory>
#include <span>
#include <string>

#include "server/frame.h"
#include "server/frame_plan.h"
#include "server/shared_scene.h"

namespace tessera::server {

// Not thread-safe; uses the scene's device from the calling thread.
class Session final : public FrameRenderer {
 public:
  static StatusOr<std::unique_ptr<Session>> create(std::shared_ptr<SharedScene> scene,
                                                   const SessionSettings& settings);
  ~Session() override;

  void set_rate(const RateSplit& rate) override;
  StatusOr<Frame> render(const FrameInput& input) override;

  const FramePlan& plan() const;
  const std::string& encoder() const override;

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

// Sessions of this scene.
RendererFactory renders(std::shared_ptr<SharedScene> scene);

}  // namespace tessera::server
