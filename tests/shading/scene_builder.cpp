#include "scene_builder.h"

#include <cmath>
#include <numbers>

namespace tessera::shading::test {
namespace {

scene::Vertex vertex(vec3 p, vec3 normal, vec3 tangent, vec2 uv) {
  scene::Vertex v{};
  v.position = p;
  v.normal = normal;
  v.tangent = vec4(tangent, 1);
  v.u0 = uv.x, v.v0 = uv.y;
  v.uv1 = uv;
  const auto byte = [](float x) { return static_cast<uint32_t>(std::lround(255 * x)); };
  v.color = byte(uv.x) | byte(uv.y) << 8 | 0xff000000u;
  return v;
}

}  // namespace

scene::Node node_towards(const dvec3& position, const dvec3& direction) {
  scene::Node n;
  n.translation = position;
  const dvec3 d = glm::normalize(direction);
  n.rotation = glm::quatLookAt(d, std::abs(d.y) < 0.99 ? dvec3(0, 1, 0) : dvec3(1, 0, 0));
  return n;
}

uint32_t SceneBuilder::material(const scene::Material& m) {
  scene_->materials.push_back(m);
  return static_cast<uint32_t>(scene_->materials.size() - 1);
}

uint32_t SceneBuilder::texture(scene::Texture t) {
  scene_->textures.push_back(std::move(t));
  return static_cast<uint32_t>(scene_->textures.size() - 1);
}

uint32_t SceneBuilder::node(const scene::Node& n) {
  scene_->nodes.push_back(n);
  return static_cast<uint32_t>(scene_->nodes.size() - 1);
}

uint32_t SceneBuilder::finish(scene::Geometry g) {
  for (const scene::Vertex& v : g.vertices) g.bounds.add(v.position);
  const auto patches = static_cast<uint32_t>(g.patches.size());
  for (uint32_t p = 0; p < patches; p += 32) {
    const uint32_t count = std::min(32u, patches - p);
    const uint32_t first = g.patches[p].first_triangle;
    const scene::Patch& last = g.patches[p + count - 1];
    const uint32_t end = last.first_triangle + last.triangle_count;
    g.meshlets.push_back(
        {first, end - first, p, count, g.bounds.center(), 0.5f * glm::length(g.bounds.extent())});
  }
  scene_->geometries.push_back(std::move(g));
  return static_cast<uint32_t>(scene_->geometries.size() - 1);
}

uint32_t SceneBuilder::rectangle(vec3 corner, vec3 u, vec3 v, uint32_t cells) {
  scene::Geometry g;
  const vec3 normal = glm::normalize(glm::cross(u, v));
  const float step = 1.0f / static_cast<float>(cells);
  for (uint32_t j = 0; j <= cells; ++j)
    for (uint32_t i = 0; i <= cells; ++i) {
      const vec2 uv = step * vec2(i, j);
      g.vertices.push_back(vertex(corner + uv.x * u + uv.y * v, normal, glm::normalize(u), uv));
    }
  for (uint32_t j = 0; j < cells; ++j)
    for (uint32_t i = 0; i < cells; ++i) {
      const uint32_t a = j * (cells + 1) + i, b = a + 1, c = a + cells + 1, d = c + 1;
      g.patches.push_back({static_cast<uint32_t>(g.indices.size() / 3), 2});
      g.indices.insert(g.indices.end(), {a, b, c, d, c, b});
    }
  for (scene::Vertex& v : g.vertices) v.color = ~0u;
  return finish(std::move(g));
}

uint32_t SceneBuilder::patch(uint32_t triangles) {
  scene::Geometry g;
  g.patches.push_back({0, triangles});
  for (uint32_t t = 0; t < triangles; ++t)
    for (uint32_t c = 0; c < 3; ++c) {
      const vec2 uv = scene::patch_corner(triangles, t, c);
      g.indices.push_back(static_cast<uint32_t>(g.vertices.size()));
      g.vertices.push_back(vertex(vec3(uv, 0), vec3(0, 0, 1), vec3(1, 0, 0), uv));
    }
  return finish(std::move(g));
}

uint32_t SceneBuilder::instance(uint32_t geometry, uint32_t material, const scene::Node& at) {
  scene_->instances.push_back({geometry, material, node(at)});
  return static_cast<uint32_t>(scene_->instances.size() - 1);
}

void SceneBuilder::light(const scene::Light& light, const dvec3& position, const dvec3& direction) {
  scene_->lights.push_back(light);
  scene_->lights.back().node = node(node_towards(position, direction));
}

std::shared_ptr<scene::Scene> SceneBuilder::build() {
  scene_->index_instances();
  return scene_;
}

scene::Material wavy(SceneBuilder& b, bool half_cut) {
  scene::Material m{.metallic = 0.3f, .roughness = 0.4f, .double_sided = true};
  m.base_color_texture.texture = b.texture(wavy_texture(64, half_cut));
  if (half_cut) m.alpha_mode = scene::AlphaMode::mask;
  return m;
}

scene::Texture wavy_texture(uint32_t side, bool half_cut) {
  scene::Texture t;
  t.width = t.height = side;
  t.srgb = true;
  t.wrap_u = t.wrap_v = scene::WrapMode::clamp_to_edge;
  t.rgba.resize(size_t{4} * side * side);
  const double turn = 2 * std::numbers::pi / side;
  for (uint32_t y = 0; y < side; ++y)
    for (uint32_t x = 0; x < side; ++x) {
      uint8_t* p = &t.rgba[4 * (size_t{y} * side + x)];
      p[0] = static_cast<uint8_t>(128 + 100 * std::sin(turn * x));
      p[1] = static_cast<uint8_t>(128 + 100 * std::cos(turn * y));
      p[2] = static_cast<uint8_t>(128 + 100 * std::sin(turn * (x + y)));
      p[3] = half_cut && x < side / 2 ? 0 : 255;
    }
  return t;
}

scene::Texture bumpy_texture(uint32_t side) {
  scene::Texture t = wavy_texture(side, false);
  t.srgb = false;
  for (size_t i = 2; i < t.rgba.size(); i += 4) t.rgba[i] = 255;
  return t;
}

}  // namespace tessera::shading::test
