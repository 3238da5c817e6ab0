#include "pvs/visibility.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "gpu/buffer.h"
#include "gpu/commands.h"
#include "pvs/buckets.h"
#include "pvs/culling.h"
#include "pvs/id_pass.h"
#include "pvs/marking.h"

namespace tessera::pvs {
namespace {

constexpr uint32_t kMaxSide = 16384;  // pixels
constexpr uint32_t kPhases = 2;

Status check(const View& view) {
  const Fov& f = view.fov;
  if (view.width == 0 || view.height == 0 || view.width > kMaxSide || view.height > kMaxSide) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "visibility: a view of %dx%d pixels; each side must be 1 to %d", view.width, view.height, kMaxSide));
  }
  if (!(f.left < f.right && f.down < f.up) || !std::isfinite(f.right - f.left) ||
      !std::isfinite(f.up - f.down) || !(view.near_m > 0) || !std::isfinite(view.near_m)) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "visibility: a view with tangents left %g, right %g, down %g, up %g and near plane %g m is empty",
        f.left, f.right, f.down, f.up, view.near_m));
  }
  return absl::OkStatus();
}

uint32_t scaled(uint32_t pixels, float scale) {
  return std::clamp(static_cast<uint32_t>(std::ceil(static_cast<float>(pixels) * scale)), 1u, kMaxSide);
}

}  // namespace

struct Visibility::Impl {
  Impl(gpu::Device& d, const scene::GpuScene& s, const VisibilitySettings& v)
      : device(d), scene(s), settings(v), marking(s.scene()) {}

  gpu::Device& device;
  const scene::GpuScene& scene;
  VisibilitySettings settings;
  std::optional<MeshletCulling> culling;
  std::optional<IdPass> pass;
  std::optional<BucketTable> buckets;
  gpu::Buffer ids, counts;  // read back: id buffer by view; CullCounts by view and phase
  PatchMarking marking;
  VisibilityStats stats;

  bool culls() const { return settings.frustum_culling || settings.occlusion_culling; }
  Status create();
  Status warm_up();
  Status prepare(const scene::SceneInstant& instant, std::span<const View> views);
  void record(gpu::Commands& commands, const scene::SceneInstant& instant, const View& view, size_t index);
  void record_phase(gpu::Commands& commands, const scene::SceneInstant& instant, const View& view,
                    size_t index, CullPhase phase);
  // Leaves the views' ids in `ids`. Views are normalised and checked.
  Status render(const scene::SceneInstant& instant, std::span<const View> views);
  void count(size_t views);
  IdRows rows(const View& view, size_t index) const;
};

Status Visibility::Impl::create() {
  if (!(settings.resolution_scale >= 0.25f && settings.resolution_scale <= 4)) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "visibility: resolution scale %g; choose one from 0.25 to 4", settings.resolution_scale));
  }
  TESSERA_ASSIGN_OR_RETURN(pass, IdPass::create(device, scene));
  TESSERA_ASSIGN_OR_RETURN(culling, MeshletCulling::create(device, scene, settings));
  return warm_up();
}

// The first use of a pipeline costs up to 400 ms on the software device.
Status Visibility::Impl::warm_up() {
  if (scene.instanced_meshlet_count() == 0) return absl::OkStatus();
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<scene::SceneInstant> instant,
                           scene::SceneInstant::create(device, scene));
  instant->set(0, dvec3(0));
  const View view{.width = 16, .height = 16};
  TESSERA_RETURN_IF_ERROR(prepare(*instant, std::span(&view, 1)));
  gpu::Commands commands = device.begin();
  pass->record_warm_up(commands, *instant, view);
  if (culls()) {
    culling->record_pyramid(commands, *instant, view);
    culling->record_cull(commands, *instant, view, CullPhase::first);
  }
  return device.run(std::move(commands));
}

Status Visibility::Impl::prepare(const scene::SceneInstant& instant, std::span<const View> views) {
  uint32_t width = 1, height = 1;
  for (const View& view : views) {
    width = std::max(width, view.width);
    height = std::max(height, view.height);
  }
  TESSERA_ASSIGN_OR_RETURN(const bool is_new, pass->reserve(width, height));
  if (is_new) TESSERA_RETURN_IF_ERROR(culling->set_depth(pass->depth()));
  if (const uint64_t bytes = views.size() * pass->id_bytes(); bytes > ids.size()) {
    TESSERA_ASSIGN_OR_RETURN(ids,
                             gpu::Buffer::create(device, bytes, gpu::Memory::readback, "pvs ids readback"));
  }
  if (const uint64_t bytes = views.size() * kPhases * sizeof(CullCounts); bytes > counts.size()) {
    TESSERA_ASSIGN_OR_RETURN(
        counts, gpu::Buffer::create(device, bytes, gpu::Memory::readback, "pvs counts readback"));
  }
  // Only an animated scale can turn an instance inside out.
  if (!buckets || scene.scene().features.rigid_animation) {
    buckets = make_buckets(scene.scene(), instant.instance_transforms());
    culling->set_buckets(*buckets);
  }
  return absl::OkStatus();
}

