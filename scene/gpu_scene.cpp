#include "scene/gpu_scene.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "scene/gpu_records.h"
#include "scene/texture_arrays.h"

namespace tessera::scene {
namespace {

// Bindings of scene.glsl, set 0.
enum SceneBinding : uint32_t {
  kVertices,
  kIndices,
  kPatches,
  kInstances,
  kMeshlets,
  kInstancedMeshlets,
  kMaterials,
  kTextures,
  kBufferBindings = kTextures
};

// Where each geometry's parts begin in the scene-wide buffers.
struct GeometryOffsets {
  uint32_t vertex, triangle, patch, meshlet;
};

struct Totals {
  uint64_t vertices = 0, triangles = 0, patches = 0, meshlets = 0, instanced_meshlets = 0;
};

Totals count(const Scene& scene) {
  Totals t;
  for (const Geometry& g : scene.geometries) {
    t.vertices += g.vertices.size();
    t.triangles += g.triangle_count();
    t.patches += g.patches.size();
    t.meshlets += g.meshlets.size();
  }
  for (const Instance& i : scene.instances)
    t.instanced_meshlets += scene.geometries[i.geometry].meshlets.size();
  return t;
}

// All indices on the device are 32 bits and one binding cannot be larger than the device's limit.
Status check_limits(const Totals& t, uint64_t limit) {
  const auto check = [&](const char* what, uint64_t number, uint64_t size) -> Status {
    if (number * size <= limit) return absl::OkStatus();
    return absl::ResourceExhaustedError(
        absl::StrFormat("scene: %d %s need %d MiB in one buffer, this device allows %d MiB: simplify the "
                        "scene or choose another device",
                        number, what, (number * size) >> 20, limit >> 20));
  };
  TESSERA_RETURN_IF_ERROR(check("vertices", t.vertices, sizeof(Vertex)));
  TESSERA_RETURN_IF_ERROR(check("triangles", t.triangles, 3 * sizeof(uint32_t)));
  TESSERA_RETURN_IF_ERROR(check("patches", t.patches, sizeof(PatchRecord)));
  TESSERA_RETURN_IF_ERROR(check("meshlets", t.meshlets, sizeof(MeshletRecord)));
  return check("instanced meshlets", t.instanced_meshlets, sizeof(InstancedMeshlet));
}

template <class T>
StatusOr<gpu::Buffer> upload(gpu::Device& device, std::vector<T> data, const char* name) {
  if (data.empty()) data.emplace_back();  // a binding cannot be empty
  return gpu::Buffer::create_filled(device, std::as_bytes(std::span<const T>(data)), name);
}

std::vector<Vertex> all_vertices(const Scene& scene, const Totals& totals) {
  std::vector<Vertex> out;
  out.reserve(totals.vertices);
  for (const Geometry& g : scene.geometries) out.insert(out.end(), g.vertices.begin(), g.vertices.end());
  return out;
}

std::vector<uint32_t> all_indices(const Scene& scene, const Totals& totals,
                                  std::span<const GeometryOffsets> offsets) {
  std::vector<uint32_t> out;
  out.reserve(3 * totals.triangles);
  for (size_t g = 0; g < scene.geometries.size(); ++g) {
    for (const uint32_t index : scene.geometries[g].indices) out.push_back(index + offsets[g].vertex);
  }
  return out;
}

std::vector<PatchRecord> all_patches(const Scene& scene, const Totals& totals,
                                     std::span<const GeometryOffsets> offsets) {
  std::vector<PatchRecord> out;
  out.reserve(totals.patches);
  for (size_t g = 0; g < scene.geometries.size(); ++g) {
    for (const Patch& p : scene.geometries[g].patches) {
      out.push_back({p.first_triangle + offsets[g].triangle, p.triangle_count});
    }
  }
  return out;
}

std::vector<MeshletRecord> all_meshlets(const Scene& scene, const Totals& totals,
                                        std::span<const GeometryOffsets> offsets) {
  std::vector<MeshletRecord> out;
  out.reserve(totals.meshlets);
  for (size_t g = 0; g < scene.geometries.size(); ++g) {
    for (const Meshlet& m : scene.geometries[g].meshlets) {
      out.push_back({m.center, m.radius, m.first_triangle + offsets[g].triangle, m.triangle_count,
                     m.first_patch + offsets[g].patch, m.patch_count});
    }
  }
  return out;
}

struct InstanceTables {
  std::vector<InstanceRecord> instances;
  std::vector<InstancedMeshlet> meshlets;
};

InstanceTables all_instances(const Scene& scene, const Totals& totals,
                             std::span<const GeometryOffsets> offsets) {
  InstanceTables out;
  out.instances.reserve(scene.instances.size());
  out.meshlets.reserve(totals.instanced_meshlets);
  for (uint32_t i = 0; i < scene.instances.size(); ++i) {
    const Instance& instance = scene.instances[i];
    const GeometryOffsets& offset = offsets[instance.geometry];
    out.instances.push_back({instance.geometry, instance.material, instance.first_patch,
                             instance.first_triangle, offset.patch, offset.triangle,
                             static_cast<uint32_t>(out.meshlets.size()),
                             scene.nodes[instance.node].moves ? kInstanceMoves : 0});
    const size_t meshlets = scene.geometries[instance.geometry].meshlets.size();
    for (uint32_t m = 0; m < meshlets; ++m) out.meshlets.push_back({i, offset.meshlet + m});
  }
  return out;
}

TextureUse to_use(const TextureRef& ref, std::span<const TextureSlot> slots) {
  const auto& c = ref.uv_from_texcoord;
  if (ref.texture == kNone) return {kNone, 0, {c[0], c[1], c[2]}};
  const TextureSlot slot = slots[ref.texture];
  return {slot.array, slot.layer | ref.texcoord << 16, {c[0], c[1], c[2]}};
}

std::vector<MaterialRecord> all_materials(const Scene& scene, std::span<const TextureSlot> slots) {
  std::vector<MaterialRecord> out;
  out.reserve(scene.materials.size());
  for (const Material& m : scene.materials) {
    uint32_t flags = 0;
    if (m.alpha_mode == AlphaMode::mask) flags |= kMaterialMask;
    if (m.double_sided) flags |= kMaterialDoubleSided;
    if (m.unlit) flags |= kMaterialUnlit;
    out.push_back({.base_color = m.base_color,
                   .emissive_metallic = vec4(m.emissive, m.metallic),
                   .roughness = m.roughness,
                   .normal_scale = m.normal_scale,
                   .occlusion_strength = m.occlusion_strength,
                   .alpha_cutoff = m.alpha_cutoff,
                   .flags = flags,
                   .pad = {},
                   .base_color_texture = to_use(m.base_color_texture, slots),
                   .metallic_roughness_texture = to_use(m.metallic_roughness_texture, slots),
                   .normal_texture = to_use(m.normal_texture, slots),
                   .emissive_texture = to_use(m.emissive_texture, slots),
                   .occlusion_texture = to_use(m.occlusion_texture, slots)});
  }
  return out;
}

std::vector<GeometryOffsets> geometry_offsets(const Scene& scene) {
  std::vector<GeometryOffsets> out;
  GeometryOffsets next{};
  for (const Geometry& g : scene.geometries) {
    out.push_back(next);
    next.vertex += static_cast<uint32_t>(g.vertices.size());
    next.triangle += g.triangle_count();
    next.patch += static_cast<uint32_t>(g.patches.size());
    next.meshlet += static_cast<uint32_t>(g.meshlets.size());
  }
  return out;
}

// Rows of the inverse transpose, scaled to at most 1: the cofactors, with the determinant's sign (a cofactor
// matrix exists where no inverse does, e.g. for an object scaled flat).
InstanceTransform to_transform(const dmat4& world, const dvec3& origin) {
  InstanceTransform out;
  const dvec3 x(world[0]), y(world[1]), z(world[2]), t = dvec3(world[3]) - origin;
  for (int r = 0; r < 3; ++r) out.rows[r] = vec4(x[r], y[r], z[r], t[r]);
  const double sign = glm::dot(glm::cross(x, y), z) < 0 ? -1 : 1;
  dvec3 columns[3] = {sign * glm::cross(y, z), sign * glm::cross(z, x), sign * glm::cross(x, y)};
  double largest = 0;
  for (const dvec3& c : columns) largest = std::max({largest, std::abs(c.x), std::abs(c.y), std::abs(c.z)});
  const double scale = largest > 0 ? 1 / largest : 0;
  for (int r = 0; r < 3; ++r) {
    out.normal[r] = vec4(scale * columns[0][r], scale * columns[1][r], scale * columns[2][r], 0);
  }
  out.normal[0].w = static_cast<float>(sign);
  return out;
}

}  // namespace

struct GpuScene::Impl {
  std::shared_ptr<const Scene> scene;
  std::vector<GeometryOffsets> offsets;
  std::array<gpu::Buffer, kBufferBindings> buffers;
  TextureArrays textures;
  gpu::BindLayout layout, instant_layout;
  gpu::BindGroup group;
  uint32_t instanced_meshlets = 0;
  uint64_t device_bytes = 0;

