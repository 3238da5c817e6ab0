#include <algorithm>
#include <cmath>
#include <map>

#include "scene/gltf/accessor.h"
#include "scene/gltf/import.h"
#include "scene/mesh/source_mesh.h"

namespace tessera::scene {
namespace {

constexpr uint64_t kMaxInstances = 10'000'000;
constexpr double kMaxCoordinate = 1e30;  // of positions and in the world: differences stay finite in float
constexpr const char* kAttributes[] = {"POSITION",   "NORMAL",     "TANGENT",
                                       "TEXCOORD_0", "TEXCOORD_1", "COLOR_0"};
enum Attribute : size_t { position, normal, tangent, texcoord0, texcoord1, color0, attribute_count };

bool is_finite(const vec4& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z) && std::isfinite(v.w);
}

// What makes two primitives the same geometry.
struct GeometryKey {
  int mode, indices;
  std::array<int, attribute_count> attributes;
  int normal_map_texcoord;                    // of derived tangents; -1 = none are derived
  std::array<float, 6> normal_map_transform;  // likewise
  auto operator<=>(const GeometryKey&) const = default;
};

double largest(const vec3& v) {
  return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
}

uint32_t pack_color(const vec4& c) {
  uint32_t packed = 0;
  for (int k = 0; k < 4; ++k) {
    packed |= static_cast<uint32_t>(std::clamp(c[k], 0.f, 1.f) * 255.f + 0.5f) << (8 * k);
  }
  return packed;
}

class PrimitiveReader {
 public:
  PrimitiveReader(const Document& document, const GeometryKey& key, std::string path)
      : document_(document), key_(key), path_(std::move(path)) {}

  // Before anything is read.
  StatusOr<uint64_t> corner_count() const {
    if (key_.attributes[position] < 0) return document_.error(path_ + "/attributes/POSITION", "is missing");
    if (key_.indices < 0) return vertex_count();
    const AccessorView indices(document_, key_.indices);
    const int type = document_.model().accessors[static_cast<size_t>(key_.indices)].componentType;
    if (indices.components() != 1 || type == TINYGLTF_COMPONENT_TYPE_FLOAT ||
        type == TINYGLTF_COMPONENT_TYPE_BYTE || type == TINYGLTF_COMPONENT_TYPE_SHORT) {
      return document_.error(accessor_path(key_.indices) + "/componentType",
                             "indices must be unsigned integer scalars");
    }
    return indices.count();
  }

  StatusOr<SourceMesh> read() const {
    TESSERA_RETURN_IF_ERROR(check_attributes());
    TESSERA_ASSIGN_OR_RETURN(const std::vector<uint32_t> corners, read_corners());
    SourceMesh mesh;
    mesh.indices = to_triangles(corners);
    TESSERA_RETURN_IF_ERROR(read_vertices(mesh));
    return mesh;
  }

  bool has(Attribute a) const { return key_.attributes[a] >= 0; }

 private:
  static std::string accessor_path(int accessor) { return absl::StrCat("/accessors/", accessor); }
  size_t vertex_count() const {
    return document_.model().accessors[static_cast<size_t>(key_.attributes[position])].count;
  }

  Status check_attributes() const {
    constexpr int kComponents[attribute_count][2] = {{3, 3}, {3, 3}, {4, 4}, {2, 2}, {2, 2}, {3, 4}};
    for (size_t a = 0; a < attribute_count; ++a) {
      if (key_.attributes[a] < 0) continue;
      const AccessorView view(document_, key_.attributes[a]);
      const std::string path = accessor_path(key_.attributes[a]);
      if (view.components() < kComponents[a][0] || view.components() > kComponents[a][1]) {
        return document_.error(path + "/type",
                               absl::StrFormat("does not fit %s of %s", kAttributes[a], path_));
      }
      if (view.count() != vertex_count()) {
        return document_.error(path + "/count", absl::StrFormat("%d elements, but %s has %d vertices",
                                                                view.count(), path_, vertex_count()));
      }
    }
    return absl::OkStatus();
  }

  StatusOr<std::vector<uint32_t>> read_corners() const {
    std::vector<uint32_t> corners;
    if (key_.indices < 0) {
      for (size_t i = 0; i < vertex_count(); ++i) corners.push_back(static_cast<uint32_t>(i));
      return corners;
    }
    const AccessorView indices(document_, key_.indices);
    corners.reserve(indices.count());
    for (size_t i = 0; i < indices.count(); ++i) {
      corners.push_back(indices.read_index(i));
      if (corners.back() >= vertex_count()) {
        return document_.error(accessor_path(key_.indices),
                               absl::StrFormat("index %d is %d, but %s has %d vertices", i, corners.back(),
                                               path_, vertex_count()));
      }
    }
    return corners;
  }

