#include "pvs/marking.h"

#include <algorithm>

namespace tessera::pvs {

TriangleToPatch::TriangleToPatch(const scene::Scene& scene) {
  patch_.reserve(scene.triangle_count);
  for (const scene::Instance& instance : scene.instances) {
    const auto& patches = scene.geometries[instance.geometry].patches;
    for (uint32_t p = 0; p < patches.size(); ++p) {
      patch_.insert(patch_.end(), patches[p].triangle_count, instance.first_patch + p);
    }
  }
}

PatchMarking::PatchMarking(const scene::Scene& scene)
    : scene_(&scene), patch_of_(scene), marks_(scene.patch_count) {}

void PatchMarking::next_stamp() {
  if (++stamp_ == 0) {  // wrapped: old stamps would look new
    std::fill(marks_.begin(), marks_.end(), Mark{});
    stamp_ = first_stamp_ = 1;
  }
}

void PatchMarking::begin() {
  seen_.clear();
  has_eye_ = false;
  // All eyes of one set get stamps without a wrap between them.
  if (stamp_ > ~uint32_t{0} - (1u << 16)) stamp_ = ~uint32_t{0};
  next_stamp();
  first_stamp_ = stamp_;
}

void PatchMarking::see(scene::PatchId patch, const scene::SceneInstant& instant, const dvec3& eye,
                       float pixels_per_radian) {
  const auto owns = [&](uint32_t i) {
    const scene::Instance& instance = scene_->instances[i];
    return patch >= instance.first_patch &&
           patch - instance.first_patch < scene_->geometries[instance.geometry].patches.size();
  };
  if (!owns(instance_)) instance_ = scene_->instance_of(patch);
  const scene::Instance& instance = scene_->instances[instance_];
  const scene::Geometry& geometry = scene_->geometries[instance.geometry];
  const scene::Footprint size = footprint(geometry, geometry.patches[patch - instance.first_patch],
                                          instant.instance_transforms()[instance_], eye, pixels_per_radian);
  Mark& mark = marks_[patch];
  if (mark.stamp < first_stamp_) {
    mark.index = static_cast<uint32_t>(seen_.size());
    seen_.push_back({patch, size});
  } else if (scene::Footprint& largest = seen_[mark.index].footprint; size.area_px2 > largest.area_px2) {
    largest = size;
  }
  mark.stamp = stamp_;
}

void PatchMarking::add(const IdRows& rows, const scene::SceneInstant& instant, const dvec3& eye,
                       float pixels_per_radian) {
  // Views from one eye point share their footprints.
  if (!has_eye_ || eye != eye_) next_stamp();
  has_eye_ = true;
  eye_ = eye;
  uint32_t last = 0;
  for (uint32_t y = 0; y < rows.height; ++y) {
    const uint32_t* row = rows.ids.data() + size_t{y} * rows.stride;
    for (uint32_t x = 0; x < rows.width; ++x) {
      const uint32_t id = row[x];
      if (id == last) continue;
      last = id;
      if (id == 0) continue;
      const scene::PatchId patch = patch_of_[id - 1];
      if (marks_[patch].stamp != stamp_) see(patch, instant, eye, pixels_per_radian);
    }
  }
}

scene::VisiblePatches PatchMarking::finish() {
  std::sort(seen_.begin(), seen_.end(), [](const auto& a, const auto& b) { return a.patch < b.patch; });
  return std::move(seen_);
}

}  // namespace tessera::pvs
