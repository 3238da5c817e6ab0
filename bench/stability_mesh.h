// Meshes of the stability catalogue, and the glTF files that carry them to the importer.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

#include "base/math.h"
#include "base/status.h"
#include "scene/gltf.h"

namespace tessera::bench {

// Unlit, coloured by its vertices. Colours have no blue, so that the background, which has, shows through any
// hole.
struct StabilityMesh {
  std::vector<vec3> positions, colors;
  std::vector<uint32_t> indices;  // 3 a triangle
  std::optional<dmat4> matrix;    // of its node
  bool double_sided = false;
  bool shares_vertices = false;  // by normals, (0, 0, 1); without any, each triangle gets vertices of its own

  void add(const vec3& position, const vec2& uv);
  void add_triangle(uint32_t a, uint32_t b, uint32_t c) { indices.insert(indices.end(), {a, b, c}); }
};

// The colour at (u, v) in 0..1: linear in both.
vec3 stability_color(const vec2& uv);

// A grid over columns x rows, as they are given from 0 to 1, ascending; point(u, v). Counter-clockwise if
// point() keeps the orientation.
using SurfacePoint = std::function<vec3(float u, float v)>;
StabilityMesh grid_mesh(const std::vector<float>& columns, const std::vector<float>& rows,
                        const SurfacePoint& point);
StabilityMesh grid_mesh(uint32_t columns, uint32_t rows, const SurfacePoint& point);
std::vector<float> even_steps(uint32_t cells);
// 1.75 m wide and high, one metre ahead of the origin: all but a rim of a view of 90 degrees, which it leaves
// at pixels' borders, where no sample lies.
vec3 on_screen(float u, float v);

// A .glb of it.
std::vector<std::byte> to_glb(const StabilityMesh& mesh);

struct ImportedMesh {
  std::shared_ptr<const scene::Scene> scene;
  std::vector<std::string> notes;
};
// By the importer. Triangles are not split unless max_edge_m says so (scene::ImportOptions).
StatusOr<ImportedMesh> import_mesh(const StabilityMesh& mesh, float max_edge_m = -1);

}  // namespace tessera::bench