  // Winding of strips and fans: glTF 2.0, 3.7.2.1.
  std::vector<uint32_t> to_triangles(std::vector<uint32_t> corners) const {
    if (key_.mode == TINYGLTF_MODE_TRIANGLES) {
      corners.resize(corners.size() / 3 * 3);
      return corners;
    }
    std::vector<uint32_t> triangles;
    for (size_t i = 0; i + 2 < corners.size(); ++i) {
      if (key_.mode == TINYGLTF_MODE_TRIANGLE_FAN) {
        triangles.insert(triangles.end(), {corners[i + 1], corners[i + 2], corners[0]});
      } else {
        triangles.insert(triangles.end(), {corners[i], corners[i + 1 + i % 2], corners[i + 2 - i % 2]});
      }
    }
    return triangles;
  }

  // Only vertices that are used: many primitives may share one large accessor.
  Status read_vertices(SourceMesh& mesh) const {
    std::vector<uint32_t> used = mesh.indices;
    std::sort(used.begin(), used.end());
    used.erase(std::unique(used.begin(), used.end()), used.end());
    for (uint32_t& index : mesh.indices) {
      index = static_cast<uint32_t>(std::lower_bound(used.begin(), used.end(), index) - used.begin());
    }
    Vertex empty{};
    empty.color = 0xffffffffu;
    empty.tangent = vec4(1, 0, 0, 1);
    mesh.vertices.assign(used.size(), empty);
    for (size_t a = 0; a < attribute_count; ++a) {
      if (key_.attributes[a] >= 0)
        TESSERA_RETURN_IF_ERROR(read_attribute(static_cast<Attribute>(a), used, mesh));
    }
    return absl::OkStatus();
  }

  Status read_attribute(Attribute attribute, const std::vector<uint32_t>& used, SourceMesh& mesh) const {
    const int accessor = key_.attributes[attribute];
    const AccessorView view(document_, accessor);
    for (size_t i = 0; i < used.size(); ++i) {
      const vec4 value = view.read(used[i]) + vec4(0.f);  // -0 becomes 0, so that equal vertices weld
      if (!is_finite(value))
        return document_.error(accessor_path(accessor), absl::StrFormat("element %d is not finite", used[i]));
      if (attribute == position && largest(vec3(value)) > kMaxCoordinate)
        return document_.error(accessor_path(accessor),
                               absl::StrFormat("element %d exceeds %g", used[i], kMaxCoordinate));
      set(attribute, value, view.components(), mesh.vertices[i]);
    }
    return absl::OkStatus();
  }

  static void set(Attribute attribute, const vec4& value, int components, Vertex& v) {
    switch (attribute) {
      case position:
        v.position = vec3(value);
        break;
      case normal:
        v.normal = vec3(value);
        break;
      case tangent:
        v.tangent = value;
        break;
      case texcoord0:
        v.u0 = value.x, v.v0 = value.y;
        break;
      case texcoord1:
        v.uv1 = vec2(value);
        break;
      case color0:
        v.color = pack_color(components == 4 ? value : vec4(vec3(value), 1));
        break;
      case attribute_count:
        break;
    }
  }

  const Document& document_;
  const GeometryKey& key_;
  std::string path_;
};

// Given tangents made orthogonal to the normal, with handedness of exactly +1 or -1.
void repair_tangents(SourceMesh& mesh) {
  for (Vertex& v : mesh.vertices) {
    const dvec3 n(v.normal), given(v.tangent);
    dvec3 t = given - n * glm::dot(n, given);
    if (!(glm::length(t) > 1e-6)) {
      const dvec3 axis = std::abs(n.x) < 0.6 ? dvec3(1, 0, 0) : dvec3(0, 1, 0);
      t = axis - n * glm::dot(n, axis);
    }
    v.tangent = vec4(vec3(glm::normalize(t)), v.tangent.w < 0 ? -1.f : 1.f);
  }
}

class MeshImporter {
 public:
  MeshImporter(const Document& document, const ImportOptions& options, Scene& scene, ImportNotes& notes)
      : document_(document), options_(options), scene_(scene), notes_(notes) {}

  Status run(const std::vector<uint32_t>& node_of) {
    const auto& nodes = document_.model().nodes;
    for (size_t i = 0; i < nodes.size(); ++i) {
      if (node_of[i] == kNone || nodes[i].mesh < 0) continue;
      TESSERA_RETURN_IF_ERROR(place_mesh(nodes[i].mesh, node_of[i]));
    }
    add_notes();
    TESSERA_RETURN_IF_ERROR(measure_instances());
    TESSERA_RETURN_IF_ERROR(split());
    for (SourceMesh& mesh : meshes_) scene_.geometries.push_back(build_geometry(std::move(mesh)));
    return absl::OkStatus();
  }

