// A valid file with random bytes changed, cut, or repeated, and with random JSON values replaced, must be
// loaded or refused, and never crash. What loads must be consistent.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "gltf_builder.h"

namespace tessera::scene {
namespace {

void expect_consistent(const Scene& scene) {
  for (const Geometry& g : scene.geometries) {
    for (const uint32_t i : g.indices) ASSERT_LT(i, g.vertices.size());
    for (const Vertex& v : g.vertices)
      ASSERT_TRUE(std::isfinite(v.position.x) && std::isfinite(v.normal.x) && std::isfinite(v.tangent.x));
  }
  for (const Instance& i : scene.instances) {
    ASSERT_LT(i.geometry, scene.geometries.size());
    ASSERT_LT(i.material, scene.materials.size());
  }
  for (const Material& m : scene.materials) {
    ASSERT_TRUE(m.base_color_texture.texture == kNone ||
                m.base_color_texture.texture < scene.textures.size());
  }
  for (const dmat4& m : scene.node_transforms(from_seconds(0.7))) ASSERT_FALSE(std::isnan(m[0][0]));
}

ImportOptions small_limits() {
  ImportOptions options;
  options.limits.max_triangles = options.limits.max_instanced_triangles = 100'000;
  options.limits.max_texture_bytes = 1 << 20;
  return options;
}

void load_and_check(const std::vector<std::byte>& file, int& loaded) {
  const auto scene = load_gltf(file, "mutant.glb", {}, small_limits());
  if (!scene.ok()) {
    ASSERT_FALSE(scene.status().message().empty());
    return;
  }
  ++loaded;
  expect_consistent(**scene);
}

TEST(Mutation, Bytes) {
  const std::vector<std::byte> original = sample_file().glb();
  std::mt19937 random(20240601);
  int loaded = 0;
  for (int round = 0; round < 3000; ++round) {
    std::vector<std::byte> file = original;
    for (uint32_t n = 1 + random() % 4; n > 0; --n) {
      const size_t at = random() % file.size();
      switch (random() % 4) {
        case 0:
          file[at] = static_cast<std::byte>(random());
          break;
        case 1:
          file[at] ^= static_cast<std::byte>(1u << random() % 8);
          break;
        case 2:
          file.erase(file.begin() + static_cast<ptrdiff_t>(at));
          break;
        default:
          file.insert(file.begin() + static_cast<ptrdiff_t>(at), static_cast<std::byte>(random() % 128));
      }
    }
    ASSERT_NO_FATAL_FAILURE(load_and_check(file, loaded)) << "round " << round;
  }
  EXPECT_GT(loaded, 30);  // changes that do not matter exist
}

json random_value(std::mt19937& random) {
  switch (random() % 12) {
    case 0:
      return nullptr;
    case 1:
      return -1;
    case 2:
      return random() % 8;
    case 3:
      return 4294967295u;
    case 4:
      return 18446744073709551615ull;
    case 5:
      return 1e308;
    case 6:
      return 0.5;
    case 7:
      return "MASK";
    case 8:
      return json::array({0, 1, 2});
    case 9:
      return json::object();
    case 10:
      return true;
    default:
      return 5121 + static_cast<int>(random() % 6);
  }
}

// Descends to a random value and replaces, erases or repeats it.
void mutate(json& value, std::mt19937& random) {
  if (value.is_structured() && !value.empty() && random() % 6 != 0) {
    auto child = value.begin();
    std::advance(child, static_cast<ptrdiff_t>(random() % value.size()));
    if (random() % 12 == 0) {
      value.erase(child);
    } else {
      mutate(*child, random);
    }
  } else if (value.is_array() && !value.empty() && random() % 2 == 0) {
    value.push_back(value[0]);
  } else {
    value = random_value(random);
  }
}

TEST(Mutation, Json) {
  const GltfBuilder original = sample_file();
  std::mt19937 random(7);
  int loaded = 0;
  for (int round = 0; round < 4000; ++round) {
    GltfBuilder file = original;
    for (uint32_t n = 1 + random() % 2; n > 0; --n) mutate(file.document, random);
    if (!file.document.is_object()) continue;
    ASSERT_NO_FATAL_FAILURE(load_and_check(file.glb(), loaded)) << file.document;
  }
  EXPECT_GT(loaded, 100);
}

}  // namespace
}  // namespace tessera::scene
