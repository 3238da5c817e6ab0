#include "bench/coverage_meter.h"

#include <algorithm>

#include "pvs/visibility.h"

namespace tessera::bench {
namespace {

void add(pvs::Coverage& sum, const pvs::Coverage& part) {
  sum.seen_area += part.seen_area;
  sum.missed_area += part.missed_area;
  sum.extra_area += part.extra_area;
}

scene::Footprint larger(const scene::Footprint& a, const scene::Footprint& b) {
  return a.area_px2 >= b.area_px2 ? a : b;
}

}  // namespace

void CoverageMeter::add_frame(Frame frame) {
  if (wants(frame.from_ns)) open_.push_back(std::move(frame));
}

void CoverageMeter::add_seen(TimeNs now_ns, scene::VisiblePatches seen) {
  seen_.emplace_back(now_ns, std::move(seen));
  while (!open_.empty() && open_.front().to_ns <= now_ns) {
    finish(open_.front());
    open_.pop_front();
  }
  const TimeNs needed_from = open_.empty() ? seen_.back().first - kNsPerSecond : open_.front().from_ns;
  while (seen_.size() > 1 && seen_.front().first < std::min(needed_from, now_ns - kNsPerSecond))
    seen_.pop_front();
}

void CoverageMeter::finish(const Frame& frame) {
  scene::VisiblePatches seen;
  for (const auto& [time, patches] : seen_) {
    if (time >= frame.from_ns && time <= frame.to_ns) seen = unite(seen, patches);
  }
  add(placed_, pvs::compare(frame.placed, seen));
  add(without_prediction_, pvs::compare(frame.without_prediction, seen));
  add(predicted_vs_true_, pvs::compare(frame.predicted, frame.with_true_path));
  ++frames_;
}

CoverageMeter::Result CoverageMeter::result() const {
  return {placed_.coverage(), without_prediction_.coverage(), predicted_vs_true_.overestimation(), frames_};
}

scene::VisiblePatches unite(const scene::VisiblePatches& a, const scene::VisiblePatches& b) {
  scene::VisiblePatches out;
  out.reserve(a.size() + b.size());
  size_t i = 0, j = 0;
  while (i < a.size() || j < b.size()) {
    if (j == b.size() || (i < a.size() && a[i].patch < b[j].patch)) {
      out.push_back(a[i++]);
    } else if (i == a.size() || b[j].patch < a[i].patch) {
      out.push_back(b[j++]);
    } else {
      out.push_back({a[i].patch, larger(a[i].footprint, b[j].footprint)});
      ++i, ++j;
    }
  }
  return out;
}

scene::VisiblePatches visible_patches(const scene::Scene& scene, std::span<const uint32_t> triangle_plus_one,
                                      std::span<const dmat4> instance_transforms, const View& view) {
  std::vector<uint32_t> triangles(triangle_plus_one.begin(), triangle_plus_one.end());
  std::sort(triangles.begin(), triangles.end());
  triangles.erase(std::unique(triangles.begin(), triangles.end()), triangles.end());
  if (!triangles.empty() && triangles.front() == 0) triangles.erase(triangles.begin());

  scene::VisiblePatches out;
  uint32_t instance = 0;
  for (const uint32_t id : triangles) {
    const uint32_t triangle = id - 1;
    while (instance + 1 < scene.instances.size() && scene.instances[instance + 1].first_triangle <= triangle)
      ++instance;
    const scene::Instance& placed = scene.instances[instance];
    const scene::Geometry& geometry = scene.geometries[placed.geometry];
    const uint32_t local = triangle - placed.first_triangle;
    const auto after =
        std::upper_bound(geometry.patches.begin(), geometry.patches.end(), local,
                         [](uint32_t t, const scene::Patch& p) { return t < p.first_triangle; });
    const auto index = static_cast<uint32_t>(after - geometry.patches.begin() - 1);
    const scene::PatchId patch = placed.first_patch + index;
    if (!out.empty() && out.back().patch == patch) continue;
    out.push_back({patch, pvs::footprint(geometry, geometry.patches[index], instance_transforms[instance],
                                         view.pose.position, view.pixels_per_radian())});
  }
  return out;
}

}  // namespace tessera::bench