 private:
  Status place_mesh(int mesh, uint32_t node) {
    const auto& primitives = document_.model().meshes[static_cast<size_t>(mesh)].primitives;
    for (size_t p = 0; p < primitives.size(); ++p) {
      const std::string path = absl::StrFormat("/meshes/%d/primitives/%d", mesh, p);
      const int mode = primitives[p].mode;
      if (mode != TINYGLTF_MODE_TRIANGLES && mode != TINYGLTF_MODE_TRIANGLE_STRIP &&
          mode != TINYGLTF_MODE_TRIANGLE_FAN) {
        ++skipped_modes_;
        continue;
      }
      const uint32_t material = primitives[p].material < 0
                                    ? static_cast<uint32_t>(scene_.materials.size() - 1)
                                    : static_cast<uint32_t>(primitives[p].material);
      TESSERA_ASSIGN_OR_RETURN(const uint32_t geometry, find_geometry(mesh, p, material, path));
      if (meshes_[geometry].indices.empty()) continue;
      scene_.instances.push_back({geometry, material, node});
      if (scene_.instances.size() > kMaxInstances) {
        return document_.over_limit("/nodes", absl::StrFormat("more than %d instances", kMaxInstances));
      }
    }
    return absl::OkStatus();
  }

  GeometryKey key_of(const tinygltf::Primitive& primitive, const Material& material) const {
    GeometryKey key{primitive.mode, primitive.indices, {}, -1, {}};
    for (size_t a = 0; a < attribute_count; ++a) {
      const auto found = primitive.attributes.find(kAttributes[a]);
      key.attributes[a] = found == primitive.attributes.end() ? -1 : found->second;
    }
    const TextureRef& map = material.normal_texture;
    // Without normals a file's tangents mean nothing (glTF 2.0, 3.7.2.1).
    if (key.attributes[normal] < 0) key.attributes[tangent] = -1;
    if (map.texture != kNone && key.attributes[tangent] < 0) {
      key.normal_map_texcoord = static_cast<int>(map.texcoord);
      for (int i = 0; i < 6; ++i)
        key.normal_map_transform[static_cast<size_t>(i)] =
            map.uv_from_texcoord[static_cast<size_t>(i / 2)][i % 2];
    }
    return key;
  }

  StatusOr<uint32_t> find_geometry(int mesh, size_t p, uint32_t material, const std::string& path) {
    const tinygltf::Mesh& source = document_.model().meshes[static_cast<size_t>(mesh)];
    const GeometryKey key = key_of(source.primitives[p], scene_.materials[material]);
    if (const auto found = geometries_.find(key); found != geometries_.end()) return found->second;
    const PrimitiveReader reader(document_, key, path);
    TESSERA_ASSIGN_OR_RETURN(const uint64_t corners, reader.corner_count());
    const uint64_t triangles = key.mode == TINYGLTF_MODE_TRIANGLES ? corners / 3
                               : corners < 3                       ? 0
                                                                   : corners - 2;
    unique_triangles_ += triangles;
    if (unique_triangles_ > options_.limits.max_triangles) {
      return document_.over_limit(path,
                                  absl::StrFormat("more than %d triangles", options_.limits.max_triangles));
    }
    TESSERA_ASSIGN_OR_RETURN(SourceMesh read, reader.read());
    read.name = source.primitives.size() > 1 ? absl::StrCat(source.name, "/", p) : source.name;
    prepare(read, reader, scene_.materials[material].normal_texture);
    geometries_[key] = static_cast<uint32_t>(meshes_.size());
    double reach = 0;
    for (const Vertex& v : read.vertices) reach = std::max(reach, largest(v.position));
    reaches_.push_back(reach);
    meshes_.push_back(std::move(read));
    return static_cast<uint32_t>(meshes_.size() - 1);
  }

  void prepare(SourceMesh& mesh, const PrimitiveReader& reader, const TextureRef& normal_map) {
    degenerate_ += drop_degenerate_triangles(mesh);
    if (reader.has(normal)) {
      repair_normals(mesh);
    } else {
      set_flat_normals(mesh);
    }
    if (reader.has(tangent)) {
      repair_tangents(mesh);
    } else if (normal_map.texture != kNone) {
      weld_vertices(mesh);  // before, so that tangents are smooth where all else is
      derive_tangents(mesh, normal_map);
    }
    weld_vertices(mesh);
  }

