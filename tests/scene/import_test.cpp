// What the import makes of valid files.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "gltf_builder.h"

namespace tessera::scene {
namespace {

using testing::Contains;
using testing::HasSubstr;

std::shared_ptr<Scene> must_load(const GltfBuilder& file, ImportNotes* notes = nullptr) {
  ImportOptions options;
  options.max_edge_m = -1;
  auto scene = load(file, options, notes);
  EXPECT_TRUE(scene.ok()) << scene.status();
  return scene.ok() ? *scene : nullptr;
}

TEST(Import, SampleFile) {
  const auto scene = must_load(sample_file());
  ASSERT_TRUE(scene);
  ASSERT_EQ(scene->geometries.size(), 1u);  // one mesh, three nodes
  EXPECT_EQ(scene->geometries[0].name, "quad");
  EXPECT_EQ(scene->instances.size(), 3u);
  EXPECT_EQ(scene->triangle_count, 6u);
  EXPECT_EQ(scene->patch_count, 3u);  // each quad is one patch
  EXPECT_EQ(scene->materials[0].roughness, 0.5f);
  EXPECT_EQ(scene->materials[0].emissive, vec3(0.5f, 0, 0));
  const Features& f = scene->features;
  EXPECT_TRUE(f.normal_maps && f.emissive && f.rigid_animation && f.mirrored_instances);
  EXPECT_FALSE(f.alpha_mask || f.unlit || f.occlusion_maps || f.vertex_colors || f.second_texcoord ||
               f.double_sided);
  EXPECT_EQ(f.spot_lights, 1u);
  EXPECT_FLOAT_EQ(f.largest_triangle_m2, 2);    // the root scales by 2
  EXPECT_FLOAT_EQ(f.most_slanted_triangle, 2);  // diagonal sqrt(8) / height sqrt(2)
  const Aabb box = scene->world_bounds(0);
  EXPECT_EQ(box.min, vec3(0));
  EXPECT_EQ(box.max, vec3(10, 2, 0));  // node b: x from 2 * (5 - 1) to 10
}

TEST(Import, TextureUsedAsColourAndDataBecomesTwo) {
  const auto scene = must_load(sample_file());
  ASSERT_EQ(scene->textures.size(), 2u);
  const Material& m = scene->materials[0];
  EXPECT_TRUE(scene->textures[m.base_color_texture.texture].srgb);
  EXPECT_FALSE(scene->textures[m.normal_texture.texture].srgb);
  for (const Texture& t : scene->textures) {
    EXPECT_EQ(t.width, 4u);
    EXPECT_EQ(t.height, 2u);
    EXPECT_EQ(t.rgba, std::vector<uint8_t>(32, 200));
    EXPECT_EQ(t.wrap_u, WrapMode::clamp_to_edge);
    EXPECT_EQ(t.wrap_v, WrapMode::mirrored_repeat);
    EXPECT_TRUE(t.nearest);
  }
}

TEST(Import, MaterialExtensionsAndAlpha) {
  GltfBuilder file = sample_file();
  json& m = file.document["materials"][0];
  m["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"] = 6;
  m["extensions"]["KHR_materials_unlit"] = json::object();
  m["alphaMode"] = "MASK";
  m["alphaCutoff"] = 0.25;
  m["doubleSided"] = true;
  m["occlusionTexture"] = {{"index", 0}, {"strength", 0.5}, {"texCoord", 1}};
  const auto scene = must_load(file);
  EXPECT_EQ(scene->materials[0].emissive, vec3(3, 0, 0));
  EXPECT_EQ(scene->materials[0].alpha_mode, AlphaMode::mask);
  EXPECT_EQ(scene->materials[0].alpha_cutoff, 0.25f);
  EXPECT_EQ(scene->materials[0].occlusion_strength, 0.5f);
  const Features& f = scene->features;
  EXPECT_TRUE(f.unlit && f.alpha_mask && f.double_sided && f.occlusion_maps && f.second_texcoord);
}

// Tuples: offset, rotation, scale; where (1, 0) and (0, 1) go. By the extension's own example, a rotation by
// 90 degrees takes u to -v and v to u.
TEST(Import, TextureTransform) {
  GltfBuilder file = sample_file();
  file.document["materials"][0]["normalTexture"]["extensions"]["KHR_texture_transform"] = {
      {"offset", {0, 1}}, {"rotation", 1.57079632679}, {"scale", {0.5, 0.25}}, {"texCoord", 1}};
  const auto scene = must_load(file);
  const TextureRef& ref = scene->materials[0].normal_texture;
  const auto map = [&](float u, float v) {
    return u * ref.uv_from_texcoord[0] + v * ref.uv_from_texcoord[1] + ref.uv_from_texcoord[2];
  };
  EXPECT_EQ(ref.texcoord, 1u);
  EXPECT_NEAR(glm::distance(map(0, 0), vec2(0, 1)), 0, 1e-6);
  EXPECT_NEAR(glm::distance(map(1, 0), vec2(0, 0.5f)), 0, 1e-6);
  EXPECT_NEAR(glm::distance(map(0, 1), vec2(0.25f, 1)), 0, 1e-6);
}

TEST(Import, BlendIsDrawnOpaqueAndSaidSo) {
  GltfBuilder file = sample_file();
  file.document["materials"][0]["alphaMode"] = "BLEND";
  ImportNotes notes;
  const auto scene = must_load(file, &notes);
  EXPECT_TRUE(scene->features.alpha_blend);
  EXPECT_THAT(notes.notes, Contains(HasSubstr("/materials/0 (paint): alphaMode BLEND is drawn opaque")));
}

TEST(Import, AccessorsSharedByMeshesBecomeOneGeometry) {
  GltfBuilder file = sample_file();
  file.append("materials", {{"name", "other"}, {"normalTexture", {{"index", 0}}}});
  json mesh = file.document["meshes"][0];
  mesh["primitives"][0]["material"] = 1;
  file.append("meshes", mesh);
  file.document["nodes"][1]["mesh"] = 1;
  const auto scene = must_load(file);
  EXPECT_EQ(scene->geometries.size(), 1u);
  EXPECT_EQ(scene->instances.size(), 3u);
  EXPECT_EQ(scene->instances[0].material, 1u);
  EXPECT_EQ(scene->instances[1].material, 0u);
}

TEST(Import, PrimitiveWithoutMaterialGetsTheDefault) {
  GltfBuilder file = sample_file();
  file.document["meshes"][0]["primitives"][0].erase("material");
  const auto scene = must_load(file);
  EXPECT_EQ(scene->materials[scene->instances[0].material].name, "default");
}

TEST(Import, StripsFansAndLines) {
  for (const auto& [mode, triangles] : {std::pair(4, 1), std::pair(5, 2), std::pair(6, 2)}) {
    GltfBuilder file;
    file.add_floats(mode == 5 ? std::vector<float>{0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0}
                              : std::vector<float>{0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0},
                    3);
    file.append("meshes", {{"primitives",
                            {{{"attributes", {{"POSITION", 0}}}, {"mode", mode}},
                             {{"attributes", {{"POSITION", 0}}}, {"mode", 1}}}}});
    file.append("nodes", {{"mesh", 0}});
    ImportNotes notes;
    const auto scene = must_load(file, &notes);
    ASSERT_EQ(scene->triangle_count, static_cast<uint32_t>(triangles)) << mode;
    for (const Vertex& v : scene->geometries[0].vertices)
      EXPECT_EQ(v.normal, vec3(0, 0, 1)) << mode;  // flat; winding kept
    EXPECT_THAT(notes.notes, Contains(HasSubstr("1 primitives of points or lines")));
  }
}

TEST(Import, DegenerateTrianglesAreDroppedAndSliversKept) {
  GltfBuilder file;
  file.add_floats({0, 0, 0, 1, 0, 0, 2, 0, 0, 0.5f, 1e-7f, 0}, 3);
  file.add_indices({0, 1, 2, 0, 1, 3, 1, 1, 3});
  file.append("meshes", {{"primitives", {{{"attributes", {{"POSITION", 0}}}, {"indices", 1}}}}});
  file.append("nodes", {{"mesh", 0}});
  ImportNotes notes;
  const auto scene = must_load(file, &notes);
  EXPECT_EQ(scene->triangle_count, 1u);
  EXPECT_NEAR(scene->features.most_slanted_triangle, 1e7, 1e2);
  EXPECT_THAT(notes.notes, Contains(HasSubstr("2 triangles without area")));
}

TEST(Import, VertexColoursAndSecondCoordinates) {
  GltfBuilder file = sample_file();
  file.add_floats({0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}, 3);
  file.add_floats({0, 0, 0.25f, 0, 0.25f, 0.5f, 0, 0.5f}, 2);
  json& attributes = file.document["meshes"][0]["primitives"][0]["attributes"];
  attributes["COLOR_0"] = 6;
  attributes["TEXCOORD_1"] = 7;
  const auto scene = must_load(file);
  EXPECT_TRUE(scene->features.vertex_colors);
  for (const Vertex& v : scene->geometries[0].vertices) {
    EXPECT_EQ(v.color, (v.position.x > 0 ? 0xffu : 0u) | (v.position.y > 0 ? 0xff00u : 0u) | 0xff000000u);
    EXPECT_EQ(v.uv1, vec2(0.25f * v.position.x, 0.5f * v.position.y));
  }
}

TEST(Import, IgnoredThingsAreNoted) {
  GltfBuilder file = sample_file();
  file.document["skins"] = {{{"joints", "hostile"}}};
  file.document["extensionsUsed"] = {"KHR_materials_clearcoat"};
  file.document["materials"][0]["extensions"]["KHR_materials_clearcoat"] = {
      {"clearcoatTexture", {{"index", 99}}}};
  file.document["meshes"][0]["primitives"][0]["targets"] = {{{"POSITION", 99}}};
  ImportNotes notes;
  ASSERT_TRUE(must_load(file, &notes));
  EXPECT_THAT(notes.notes, Contains(HasSubstr("skins are ignored")));
  EXPECT_THAT(notes.notes, Contains(HasSubstr("morph targets are ignored")));
  EXPECT_THAT(notes.notes, Contains("extension KHR_materials_clearcoat is ignored"));
}

TEST(Import, DataUriBuffer) {
  GltfBuilder file;
  // Three float positions: (0,0,0) (1,0,0) (0,1,0).
  file.document["buffers"] = {
      {{"byteLength", 36},
       {"uri", "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}}};
  file.document["bufferViews"] = {{{"buffer", 0}, {"byteLength", 36}}};
  file.add_accessor(0, 5126, 3, "VEC3");
  file.append("meshes", {{"primitives", {{{"attributes", {{"POSITION", 0}}}}}}});
  file.append("nodes", {{"mesh", 0}});
  const auto scene = must_load(file);
  ASSERT_TRUE(scene);
  EXPECT_EQ(scene->world_bounds(0).max, vec3(1, 1, 0));
}

// The plane z = 0 with u to the right and v down: T = +x, and cross(n, T) * w points up.
TEST(Import, DerivedTangents) {
  const auto scene = must_load(sample_file());
  for (const Vertex& v : scene->geometries[0].vertices) {
    EXPECT_NEAR(glm::distance(vec3(v.tangent), vec3(1, 0, 0)), 0, 1e-6);
    EXPECT_EQ(v.tangent.w, 1);
  }
}

TEST(Import, MirroredCoordinatesDoubleTheVerticesBetween) {
  GltfBuilder file = sample_file();
  // Two quads side by side whose u runs to x = 1 and back.
  const int positions = file.add_floats({0, 0, 0, 1, 0, 0, 2, 0, 0, 0, 1, 0, 1, 1, 0, 2, 1, 0}, 3);
  const int normals = file.add_floats({0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1}, 3);
  const int uvs = file.add_floats({0, 1, 1, 1, 0, 1, 0, 0, 1, 0, 0, 0}, 2);
  const int indices = file.add_indices({0, 1, 4, 0, 4, 3, 1, 2, 5, 1, 5, 4});
  json& primitive = file.document["meshes"][0]["primitives"][0];
  primitive["attributes"] = {{"POSITION", positions}, {"NORMAL", normals}, {"TEXCOORD_0", uvs}};
  primitive["indices"] = indices;
  const auto scene = must_load(file);
  const Geometry& g = scene->geometries[0];
  EXPECT_EQ(g.vertices.size(), 8u);
  for (size_t i = 0; i < g.indices.size(); ++i) {
    const float middle =
        (g.vertices[g.indices[i - i % 3]].position.x + g.vertices[g.indices[i - i % 3 + 1]].position.x +
         g.vertices[g.indices[i - i % 3 + 2]].position.x) /
        3;
    const vec4 expected = middle < 1 ? vec4(1, 0, 0, 1) : vec4(-1, 0, 0, -1);
    EXPECT_NEAR(glm::distance(g.vertices[g.indices[i]].tangent, expected), 0, 1e-6);
  }
}

}  // namespace
}  // namespace tessera::scene
