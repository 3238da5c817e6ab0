// Shapes that procedural scenes are put together from. Each appends to a mesh, in metres, with outward
// winding.
#pragma once

#include "scene/mesh/source_mesh.h"

namespace tessera::scene {

// A grid of columns x rows quads over a parametric surface: point(u, v) for u, v in 0..1, with cross(dP/du,
// dP/dv) outward. Smooth normals by central differences; texture coordinates (u, 1 - v) * repeats.
template <typename Point>
void add_surface(SourceMesh& mesh, uint32_t columns, uint32_t rows, vec2 repeats, Point point);

// The parallelogram origin, origin + right, origin + up, outside towards cross(right, up); `tile_m` metres a
// texture repeat, quads of at most `cell_m`.
void add_quad(SourceMesh& mesh, vec3 origin, vec3 right, vec3 up, float tile_m = 1, float cell_m = 1);
void add_box(SourceMesh& mesh, vec3 center, vec3 size, float tile_m = 1, float cell_m = 1);
// From `from` to `to`, without caps.
void add_pipe(SourceMesh& mesh, vec3 from, vec3 to, float radius, uint32_t sides, uint32_t rings = 1);
// Around the y axis through `base`: radius(v) for v in 0..1 from the bottom to `height`.
template <typename Radius>
void add_lathe(SourceMesh& mesh, vec3 base, float height, uint32_t sides, uint32_t rows, vec2 repeats,
               Radius radius);
void add_sphere(SourceMesh& mesh, vec3 center, float radius, uint32_t columns, uint32_t rows);
// A horizontal disc that faces up.
void add_disc(SourceMesh& mesh, vec3 center, float radius, uint32_t sides);
// The (2, 3) torus knot around the y axis.
void add_knot(SourceMesh& mesh, vec3 center, float radius, float tube, uint32_t columns, uint32_t rows);
// A column's shaft with grooves, slightly swelling (entasis).
void add_fluted_shaft(SourceMesh& mesh, vec3 base, float radius, float height, uint32_t flutes,
                      uint32_t sides, uint32_t rows);
// Half a ring of rectangular section from center - along * radius over the top to center + along * radius.
void add_arch(SourceMesh& mesh, vec3 center, vec3 along, float radius, float thickness, float depth,
              uint32_t segments);

constexpr float kTau = 6.283185307f;

template <typename Point>
void add_surface(SourceMesh& mesh, uint32_t columns, uint32_t rows, vec2 repeats, Point point) {
  const auto first = static_cast<uint32_t>(mesh.vertices.size());
  const float step = 1e-3f;
  for (uint32_t j = 0; j <= rows; ++j) {
    for (uint32_t i = 0; i <= columns; ++i) {
      const float u = static_cast<float>(i) / static_cast<float>(columns);
      const float v = static_cast<float>(j) / static_cast<float>(rows);
      const float inner = glm::clamp(v, step, 1 - step);  // at poles dP/du vanishes
      const vec3 du = point(u + step, inner) - point(u - step, inner);
      const vec3 dv = point(u, inner + step) - point(u, inner - step);
      Vertex vertex{};
      vertex.position = point(u, v);
      vertex.normal = glm::normalize(glm::cross(du, dv));
      vertex.u0 = u * repeats.x;
      vertex.v0 = (1 - v) * repeats.y;
      vertex.color = 0xffffffffu;
      mesh.vertices.push_back(vertex);
    }
  }
  for (uint32_t j = 0; j < rows; ++j) {
    for (uint32_t i = 0; i < columns; ++i) {
      const uint32_t a = first + j * (columns + 1) + i, b = a + 1, c = a + columns + 1, d = c + 1;
      mesh.indices.insert(mesh.indices.end(), {a, b, c, d, c, b});
    }
  }
}

template <typename Radius>
void add_lathe(SourceMesh& mesh, vec3 base, float height, uint32_t sides, uint32_t rows, vec2 repeats,
               Radius radius) {
  add_surface(mesh, sides, rows, repeats, [&](float u, float v) {
    // Clockwise from above, so that the normal points outward.
    return base + vec3(radius(v) * std::cos(-kTau * u), height * v, radius(v) * std::sin(-kTau * u));
  });
}

}  // namespace tessera::scene