  // SourceMesh::scale and the number of instances by mesh; refuses transforms that leave the range of floats.
  Status measure_instances() {
    const std::vector<dmat4> worlds = scene_.node_transforms(0);
    instance_counts_.assign(meshes_.size(), 0);
    for (SourceMesh& mesh : meshes_) mesh.scale = dvec3(0);
    uint64_t triangles = 0;
    std::vector<Instance> kept;
    for (const Instance& instance : scene_.instances) {
      const dmat4& world = worlds[instance.node];
      TESSERA_RETURN_IF_ERROR(check_world(instance, world));
      if (glm::determinant(glm::dmat3(world)) == 0 && !scene_.nodes[instance.node].moves) {
        ++flat_instances_;
        continue;
      }
      SourceMesh& mesh = meshes_[instance.geometry];
      for (int axis = 0; axis < 3; ++axis)
        mesh.scale[axis] = std::max(mesh.scale[axis], glm::length(dvec3(world[axis])));
      ++instance_counts_[instance.geometry];
      triangles += mesh.triangle_count();
      if (triangles > options_.limits.max_instanced_triangles) return instanced_limit();
      kept.push_back(instance);
    }
    scene_.instances = std::move(kept);
    if (flat_instances_ > 0)
      notes_.notes.push_back(absl::StrFormat("%d instances scaled to nothing are left out", flat_instances_));
    return absl::OkStatus();
  }

  Status check_world(const Instance& instance, const dmat4& world) const {
    for (int c = 0; c < 4; ++c) {
      for (int r = 0; r < 3; ++r) {
        if (std::abs(world[c][r]) <= kMaxCoordinate) continue;
        return document_.error(
            "/nodes", absl::StrFormat("the world transform of node \"%s\" is not finite or exceeds %g",
                                      scene_.nodes[instance.node].name, kMaxCoordinate));
      }
    }
    double scale = 0;
    for (int c = 0; c < 3; ++c) scale = std::max(scale, glm::length(dvec3(world[c])));
    if (scale * reaches_[instance.geometry] > kMaxCoordinate)
      return document_.error("/nodes", absl::StrFormat("node \"%s\" places its mesh beyond %g",
                                                       scene_.nodes[instance.node].name, kMaxCoordinate));
    return absl::OkStatus();
  }

  Status instanced_limit() const {
    return document_.over_limit("/nodes", absl::StrFormat("more than %d instanced triangles",
                                                          options_.limits.max_instanced_triangles));
  }

  // An edge length under which no limit is exceeded.
  double automatic_edge() const {
    uint64_t unique = 0, instanced = 0;
    for (size_t i = 0; i < meshes_.size(); ++i) {
      unique += meshes_[i].triangle_count();
      instanced += meshes_[i].triangle_count() * instance_counts_[i];
    }
    const ImportLimits& limits = options_.limits;
    const uint64_t room = std::min(limits.max_triangles - std::min(unique, limits.max_triangles),
                                   limits.max_instanced_triangles - instanced);
    return choose_max_edge(meshes_, instance_counts_, room);
  }

  Status split() {
    if (options_.max_edge_m < 0) return absl::OkStatus();
    const double max_edge_m = options_.max_edge_m > 0 ? options_.max_edge_m : automatic_edge();
    uint64_t before = 0, unique = 0, instanced = 0;
    for (size_t i = 0; i < meshes_.size(); ++i) {
      const uint64_t count = count_after_split(meshes_[i], max_edge_m, options_.limits.max_triangles);
      before += meshes_[i].triangle_count() * instance_counts_[i];
      unique += count;
      instanced += count * instance_counts_[i];
      if (unique > options_.limits.max_triangles || instanced > options_.limits.max_instanced_triangles) {
        return document_.over_limit(
            "",
            absl::StrFormat("splitting edges longer than %g m exceeds the limit on triangles", max_edge_m));
      }
    }
    for (SourceMesh& mesh : meshes_) split_long_edges(mesh, max_edge_m);
    notes_.notes.push_back(absl::StrFormat(
        "edges longer than %g m are split: %d instanced triangles became %d", max_edge_m, before, instanced));
    return absl::OkStatus();
  }

  void add_notes() {
    if (skipped_modes_ > 0)
      notes_.notes.push_back(
          absl::StrFormat("%d primitives of points or lines are left out", skipped_modes_));
    if (degenerate_ > 0)
      notes_.notes.push_back(absl::StrFormat("%d triangles without area are left out", degenerate_));
  }

  const Document& document_;
  const ImportOptions& options_;
  Scene& scene_;
  ImportNotes& notes_;
  std::map<GeometryKey, uint32_t> geometries_;
  std::vector<SourceMesh> meshes_;  // by geometry
  std::vector<double> reaches_;     // by geometry: largest coordinate
  std::vector<uint64_t> instance_counts_;
  uint64_t unique_triangles_ = 0, degenerate_ = 0, skipped_modes_ = 0, flat_instances_ = 0;
};

}  // namespace

Status import_meshes(const Document& document, const std::vector<uint32_t>& node_of,
                     const ImportOptions& options, Scene& scene, ImportNotes& notes) {
  return MeshImporter(document, options, scene, notes).run(node_of);
}

}  // namespace tessera::scene
