#include "bench/stability_mesh.h"

#include <cstring>
#include <nlohmann/json.hpp>

namespace tessera::bench {
namespace {

using nlohmann::json;

void append(std::vector<std::byte>& to, const void* data, size_t bytes) {
  const auto* from = static_cast<const std::byte*>(data);
  to.insert(to.end(), from, from + bytes);
}

void append_u32(std::vector<std::byte>& to, size_t value) {
  const auto word = static_cast<uint32_t>(value);
  append(to, &word, sizeof(word));
}

// Binary data, and the JSON that tells what is where. Accessor and buffer view i are the i-th column.
class Columns {
 public:
  template <class T>
  void add(const std::vector<T>& values, int component_type, size_t count, const char* type) {
    const size_t bytes = values.size() * sizeof(T);
    views.push_back({{"buffer", 0}, {"byteOffset", data.size()}, {"byteLength", bytes}});
    accessors.push_back({{"bufferView", views.size() - 1},
                         {"componentType", component_type},
                         {"count", count},
                         {"type", type}});
    append(data, values.data(), bytes);
  }
  std::vector<std::byte> data;
  json views = json::array(), accessors = json::array();
};

json node_of(const StabilityMesh& mesh) {
  json node = {{"mesh", 0}};
  if (!mesh.matrix) return node;
  for (int column = 0; column < 4; ++column)
    for (int row = 0; row < 4; ++row) node["matrix"].push_back((*mesh.matrix)[column][row]);
  return node;
}

}  // namespace

vec3 stability_color(const vec2& uv) {
  return {0.2f + 0.5f * uv.x, 0.2f + 0.5f * uv.y, 0};
}

void StabilityMesh::add(const vec3& position, const vec2& uv) {
  positions.push_back(position);
  colors.push_back(stability_color(uv));
}

std::vector<float> even_steps(uint32_t cells) {
  std::vector<float> steps;
  for (uint32_t i = 0; i <= cells; ++i) steps.push_back(static_cast<float>(i) / static_cast<float>(cells));
  return steps;
}

vec3 on_screen(float u, float v) {
  return {1.75f * u - 0.875f, 1.75f * v - 0.875f, -1};
}

StabilityMesh grid_mesh(const std::vector<float>& columns, const std::vector<float>& rows,
                        const SurfacePoint& point) {
  StabilityMesh mesh;
  for (const float v : rows)
    for (const float u : columns) mesh.add(point(u, v), {u, v});
  const auto width = static_cast<uint32_t>(columns.size());
  for (uint32_t j = 0; j + 1 < rows.size(); ++j)
    for (uint32_t i = 0; i + 1 < width; ++i) {
      const uint32_t a = j * width + i, b = a + 1, c = a + width, d = c + 1;
      mesh.add_triangle(a, b, c);
      mesh.add_triangle(d, c, b);
    }
  return mesh;
}

StabilityMesh grid_mesh(uint32_t columns, uint32_t rows, const SurfacePoint& point) {
  return grid_mesh(even_steps(columns), even_steps(rows), point);
}

std::vector<std::byte> to_glb(const StabilityMesh& mesh) {
  constexpr int kFloat = 5126, kUint = 5125;
  Columns columns;
  columns.add(mesh.positions, kFloat, mesh.positions.size(), "VEC3");
  columns.add(mesh.colors, kFloat, mesh.colors.size(), "VEC3");
  columns.add(mesh.indices, kUint, mesh.indices.size(), "SCALAR");
  json attributes = {{"POSITION", 0}, {"COLOR_0", 1}};
  if (mesh.shares_vertices) {
    columns.add(std::vector<vec3>(mesh.positions.size(), vec3(0, 0, 1)), kFloat, mesh.positions.size(),
                "VEC3");
    attributes["NORMAL"] = 3;
  }
  json document = {
      {"asset", {{"version", "2.0"}}},
      {"buffers", {{{"byteLength", columns.data.size()}}}},
      {"bufferViews", columns.views},
      {"accessors", columns.accessors},
      {"materials",
       {{{"doubleSided", mesh.double_sided}, {"extensions", {{"KHR_materials_unlit", json::object()}}}}}},
      {"meshes", {{{"primitives", {{{"attributes", attributes}, {"indices", 2}, {"material", 0}}}}}}},
      {"nodes", {node_of(mesh)}},
      {"scenes", {{{"nodes", {0}}}}},
      {"extensionsUsed", {"KHR_materials_unlit"}}};
  std::string text = document.dump();
  text.resize((text.size() + 3) / 4 * 4, ' ');
  constexpr uint32_t kMagic = 0x46546c67, kVersion = 2, kJsonChunk = 0x4e4f534a, kDataChunk = 0x004e4942;
  std::vector<std::byte> file;
  for (const size_t word : {size_t{kMagic}, size_t{kVersion}, 28 + text.size() + columns.data.size(),
                            text.size(), size_t{kJsonChunk}})
    append_u32(file, word);
  append(file, text.data(), text.size());
  append_u32(file, columns.data.size());
  append_u32(file, kDataChunk);
  append(file, columns.data.data(), columns.data.size());
  return file;
}

StatusOr<ImportedMesh> import_mesh(const StabilityMesh& mesh, float max_edge_m) {
  scene::ImportOptions options;
  options.max_edge_m = max_edge_m;
  scene::ImportNotes notes;
  TESSERA_ASSIGN_OR_RETURN(std::shared_ptr<scene::Scene> scene,
                           scene::load_gltf(to_glb(mesh), "stability.glb", {}, options, &notes));
  return ImportedMesh{std::move(scene), std::move(notes.notes)};
}

}  // namespace tessera::bench
