// Images are decoded on all cores; which thread takes which must not show.
#include <gtest/gtest.h>

#include "gltf_builder.h"

namespace tessera::scene {
namespace {

constexpr int kImages = 24;

// A triangle for each of `kImages` textures, whose pixels have all the value of their index.
GltfBuilder many_textures() {
  GltfBuilder b;
  const int positions = b.add_floats({0, 0, 0, 1, 0, 0, 0, 1, 0}, 3);
  const int uvs = b.add_floats({0, 0, 1, 0, 0, 1}, 2);
  json primitives = json::array();
  for (int i = 0; i < kImages; ++i) {
    b.append("textures", {{"source", b.add_image(32, 16 + i, static_cast<uint8_t>(i))}});
    b.append("materials", {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", i}}}}}});
    primitives.push_back({{"attributes", {{"POSITION", positions}, {"TEXCOORD_0", uvs}}}, {"material", i}});
  }
  b.append("meshes", {{"primitives", primitives}});
  b.append("nodes", {{"mesh", 0}});
  b.append("scenes", {{"nodes", {0}}});
  return b;
}

// Damages image `i` behind its header, so that only decoding can notice.
void damage(GltfBuilder& b, int i) {
  const json& view = b.document["bufferViews"][b.document["images"][i]["bufferView"].get<size_t>()];
  const size_t begin = view["byteOffset"], bytes = view["byteLength"];
  for (size_t at = begin + 41; at < begin + bytes; ++at) b.bin[at] ^= 0x5a;
}

TEST(ImageThreads, EachTextureGetsItsOwnPixels) {
  const auto scene = load(many_textures());
  ASSERT_TRUE(scene.ok()) << scene.status();
  ASSERT_EQ((*scene)->textures.size(), size_t{kImages});
  for (uint32_t i = 0; i < kImages; ++i) {
    const Texture& texture = (*scene)->textures[i];
    EXPECT_EQ(texture.height, 16 + i);
    EXPECT_EQ(texture.rgba, std::vector<uint8_t>(size_t{4} * 32 * (16 + i), static_cast<uint8_t>(i)));
  }
}

TEST(ImageThreads, TheFirstDamagedImageIsNamed) {
  GltfBuilder b = many_textures();
  damage(b, 21);
  damage(b, 9);
  const auto scene = load(b);
  ASSERT_FALSE(scene.ok());
  EXPECT_NE(scene.status().message().find("/images/9"), std::string::npos) << scene.status();
}

}  // namespace
}  // namespace tessera::scene
