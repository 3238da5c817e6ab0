#include "pvs/culling.h"

#include <algorithm>
#include <cstring>
#include <span>
#include <vector>

#include "pvs/shaders/compact.comp.spv.h"
#include "pvs/shaders/cull.comp.spv.h"
#include "pvs/shaders/pyramid.comp.spv.h"

namespace tessera::pvs {
namespace {

// Also in pvs/shaders/visibility.glsl.
constexpr uint32_t kGroupSize = 64;
constexpr uint32_t kPyramidTile = 2;
constexpr uint32_t kPyramidGroup = 8;

// Set 2 of pvs/shaders/visibility.glsl.
enum CullBinding : uint32_t {
  kInstanceBuckets,
  kWasVisible,
  kSurvivors,
  kGroupCounts,
  kDraws,
  kCounts,
  kPyramid,
  kDepth,
  kBounds
};

// Push constants of cull.comp.
struct CullPush {
  vec4 view_rows[3];
  vec4 fov;
  float near_m;
  uint32_t width, height;
  uint32_t meshlets;
  uint32_t flags;
};
constexpr uint32_t kFrustumFlag = 1, kOcclusionFlag = 2, kSecondPhaseFlag = 4;

// Push constants of compact.comp.
struct CompactPush {
  std::array<uint32_t, kBuckets> first_draw;
  uint32_t meshlets;
};

// Push constants of pyramid.comp.
struct LevelPush {
  uvec2 from_size, to_size;
  uint32_t from_start, to_start;
};

constexpr uint32_t groups(uint32_t items, uint32_t size) {
  return (items + size - 1) / size;
}

// Boxes in geometry space: they fit flat and long meshlets far better than their spheres.
struct MeshletBounds {
  vec4 low, high;
};

// In the order of the meshlets on the device: geometry by geometry.
std::vector<MeshletBounds> meshlet_bounds(const scene::Scene& scene) {
  std::vector<MeshletBounds> out;
  for (const scene::Geometry& g : scene.geometries) {
    for (const scene::Meshlet& m : g.meshlets) {
      Aabb box;
      for (uint32_t i = 0; i < 3 * m.triangle_count; ++i)
        box.add(g.vertices[g.indices[3 * m.first_triangle + i]].position);
      out.push_back({vec4(box.min, 0), vec4(box.max, 0)});
    }
  }
  return out;
}

uvec2 level_0_size(uint32_t width, uint32_t height) {
  return {groups(width, kPyramidTile), groups(height, kPyramidTile)};
}

uint64_t pyramid_texels(uint32_t width, uint32_t height) {
  uvec2 size = level_0_size(width, height);
  uint64_t texels = 1;
  for (; size.x > 1 || size.y > 1; size = (size + 1u) / 2u) texels += uint64_t{size.x} * size.y;
  return texels;
}

}  // namespace

StatusOr<MeshletCulling> MeshletCulling::create(gpu::Device& device, const scene::GpuScene& scene,
                                                const VisibilitySettings& settings) {
  MeshletCulling out;
  out.device_ = &device;
  out.scene_ = &scene;
  out.settings_ = settings;
  out.meshlets_ = scene.instanced_meshlet_count();
  TESSERA_RETURN_IF_ERROR(out.create_buffers());
  TESSERA_RETURN_IF_ERROR(out.create_pipelines());
  return out;
}

Status MeshletCulling::create_buffers() {
  const uint64_t meshlets = std::max(1u, meshlets_),
                 instances = std::max<size_t>(1, scene_->scene().instances.size());
  const auto make = [&](gpu::Buffer& buffer, uint64_t words, gpu::Memory memory, const char* name) -> Status {
    TESSERA_ASSIGN_OR_RETURN(buffer, gpu::Buffer::create(*device_, words * sizeof(uint32_t), memory, name));
    return absl::OkStatus();
  };
  TESSERA_RETURN_IF_ERROR(make(buckets_, instances, gpu::Memory::upload, "pvs instance buckets"));
  TESSERA_RETURN_IF_ERROR(make(was_visible_, meshlets, gpu::Memory::device, "pvs visible meshlets"));
  TESSERA_RETURN_IF_ERROR(make(survivors_, meshlets, gpu::Memory::device, "pvs surviving meshlets"));
  TESSERA_RETURN_IF_ERROR(make(group_counts_, uint64_t{kBuckets} * groups(meshlets, kGroupSize),
                               gpu::Memory::device, "pvs group counts"));
  TESSERA_RETURN_IF_ERROR(make(draws_, 5 * meshlets, gpu::Memory::device, "pvs draws"));
  TESSERA_RETURN_IF_ERROR(
      make(counts_, sizeof(CullCounts) / sizeof(uint32_t), gpu::Memory::device, "pvs draw counts"));
  std::vector<MeshletBounds> bounds = meshlet_bounds(scene_->scene());
  if (bounds.empty()) bounds.emplace_back();  // a binding cannot be empty
  TESSERA_ASSIGN_OR_RETURN(
      bounds_, gpu::Buffer::create_filled(*device_, std::as_bytes(std::span(bounds)), "pvs meshlet bounds"));
  TESSERA_ASSIGN_OR_RETURN(sampler_, gpu::Sampler::create(*device_, {.wrap_u = gpu::Wrap::clamp_to_edge,
                                                                     .wrap_v = gpu::Wrap::clamp_to_edge,
                                                                     .filter = gpu::Filter::nearest,
                                                                     .mip = gpu::Filter::nearest}));
  return absl::OkStatus();
}

Status MeshletCulling::create_pipelines() {
  std::vector<gpu::Binding> bindings;
  for (uint32_t b = kInstanceBuckets; b <= kPyramid; ++b)
    bindings.push_back({b, gpu::BindingKind::storage_buffer});
  bindings.push_back({kDepth, gpu::BindingKind::sampled_image});
  bindings.push_back({kBounds, gpu::BindingKind::storage_buffer});
  TESSERA_ASSIGN_OR_RETURN(layout_, gpu::BindLayout::create(*device_, bindings));
  TESSERA_ASSIGN_OR_RETURN(group_, gpu::BindGroup::create(*device_, layout_));
  group_.set(kInstanceBuckets, buckets_);
  group_.set(kWasVisible, was_visible_);
  group_.set(kSurvivors, survivors_);
  group_.set(kGroupCounts, group_counts_);
  group_.set(kDraws, draws_);
  group_.set(kCounts, counts_);
  group_.set(kBounds, bounds_);

  const auto make = [&](gpu::ComputePipeline& pipeline, const char* name, gpu::Spirv shader,
                        uint32_t push) -> Status {
    TESSERA_ASSIGN_OR_RETURN(
        pipeline, gpu::ComputePipeline::create(
                      *device_, {.name = name,
                                 .shader = shader,
                                 .layouts = {&scene_->layout(), &scene_->instant_layout(), &layout_},
                                 .push_bytes = push,
                                 .constants = scene_->constants()}));
    return absl::OkStatus();
  };
  TESSERA_RETURN_IF_ERROR(make(cull_, "pvs cull", cull_comp, sizeof(CullPush)));
  TESSERA_RETURN_IF_ERROR(make(compact_, "pvs compact", compact_comp, sizeof(CompactPush)));
  return make(pyramid_pass_, "pvs pyramid", pyramid_comp, sizeof(LevelPush));
}

Status MeshletCulling::set_depth(const gpu::Image& depth) {
  const uint64_t bytes = sizeof(float) * pyramid_texels(depth.width(), depth.height());
  if (bytes > pyramid_.size()) {
    TESSERA_ASSIGN_OR_RETURN(pyramid_,
                             gpu::Buffer::create(*device_, bytes, gpu::Memory::device, "pvs depth pyramid"));
    group_.set(kPyramid, pyramid_);
  }
  group_.set(kDepth, depth, sampler_);
  return absl::OkStatus();
}

void MeshletCulling::set_buckets(const BucketTable& buckets) {
  first_draw_ = buckets.first_draw;
  if (!buckets.of_instance.empty()) {
    std::memcpy(buckets_.mapped(), buckets.of_instance.data(), buckets.of_instance.size() * sizeof(uint32_t));
  }
}

void MeshletCulling::record_cull(gpu::Commands& commands, const scene::SceneInstant& instant,
                                 const View& view, CullPhase phase) const {
  const mat4 to_camera = view_matrix(view.pose, instant.origin());
  CullPush push{.fov = vec4(view.fov.left, view.fov.right, view.fov.down, view.fov.up),
                .near_m = view.near_m,
                .width = view.width,
                .height = view.height,
                .meshlets = meshlets_,
                .flags = 0};
  for (int row = 0; row < 3; ++row) {
    push.view_rows[row] = vec4(to_camera[0][row], to_camera[1][row], to_camera[2][row], to_camera[3][row]);
  }
  if (settings_.frustum_culling) push.flags |= kFrustumFlag;
  if (settings_.occlusion_culling) push.flags |= kOcclusionFlag;
  if (phase == CullPhase::second) push.flags |= kSecondPhaseFlag;
  const uint32_t count = groups(meshlets_, kGroupSize);

  commands.fill(counts_, 0);
  commands.bind(cull_, {&scene_->group(), &instant.group(), &group_});
  commands.push(push);
  commands.dispatch(count);
  commands.barrier();
  commands.bind(compact_, {&scene_->group(), &instant.group(), &group_});
  commands.push(CompactPush{first_draw_, meshlets_});
  commands.dispatch(count);
  commands.barrier();
}

void MeshletCulling::record_pyramid(gpu::Commands& commands, const scene::SceneInstant& instant,
                                    const View& view) const {
  commands.bind(pyramid_pass_, {&scene_->group(), &instant.group(), &group_});
  LevelPush level{.from_size = {view.width, view.height},
                  .to_size = level_0_size(view.width, view.height),
                  .from_start = scene::kNone,
                  .to_start = 0};
  for (;;) {
    commands.push(level);
    commands.dispatch(groups(level.to_size.x, kPyramidGroup), groups(level.to_size.y, kPyramidGroup));
    commands.barrier();
    if (level.to_size == uvec2(1)) return;
    level = {.from_size = level.to_size,
             .to_size = (level.to_size + 1u) / 2u,
             .from_start = level.to_start,
             .to_start = level.to_start + level.to_size.x * level.to_size.y};
  }
}

}  // namespace tessera::pvs
