// How much of what the client saw while a frame was in use had been in that frame's visible set (experiment
// E6, thesis 7.2.1): area-weighted, over the horizon that the frame was made for.
#pragma once

#include <deque>
#include <span>
#include <vector>

#include "base/view.h"
#include "pvs/coverage.h"
#include "scene/visible_set.h"

namespace tessera::bench {

class CoverageMeter {
 public:
  // The visible sets of one server frame. All sorted by patch.
  struct Frame {
    TimeNs from_ns = 0, to_ns = 0;             // the pose's time, and the end of the horizon
    scene::VisiblePatches placed;              // what the client got
    scene::VisiblePatches predicted;           // seen from the predicted views
    scene::VisiblePatches without_prediction;  // seen from the newest pose alone
    scene::VisiblePatches with_true_path;      // the same views as `predicted`, at the poses that really came
  };
  struct Result {
    double coverage = 1, coverage_without_prediction = 1, overestimation = 0;
    uint32_t frames = 0;  // whose horizon lay within the run
  };

  // Whether a frame for the pose of `from_ns` counts: before the first display frame nobody sees it.
  bool wants(TimeNs from_ns) const { return !seen_.empty() && from_ns >= seen_.front().first; }
  void add_frame(Frame frame);
  // What a display frame showed, with footprints from its eye. Times increase.
  void add_seen(TimeNs now_ns, scene::VisiblePatches seen);
  Result result() const;

 private:
  void finish(const Frame& frame);

  std::deque<Frame> open_;
  std::deque<std::pair<TimeNs, scene::VisiblePatches>> seen_;
  pvs::Coverage placed_, without_prediction_, predicted_vs_true_;
  uint32_t frames_ = 0;
};

// The union, each patch with its largest footprint.
scene::VisiblePatches unite(const scene::VisiblePatches& a, const scene::VisiblePatches& b);

// The patches of an id buffer (instanced triangle + 1, 0 = background) with footprints from `view`'s eye.
scene::VisiblePatches visible_patches(const scene::Scene& scene, std::span<const uint32_t> triangle_plus_one,
                                      std::span<const dmat4> instance_transforms, const View& view);

}  // namespace tessera::bench
