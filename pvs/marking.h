// From id buffers to visible patches, on the CPU: on a software device this beats a compute pass (copy and
// loop 1.2 ms against 9-20 ms at 1080p), and elsewhere it hides behind the next view.
#pragma once

#include <span>
#include <vector>

#include "base/math.h"
#include "pvs/visibility.h"
#include "scene/gpu_scene.h"
#include "scene/visible_set.h"

namespace tessera::pvs {

// Rows of ids in mapped memory.
struct IdRows {
  std::span<const uint32_t> ids;
  uint32_t width = 0, height = 0, stride = 0;  // pixels
};

class PatchMarking {
 public:
  explicit PatchMarking(const scene::Scene& scene);

  // Starts an empty set.
  void begin();
  // Adds the patches that one view saw, with their footprints from its eye.
  void add(const IdRows& rows, const scene::SceneInstant& instant, const dvec3& eye, float pixels_per_radian);
  // The set, sorted. A patch that several views saw has its largest footprint, by area.
  scene::VisiblePatches finish();

 private:
  void next_stamp();
  void see(scene::PatchId patch, const scene::SceneInstant& instant, const dvec3& eye,
           float pixels_per_radian);

  struct Mark {
    uint32_t stamp = 0;  // the last eye that saw the patch
    uint32_t index = 0;  // in seen_, if the stamp is of this set
  };
  const scene::Scene* scene_;
  TriangleToPatch patch_of_;
  std::vector<Mark> marks_;  // by patch
  uint32_t stamp_ = 0, first_stamp_ = 0;
  bool has_eye_ = false;
  dvec3 eye_{0};
  uint32_t instance_ = 0;  // of the last patch: neighbours in the picture are neighbours in the scene
  scene::VisiblePatches seen_;
};

}  // namespace tessera::pvs