  Status upload_buffers(gpu::Device& device);
  Status bind(gpu::Device& device);
};

Status GpuScene::Impl::upload_buffers(gpu::Device& device) {
  const Scene& s = *scene;
  const Totals totals = count(s);
  TESSERA_RETURN_IF_ERROR(check_limits(totals, device.info().max_storage_buffer_range));
  offsets = geometry_offsets(s);
  // One table at a time, so that only one is in staging memory.
  TESSERA_ASSIGN_OR_RETURN(buffers[kVertices], upload(device, all_vertices(s, totals), "scene vertices"));
  TESSERA_ASSIGN_OR_RETURN(buffers[kIndices],
                           upload(device, all_indices(s, totals, offsets), "scene indices"));
  TESSERA_ASSIGN_OR_RETURN(buffers[kPatches],
                           upload(device, all_patches(s, totals, offsets), "scene patches"));
  TESSERA_ASSIGN_OR_RETURN(buffers[kMeshlets],
                           upload(device, all_meshlets(s, totals, offsets), "scene meshlets"));
  InstanceTables tables = all_instances(s, totals, offsets);
  instanced_meshlets = static_cast<uint32_t>(tables.meshlets.size());
  TESSERA_ASSIGN_OR_RETURN(buffers[kInstances],
                           upload(device, std::move(tables.instances), "scene instances"));
  TESSERA_ASSIGN_OR_RETURN(buffers[kInstancedMeshlets],
                           upload(device, std::move(tables.meshlets), "scene instanced meshlets"));
  TESSERA_ASSIGN_OR_RETURN(buffers[kMaterials],
                           upload(device, all_materials(s, textures.slots), "scene materials"));
  return absl::OkStatus();
}

Status GpuScene::Impl::bind(gpu::Device& device) {
  std::vector<gpu::Binding> bindings;
  for (uint32_t b = 0; b < kBufferBindings; ++b) bindings.push_back({b, gpu::BindingKind::storage_buffer});
  bindings.push_back(
      {kTextures, gpu::BindingKind::sampled_image, static_cast<uint32_t>(textures.images.size())});
  TESSERA_ASSIGN_OR_RETURN(layout, gpu::BindLayout::create(device, bindings));
  const gpu::Binding transforms{0, gpu::BindingKind::storage_buffer};
  TESSERA_ASSIGN_OR_RETURN(instant_layout, gpu::BindLayout::create(device, std::span(&transforms, 1)));
  TESSERA_ASSIGN_OR_RETURN(group, gpu::BindGroup::create(device, layout));
  for (uint32_t b = 0; b < kBufferBindings; ++b) group.set(b, buffers[b]);
  for (uint32_t t = 0; t < textures.images.size(); ++t)
    group.set(kTextures, textures.images[t], textures.samplers[t], t);
  return absl::OkStatus();
}

GpuScene::GpuScene(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
GpuScene::~GpuScene() = default;

StatusOr<std::unique_ptr<GpuScene>> GpuScene::create(gpu::Device& device,
                                                     std::shared_ptr<const Scene> scene) {
  auto impl = std::make_unique<Impl>();
  impl->scene = std::move(scene);
  const uint64_t bytes_before = device.memory_in_use();
  TESSERA_ASSIGN_OR_RETURN(impl->textures, upload_textures(device, impl->scene->textures));
  TESSERA_RETURN_IF_ERROR(impl->upload_buffers(device));
  TESSERA_RETURN_IF_ERROR(impl->bind(device));
  impl->device_bytes = device.memory_in_use() - bytes_before;
  return std::unique_ptr<GpuScene>(new GpuScene(std::move(impl)));
}

const Scene& GpuScene::scene() const {
  return *impl_->scene;
}
const gpu::BindLayout& GpuScene::layout() const {
  return impl_->layout;
}
const gpu::BindLayout& GpuScene::instant_layout() const {
  return impl_->instant_layout;
}
const gpu::BindGroup& GpuScene::group() const {
  return impl_->group;
}
const gpu::Buffer& GpuScene::indices() const {
  return impl_->buffers[kIndices];
}
uint32_t GpuScene::first_index(uint32_t geometry) const {
  return 3 * impl_->offsets[geometry].triangle;
}
uint32_t GpuScene::instanced_meshlet_count() const {
  return impl_->instanced_meshlets;
}
uint64_t GpuScene::device_bytes() const {
  return impl_->device_bytes;
}

std::vector<gpu::Constant> GpuScene::constants() const {
  return {{0, static_cast<uint32_t>(impl_->textures.images.size())}};
}

struct SceneInstant::Impl {
  const Scene* scene = nullptr;
  gpu::Buffer transforms;
  gpu::BindGroup group;
  bool is_set = false;
  TimeNs time_ns = 0;
  dvec3 origin{0};
  std::vector<dmat4> world;  // by instance
};

SceneInstant::SceneInstant(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
SceneInstant::~SceneInstant() = default;

StatusOr<std::unique_ptr<SceneInstant>> SceneInstant::create(gpu::Device& device, const GpuScene& scene) {
  auto impl = std::make_unique<Impl>();
  impl->scene = &scene.scene();
  const uint64_t bytes = std::max<size_t>(1, scene.scene().instances.size()) * sizeof(InstanceTransform);
  if (bytes > device.info().max_storage_buffer_range) {
    return absl::ResourceExhaustedError(
        absl::StrFormat("scene: %d instances are more than this device's buffers hold: join some",
                        scene.scene().instances.size()));
  }
  TESSERA_ASSIGN_OR_RETURN(impl->transforms,
                           gpu::Buffer::create(device, bytes, gpu::Memory::upload, "scene transforms"));
  TESSERA_ASSIGN_OR_RETURN(impl->group, gpu::BindGroup::create(device, scene.instant_layout()));
  impl->group.set(0, impl->transforms);
  return std::unique_ptr<SceneInstant>(new SceneInstant(std::move(impl)));
}

void SceneInstant::set(TimeNs time_ns, const dvec3& origin) {
  Impl& s = *impl_;
  const bool moved = !s.is_set || (s.scene->animation_length_s > 0 && time_ns != s.time_ns);
  const bool shifted = !s.is_set || origin != s.origin;
  s.time_ns = time_ns;
  s.origin = origin;
  if (!moved && !shifted) return;

  const auto& instances = s.scene->instances;
  const auto transforms = s.transforms.as<InstanceTransform>();
  const std::vector<dmat4> nodes = moved ? s.scene->node_transforms(time_ns) : std::vector<dmat4>();
  s.world.resize(instances.size());
  for (size_t i = 0; i < instances.size(); ++i) {
    const bool moves = !s.is_set || (moved && s.scene->nodes[instances[i].node].moves);
    if (moves) s.world[i] = nodes[instances[i].node];
    if (moves || shifted) transforms[i] = to_transform(s.world[i], origin);
  }
  s.is_set = true;
}

const dvec3& SceneInstant::origin() const {
  return impl_->origin;
}
TimeNs SceneInstant::time_ns() const {
  return impl_->time_ns;
}
const gpu::BindGroup& SceneInstant::group() const {
  return impl_->group;
}
const std::vector<dmat4>& SceneInstant::instance_transforms() const {
  return impl_->world;
}

}  // namespace tessera::scene
