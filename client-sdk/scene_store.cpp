#include "client-sdk/scene_store.h"

namespace tessera::client {
namespace {

using geometry_compression::MetaFrame;
using geometry_compression::NewMesh;
using geometry_compression::NewVertex;
using geometry_compression::PlacementKind;

// Which of the patch's vertices each triangle joins, by count and triangle (scene::Patch).
constexpr uint8_t kTriangles[3][3][3] = {
    {{0, 1, 2}, {}, {}},
    {{0, 1, 2}, {3, 2, 1}, {}},
    {{0, 1, 2}, {3, 0, 2}, {1, 4, 2}},
};
constexpr uint8_t kFirstCornerKind[3] = {0, 1, 3};

vec3 position(const NewVertex& vertex, const NewMesh& mesh) {
  vec3 p;
  for (int i = 0; i < 3; ++i) p[i] = static_cast<float>(mesh.offset[i] + mesh.step * vertex.q[i]);
  return p;
}

}  // namespace

void SceneStore::apply(const MetaFrame& frame) {
  if (frame.full_state) forget_everything();
  state_.frame = frame.frame;
  state_.atlas_width = frame.atlas_width;
  state_.atlas_height = frame.atlas_height;
  append(frame);
  for (const auto& moved : frame.moved) state_.objects[moved.object].transform = moved.transform;
  for (const auto& placement : frame.placements) place(placement);
}

void SceneStore::forget_everything() {
  ++state_.epoch;
  state_.vertices.clear();
  state_.objects.clear();
  for (auto& group : state_.records) group.clear();
  for (auto& group : owners_) group.clear();
  meshes_.clear();
  patches_.clear();
}

void SceneStore::append(const MetaFrame& frame) {
  meshes_.insert(meshes_.end(), frame.meshes.begin(), frame.meshes.end());
  for (const auto& vertex : frame.vertices) state_.vertices.push_back(position(vertex, meshes_[vertex.mesh]));
  for (const auto& object : frame.objects) {
    state_.objects.push_back({object.transform, object.mirrored, object.double_sided, object.masked});
  }
  for (const auto& patch : frame.patches) patches_.push_back({patch.object, patch.triangles, patch.vertices});
}

int SceneStore::group_of(const Patch& patch) const {
  const ObjectState& object = state_.objects[patch.object];
  if (object.masked) {
    return static_cast<int>(object.double_sided ? RecordGroup::masked_double_sided
                                                : RecordGroup::masked_single_sided);
  }
  return static_cast<int>(object.double_sided ? RecordGroup::double_sided : RecordGroup::single_sided);
}

void SceneStore::place(const Placement& placement) {
  Patch& patch = patches_[placement.patch];
  if (placement.kind == PlacementKind::none) return remove_records(patch);

  const ObjectState& object = state_.objects[patch.object];
  const TriangleFields fields{.object = patch.object,
                              .transposed = placement.transposed,
                              .masked = object.masked,
                              .reversed = object.mirrored,
                              .single_color = placement.kind == PlacementKind::color,
                              .x = placement.x,
                              .y = placement.y,
                              .width = placement.width,
                              .height = placement.height,
                              .l = placement.l,
                              .halves = placement.halves,
                              .rgb = placement.rgb};
  if (placement.part != 0) return place_triangle(placement, placement.part - 1u, fields);
  for (uint32_t t = 0; t < patch.triangles; ++t) place_triangle(placement, t, fields);
}

// `fields`: what the patch's triangles have in common.
void SceneStore::place_triangle(const Placement& placement, uint32_t t, TriangleFields fields) {
  Patch& patch = patches_[placement.patch];
  const int group = group_of(patch);
  auto& records = state_.records[group];
  const bool whole = placement.part == 0;
  for (int corner = 0; corner < 3; ++corner) {
    const uint8_t of_patch = kTriangles[patch.triangles - 1][t][corner];
    fields.vertices[corner] = patch.vertices[of_patch];
    const int of_spacing = whole ? of_patch : corner;
    fields.spacing[corner] = of_spacing == 0 ? int8_t{0} : placement.spacing[of_spacing - 1];
  }
  fields.corner_kind = placement.kind == PlacementKind::l ? kCornerL
                       : placement.kind == PlacementKind::halves
                           ? kCornerHalves
                           : static_cast<uint8_t>(kFirstCornerKind[patch.triangles - 1] + t);
  if (patch.records[t] == kNoRecord) {
    patch.records[t] = static_cast<uint32_t>(records.size());
    records.emplace_back();
    owners_[group].push_back(placement.patch << 2 | t);
  }
  records[patch.records[t]] = pack(fields);
}

void SceneStore::remove_records(Patch& patch) {
  const int group = group_of(patch);
  auto& records = state_.records[group];
  auto& owners = owners_[group];
  for (uint32_t t = 0; t < patch.triangles; ++t) {
    const uint32_t hole = patch.records[t];
    if (hole == kNoRecord) continue;
    records[hole] = records.back();
    owners[hole] = owners.back();
    patches_[owners[hole] >> 2].records[owners[hole] & 3] = hole;
    patch.records[t] = kNoRecord;  // after the line above: the last record may be this one
    records.pop_back();
    owners.pop_back();
  }
}

void SceneStore::copy_to(SceneState& copy) const {
  if (copy.epoch != state_.epoch) copy.vertices.clear();
  const auto new_vertices = state_.vertices.begin() + static_cast<ptrdiff_t>(copy.vertices.size());
  copy.vertices.insert(copy.vertices.end(), new_vertices, state_.vertices.end());
  copy.frame = state_.frame;
  copy.atlas_width = state_.atlas_width;
  copy.atlas_height = state_.atlas_height;
  copy.epoch = state_.epoch;
  copy.objects = state_.objects;
  copy.records = state_.records;
}

}  // namespace tessera::client