void Visibility::Impl::record_phase(gpu::Commands& commands, const scene::SceneInstant& instant,
                                    const View& view, size_t index, CullPhase phase) {
  const bool is_first = phase == CullPhase::first;
  culling->record_cull(commands, instant, view, phase);
  pass->record(commands, instant, view, *buckets, *culling, is_first);
  const uint64_t slot = kPhases * index + (is_first ? 0 : 1);
  commands.copy(culling->counts(), 0, counts, slot * sizeof(CullCounts), sizeof(CullCounts));
  commands.barrier();
}

void Visibility::Impl::record(gpu::Commands& commands, const scene::SceneInstant& instant, const View& view,
                              size_t index) {
  if (!culls()) {
    pass->record_all(commands, instant, view, *buckets);
  } else {
    record_phase(commands, instant, view, index, CullPhase::first);
    if (culling->has_second_phase()) {
      culling->record_pyramid(commands, instant, view);
      record_phase(commands, instant, view, index, CullPhase::second);
    }
  }
  commands.copy_to_buffer(pass->ids(), ids, index * pass->id_bytes());
  commands.barrier();
}

Status Visibility::Impl::render(const scene::SceneInstant& instant, std::span<const View> views) {
  TESSERA_RETURN_IF_ERROR(prepare(instant, views));
  gpu::Commands commands = device.begin();
  commands.begin_interval("visibility");
  for (size_t v = 0; v < views.size(); ++v) record(commands, instant, views[v], v);
  commands.end_interval();
  TESSERA_RETURN_IF_ERROR(device.run(std::move(commands)));
  count(views.size());
  return absl::OkStatus();
}

void Visibility::Impl::count(size_t views) {
  stats = {.views = static_cast<uint32_t>(views)};
  for (const gpu::Device::Interval& interval : device.intervals()) stats.gpu_ms += interval.ms;
  if (!culls()) {
    stats.meshlets_drawn = views * scene.instanced_meshlet_count();
    stats.triangles_drawn = uint64_t{views} * scene.scene().triangle_count;
    return;
  }
  const uint32_t phases = culling->has_second_phase() ? 2 : 1;
  stats.meshlets_tested = uint64_t{views} * phases * scene.instanced_meshlet_count();
  const auto written = counts.as<const CullCounts>();
  for (size_t v = 0; v < views; ++v) {
    for (uint32_t p = 0; p < phases; ++p) {
      const CullCounts& c = written[kPhases * v + p];
      stats.meshlets_drawn += c.meshlets;
      stats.triangles_drawn += c.triangles;
    }
  }
}

IdRows Visibility::Impl::rows(const View& view, size_t index) const {
  const size_t pixels = pass->id_bytes() / sizeof(uint32_t);
  return {ids.as<const uint32_t>().subspan(index * pixels, pixels), view.width, view.height,
          pass->ids().width()};
}

Visibility::Visibility(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Visibility::~Visibility() = default;

StatusOr<std::unique_ptr<Visibility>> Visibility::create(gpu::Device& device, const scene::GpuScene& scene,
                                                         const VisibilitySettings& settings) {
  auto impl = std::make_unique<Impl>(device, scene, settings);
  TESSERA_RETURN_IF_ERROR(impl->create());
  return std::unique_ptr<Visibility>(new Visibility(std::move(impl)));
}

StatusOr<scene::VisiblePatches> Visibility::determine(const scene::SceneInstant& instant,
                                                      std::span<const View> views, const View& client_view) {
  Impl& s = *impl_;
  std::vector<View> sized(views.begin(), views.end());
  for (View& view : sized) {
    view.pose = normalized(view.pose);
    TESSERA_RETURN_IF_ERROR(check(view));
    view.width = scaled(view.width, s.settings.resolution_scale);
    view.height = scaled(view.height, s.settings.resolution_scale);
  }
  s.stats = {.views = static_cast<uint32_t>(views.size())};
  if (views.empty() || s.scene.instanced_meshlet_count() == 0) return scene::VisiblePatches{};
  TESSERA_RETURN_IF_ERROR(s.render(instant, sized));
  s.marking.begin();
  for (size_t v = 0; v < sized.size(); ++v) {
    s.marking.add(s.rows(sized[v], v), instant, sized[v].pose.position, client_view.pixels_per_radian());
  }
  return s.marking.finish();
}

StatusOr<IdBuffer> Visibility::render_ids(const scene::SceneInstant& instant, const View& view) {
  Impl& s = *impl_;
  View safe = view;
  safe.pose = normalized(view.pose);
  TESSERA_RETURN_IF_ERROR(check(safe));
  IdBuffer out{view.width, view.height, std::vector<uint32_t>(size_t{view.width} * view.height)};
  s.stats = {.views = 1};
  if (s.scene.instanced_meshlet_count() == 0) return out;
  TESSERA_RETURN_IF_ERROR(s.render(instant, std::span(&safe, 1)));
  const IdRows rows = s.rows(safe, 0);
  for (uint32_t y = 0; y < out.height; ++y) {
    const auto row = rows.ids.subspan(size_t{y} * rows.stride, out.width);
    std::copy(row.begin(), row.end(),
              out.triangle_plus_one.begin() + static_cast<ptrdiff_t>(size_t{y} * out.width));
  }
  return out;
}

const VisibilityStats& Visibility::stats() const {
  return impl_->stats;
}

}  // namespace tessera::pvs
