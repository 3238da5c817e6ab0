#include "scene/procedural/shapes.h"

#include <algorithm>
#include <cmath>

namespace tessera::scene {
namespace {

uint32_t cells(float length, float cell_m) {
  return static_cast<uint32_t>(std::max(1.f, std::ceil(length / cell_m - 0.01f)));
}

// Two unit vectors that with `axis` make a right-handed frame (side, up, axis).
std::pair<vec3, vec3> frame_around(vec3 axis) {
  const vec3 hint = std::abs(axis.y) < 0.9f ? vec3(0, 1, 0) : vec3(1, 0, 0);
  const vec3 side = glm::normalize(glm::cross(hint, axis));
  return {side, glm::cross(axis, side)};
}

}  // namespace

void add_quad(SourceMesh& mesh, vec3 origin, vec3 right, vec3 up, float tile_m, float cell_m) {
  const float width = glm::length(right), height = glm::length(up);
  add_surface(mesh, cells(width, cell_m), cells(height, cell_m), vec2(width, height) / tile_m,
              [&](float u, float v) { return origin + u * right + v * up; });
}

void add_box(SourceMesh& mesh, vec3 center, vec3 size, float tile_m, float cell_m) {
  const vec3 x(size.x, 0, 0), y(0, size.y, 0), z(0, 0, size.z), low = center - 0.5f * size,
                                                                high = center + 0.5f * size;
  add_quad(mesh, low + z, x, y, tile_m, cell_m);
  add_quad(mesh, high - y, -z, y, tile_m, cell_m);
  add_quad(mesh, low + x, -x, y, tile_m, cell_m);
  add_quad(mesh, low, z, y, tile_m, cell_m);
  add_quad(mesh, low + y + z, x, -z, tile_m, cell_m);
  add_quad(mesh, low, x, z, tile_m, cell_m);
}

void add_pipe(SourceMesh& mesh, vec3 from, vec3 to, float radius, uint32_t sides, uint32_t rings) {
  const vec3 axis = to - from;
  const auto [side, up] = frame_around(glm::normalize(axis));
  add_surface(mesh, sides, rings, vec2(1, glm::length(axis)), [&, side = side, up = up](float u, float v) {
    return from + v * axis + radius * (std::cos(kTau * u) * side + std::sin(kTau * u) * up);
  });
}

void add_sphere(SourceMesh& mesh, vec3 center, float radius, uint32_t columns, uint32_t rows) {
  add_surface(mesh, columns, rows, vec2(4, 2), [&](float u, float v) {
    const float polar = 0.5f * kTau * (1 - v), around = -kTau * u;
    const float ring =
        v == 0 || v == 1 ? 0.f : std::sin(polar);  // exactly 0, so that triangles at the poles vanish
    return center + radius * vec3(ring * std::cos(around), std::cos(polar), ring * std::sin(around));
  });
}

void add_disc(SourceMesh& mesh, vec3 center, float radius, uint32_t sides) {
  add_surface(mesh, sides, 1, vec2(4, 1), [&](float u, float v) {
    const float r = radius * (1 - v);
    return center + vec3(r * std::cos(-kTau * u), 0, r * std::sin(-kTau * u));
  });
}

void add_knot(SourceMesh& mesh, vec3 center, float radius, float tube, uint32_t columns, uint32_t rows) {
  const auto curve = [&](float t) {
    const float r = radius * (0.7f + 0.3f * std::cos(3 * kTau * t));
    return vec3(r * std::cos(2 * kTau * t), 0.45f * radius * std::sin(3 * kTau * t),
                r * std::sin(2 * kTau * t));
  };
  add_surface(mesh, rows, columns, vec2(1, 8), [&](float u, float v) {
    const vec3 along = glm::normalize(curve(v + 1e-3f) - curve(v - 1e-3f));
    const vec3 out = glm::normalize(curve(v) - along * glm::dot(along, curve(v)));
    return center + curve(v) +
           tube * (std::cos(kTau * u) * out + std::sin(kTau * u) * glm::cross(along, out));
  });
}

void add_fluted_shaft(SourceMesh& mesh, vec3 base, float radius, float height, uint32_t flutes,
                      uint32_t sides, uint32_t rows) {
  add_surface(mesh, sides, rows, vec2(2, height), [&](float u, float v) {
    const float swell = 1 - 0.16f * v * v;
    const float groove = 0.5f - 0.5f * std::cos(kTau * u * static_cast<float>(flutes));
    const float r = radius * swell * (1 - 0.08f * groove);
    return base + vec3(r * std::cos(-kTau * u), height * v, r * std::sin(-kTau * u));
  });
}

void add_arch(SourceMesh& mesh, vec3 center, vec3 along, float radius, float thickness, float depth,
              uint32_t segments) {
  const vec3 up(0, 1, 0), front = glm::cross(along, up);
  const auto ring = [&](float u, float r, float z) {
    const float angle = 0.5f * kTau * (1 - u);
    return center + r * (std::cos(angle) * along + std::sin(angle) * up) + z * front;
  };
  const float outer = radius + thickness, half = 0.5f * depth;
  const vec2 repeats(0.5f * kTau * radius, depth);
  add_surface(mesh, segments, 1, repeats, [&](float u, float v) { return ring(u, outer, half - v * depth); });
  add_surface(mesh, segments, 1, repeats,
              [&](float u, float v) { return ring(u, radius, v * depth - half); });
  add_surface(mesh, segments, 1, repeats,
              [&](float u, float v) { return ring(u, radius + v * thickness, half); });
  add_surface(mesh, segments, 1, repeats,
              [&](float u, float v) { return ring(u, outer - v * thickness, -half); });
}

}  // namespace tessera::scene
