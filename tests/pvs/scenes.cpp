#include "scenes.h"

#include <algorithm>
#include <glm/gtc/matrix_transform.hpp>

namespace tessera::pvs {
namespace {

constexpr uint32_t kPatchesAMeshlet = 16;

void make_meshlets(scene::Geometry& g) {
  const auto patches = static_cast<uint32_t>(g.patches.size());
  for (uint32_t first = 0; first < patches; first += kPatchesAMeshlet) {
    const uint32_t count = std::min(kPatchesAMeshlet, patches - first);
    scene::Meshlet m{.first_patch = first, .patch_count = count};
    const scene::Patch& last = g.patches[first + count - 1];
    m.first_triangle = g.patches[first].first_triangle;
    m.triangle_count = last.first_triangle + last.triangle_count - m.first_triangle;
    Aabb box;
    const auto corner = [&](uint32_t i) { return g.vertices[g.indices[3 * m.first_triangle + i]].position; };
    for (uint32_t i = 0; i < 3 * m.triangle_count; ++i) box.add(corner(i));
    m.center = box.center();
    for (uint32_t i = 0; i < 3 * m.triangle_count; ++i)
      m.radius = std::max(m.radius, glm::distance(m.center, corner(i)));
    g.meshlets.push_back(m);
  }
}

// A repeatable number in [0, 1).
double hash(uint32_t x) {
  x ^= x >> 16;
  x *= 0x7feb352du;
  x ^= x >> 15;
  x *= 0x846ca68bu;
  x ^= x >> 16;
  return x / 4294967296.0;
}

}  // namespace

SceneBuilder::SceneBuilder() : scene_(std::make_shared<scene::Scene>()) {}

uint32_t SceneBuilder::add(scene::Geometry geometry) {
  make_meshlets(geometry);
  for (const scene::Vertex& v : geometry.vertices) geometry.bounds.add(v.position);
  scene_->geometries.push_back(std::move(geometry));
  return static_cast<uint32_t>(scene_->geometries.size() - 1);
}

// A face at +1 along axes[2], u along axes[0], v against axes[1].
void SceneBuilder::add_face(scene::Geometry& g, const mat3& axes, uint32_t cuts) {
  const auto first = static_cast<uint32_t>(g.vertices.size());
  for (uint32_t y = 0; y <= cuts; ++y) {
    for (uint32_t x = 0; x <= cuts; ++x) {
      const float u = float(x) / float(cuts), v = float(y) / float(cuts);
      g.vertices.push_back({.position = axes * vec3(2 * u - 1, 1 - 2 * v, 1),
                            .u0 = u,
                            .normal = axes[2],
                            .v0 = v,
                            .tangent = vec4(axes[0], 1),
                            .uv1 = vec2(u, v),
                            .color = 0xffffffffu});
    }
  }
  for (uint32_t y = 0; y < cuts; ++y) {
    for (uint32_t x = 0; x < cuts; ++x) {
      const uint32_t a = first + y * (cuts + 1) + x, b = a + 1, c = a + cuts + 1, d = c + 1;
      g.patches.push_back({g.triangle_count(), 2});
      // Counter-clockwise; the block's u axis runs from a to c.
      for (const uint32_t i : {a, c, b, d, b, c}) g.indices.push_back(i);
    }
  }
}

uint32_t SceneBuilder::box(uint32_t cuts) {
  scene::Geometry g{.name = "box"};
  const vec3 x(1, 0, 0), y(0, 1, 0), z(0, 0, 1);
  for (const mat3& axes :
       {mat3(x, y, z), mat3(-x, y, -z), mat3(-z, y, x), mat3(z, y, -x), mat3(x, -z, y), mat3(x, z, -y)}) {
    add_face(g, axes, cuts);
  }
  return add(std::move(g));
}

uint32_t SceneBuilder::quad(uint32_t cuts) {
  scene::Geometry g{.name = "quad"};
  add_face(g, mat3(1), cuts);
  for (scene::Vertex& v : g.vertices) v.position.z = 0;
  return add(std::move(g));
}

uint32_t SceneBuilder::geometry(const std::vector<vec3>& positions, const std::vector<uint32_t>& indices) {
  scene::Geometry g{.name = "mesh"};
  for (const vec3& p : positions) g.vertices.push_back({.position = p, .color = 0xffffffffu});
  g.indices = indices;
  for (uint32_t t = 0; t < g.triangle_count(); ++t) g.patches.push_back({t, 1});
  return add(std::move(g));
}

uint32_t SceneBuilder::material(const scene::Material& material) {
  scene_->materials.push_back(material);
  return static_cast<uint32_t>(scene_->materials.size() - 1);
}

uint32_t SceneBuilder::texture(const scene::Texture& texture) {
  scene_->textures.push_back(texture);
  return static_cast<uint32_t>(scene_->textures.size() - 1);
}

void SceneBuilder::place(uint32_t geometry, uint32_t material, const dmat4& transform, bool moves) {
  scene::Node node;
  node.matrix = transform;
  node.moves = moves;
  scene_->nodes.push_back(node);
  scene_->instances.push_back({geometry, material, static_cast<uint32_t>(scene_->nodes.size() - 1)});
}

std::shared_ptr<const scene::Scene> SceneBuilder::finish() {
  scene_->index_instances();
  return scene_;
}

dmat4 transform(const dvec3& translation, const dvec3& scale, double yaw) {
  return glm::scale(glm::rotate(glm::translate(dmat4(1), translation), yaw, dvec3(0, 1, 0)), scale);
}

scene::Texture half_mask(uint32_t size) {
  scene::Texture t{.name = "half",
                   .width = size,
                   .height = size,
                   .rgba = std::vector<uint8_t>(size_t{4} * size * size, 255)};
  for (size_t i = 0; i < size_t{size} * size; ++i) t.rgba[4 * i + 3] = i % size < size / 2 ? 255 : 0;
  t.srgb = true;
  t.wrap_u = t.wrap_v = scene::WrapMode::clamp_to_edge;
  return t;
}

std::shared_ptr<const scene::Scene> make_town(int side, bool with_masks) {
  SceneBuilder b;
  const uint32_t box = b.box(8), panel = b.quad(4);
  const uint32_t stone = b.material({.name = "stone"});
  const uint32_t cloth = b.material({.name = "cloth", .double_sided = true});
  uint32_t leaf = stone;
  if (with_masks) {
    scene::Material m{.name = "leaf", .alpha_mode = scene::AlphaMode::mask, .double_sided = true};
    m.base_color_texture.texture = b.texture(half_mask(16));
    leaf = b.material(m);
  }
  b.place(box, stone, transform({0, -1, 0}, {4.0 * side, 1, 4.0 * side}));
  for (int z = 0; z < side; ++z) {
    for (int x = 0; x < side; ++x) {
      const auto i = static_cast<uint32_t>(z * side + x);
      const dvec3 at(4.0 * (x - side / 2) + hash(4 * i), 0, 4.0 * (z - side / 2) + hash(4 * i + 1));
      const double height = 1 + 4 * hash(4 * i + 2), yaw = 6.28 * hash(4 * i + 3);
      const double mirror = i % 3 == 1 ? -1 : 1;
      b.place(box, stone,
              transform(at + dvec3(0, height - 0.13, 0), {0.9 * mirror, height, 0.4 + hash(i)}, yaw));
      if (i % 4 == 0) b.place(panel, cloth, transform(at + dvec3(1.9, 1.1, 0.7), {0.6, 1, 1}, yaw));
      if (with_masks && i % 4 == 1)
        b.place(panel, leaf, transform(at + dvec3(1.8, 1.3, 1.2), {0.5 * mirror, 0.8, 1}, yaw));
    }
  }
  return b.finish();
}

}  // namespace tessera::pvs
