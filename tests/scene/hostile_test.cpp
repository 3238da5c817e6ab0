// Broken and hostile files: each must be refused with the place of the fault, and none may cost much memory.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <functional>

#include "gltf_builder.h"

namespace tessera::scene {
namespace {

using testing::HasSubstr;

struct Fault {
  const char* name;
  std::function<void(GltfBuilder&)> inject;
  const char* message;  // part of the error
};

void set_float(GltfBuilder& b, int accessor, size_t index, float value) {
  const size_t view = b.document["accessors"][static_cast<size_t>(accessor)]["bufferView"];
  const size_t offset = b.document["bufferViews"][view]["byteOffset"];
  std::memcpy(&b.bin[offset + 4 * index], &value, sizeof value);
}

constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInf = std::numeric_limits<float>::infinity();

const std::vector<Fault> kFaults = {
    {"no asset", [](auto& b) { b.document.erase("asset"); }, "test.glb: /asset: is missing"},
    {"version 1", [](auto& b) { b.document["asset"]["version"] = "1.0"; }, "/asset/version"},
    {"version is a number", [](auto& b) { b.document["asset"]["version"] = 2; },
     "/asset/version: must be a string"},
    {"root is an array", [](auto& b) { b.document = json::array(); }, "not a JSON object"},
    {"nodes is an object", [](auto& b) { b.document["nodes"] = json::object(); }, "/nodes: must be an array"},
    {"node is null", [](auto& b) { b.document["nodes"][1] = nullptr; }, "/nodes/1: must be an object"},
    {"extensionsUsed", [](auto& b) { b.document["extensionsUsed"] = "x"; },
     "/extensionsUsed: must be an array"},
    {"extensionsUsed/0", [](auto& b) { b.document["extensionsUsed"] = {7}; },
     "/extensionsUsed/0: must be a string"},
    // Buffers and views
    {"buffer length",
     [](auto& b) {
       b.document["buffers"] = {{{"byteLength", b.bin.size() + 8}}};
     },
     "/buffers/0/byteLength"},
    {"negative length",
     [](auto& b) {
       b.document["buffers"] = {{{"byteLength", -1}}};
     },
     "/buffers/0/byteLength"},
    {"second buffer",
     [](auto& b) {
       b.document["buffers"] = {{{"byteLength", 8}}, {{"byteLength", 8}}};
     },
     "/buffers/1/uri"},
    {"bad base64",
     [](auto& b) {
       b.document["buffers"] = {{{"byteLength", 8}, {"uri", "data:application/octet-stream;base64,!!!!"}}};
     },
     "/buffers/0/uri"},
    {"external buffer",
     [](auto& b) {
       b.document["buffers"] = {{{"byteLength", 8}, {"uri", "other.bin"}}};
     },
     "/buffers/0/uri"},
    {"view buffer", [](auto& b) { b.document["bufferViews"][1]["buffer"] = 1; }, "/bufferViews/1/buffer"},
    {"view end", [](auto& b) { b.document["bufferViews"][1]["byteLength"] = 1 << 30; },
     "/bufferViews/1/byteLength"},
    {"view offset", [](auto& b) { b.document["bufferViews"][1]["byteOffset"] = 1 << 30; },
     "/bufferViews/1/byteLength"},
    {"view offset wraps", [](auto& b) { b.document["bufferViews"][1]["byteOffset"] = 0xffffffffffffff00ull; },
     "/bufferViews/1/byteOffset"},
    {"view stride 2", [](auto& b) { b.document["bufferViews"][1]["byteStride"] = 2; },
     "/bufferViews/1/byteStride"},
    {"view stride 6", [](auto& b) { b.document["bufferViews"][1]["byteStride"] = 6; },
     "/bufferViews/1/byteStride"},
    {"view stride 8", [](auto& b) { b.document["bufferViews"][1]["byteStride"] = 8; },
     "/bufferViews/1/byteStride"},
    {"view stride 256", [](auto& b) { b.document["bufferViews"][1]["byteStride"] = 256; },
     "/bufferViews/1/byteStride"},
    // Accessors
    {"accessor view", [](auto& b) { b.document["accessors"][0]["bufferView"] = 99; },
     "/accessors/0/bufferView"},
    {"accessor count", [](auto& b) { b.document["accessors"][0]["count"] = 5; }, "/accessors/0/count"},
    {"accessor count 0", [](auto& b) { b.document["accessors"][0]["count"] = 0; }, "/accessors/0/count"},
    {"accessor huge count", [](auto& b) { b.document["accessors"][0]["count"] = 900'000'000'000'000ull; },
     "/accessors/0/count"},
    {"accessor count wraps", [](auto& b) { b.document["accessors"][0]["count"] = 0x5555555555555556ull; },
     "/accessors/0/count"},
    {"accessor count is text", [](auto& b) { b.document["accessors"][0]["count"] = "4"; },
     "/accessors/0/count: must be an integer"},
    {"accessor count is a fraction", [](auto& b) { b.document["accessors"][0]["count"] = 3.5; },
     "/accessors/0/count: must be an integer"},
    {"accessor component type", [](auto& b) { b.document["accessors"][0]["componentType"] = 5124; },
     "/accessors/0/componentType"},
    {"accessor type", [](auto& b) { b.document["accessors"][0]["type"] = "VEC5"; }, "/accessors/0/type"},
    {"accessor offset", [](auto& b) { b.document["accessors"][0]["byteOffset"] = 4; }, "/accessors/0/count"},
    {"zeros without end",
     [](auto& b) {
       for (int i = 0; i < 3; ++i)
         b.document["accessors"][i].erase("bufferView"),
             b.document["accessors"][i]["count"] = 4'000'000'000ull;
     },
     "/accessors/0/count: 4000000000 elements without a buffer view"},
    {"sparse count",
     [](auto& b) {
       b.document["accessors"][0]["sparse"] = {{"count", 9},
                                               {"indices", {{"bufferView", 3}, {"componentType", 5125}}},
                                               {"values", {{"bufferView", 0}}}};
     },
     "/accessors/0/sparse/count"},
    {"sparse order",
     [](auto& b) {
       b.document["accessors"][0]["sparse"] = {{"count", 4},
                                               {"indices", {{"bufferView", 3}, {"componentType", 5125}}},
                                               {"values", {{"bufferView", 0}}}};
     },
     "/accessors/0/sparse/indices: entry 3"},
    {"sparse index type",
     [](auto& b) {
       b.document["accessors"][0]["sparse"] = {{"count", 1},
                                               {"indices", {{"bufferView", 3}, {"componentType", 5122}}},
                                               {"values", {{"bufferView", 0}}}};
     },
     "/accessors/0/sparse/indices/componentType"},
    {"sparse values end",
     [](auto& b) {
       b.document["accessors"][0]["sparse"] = {{"count", 3},
                                               {"indices", {{"bufferView", 3}, {"componentType", 5125}}},
                                               {"values", {{"bufferView", 3}}}};
     },
     "/accessors/0/sparse/values"},
    {"sparse indices end",
     [](auto& b) {
       b.document["accessors"][0]["sparse"] = {
           {"count", 3},
           {"indices", {{"bufferView", 3}, {"byteOffset", 16}, {"componentType", 5125}}},
           {"values", {{"bufferView", 0}}}};
     },
     "/accessors/0/sparse/indices"},
    // Meshes
    {"position missing",
     [](auto& b) { b.document["meshes"][0]["primitives"][0]["attributes"].erase("POSITION"); },
     "/meshes/0/primitives/0/attributes/POSITION"},
    {"attribute index", [](auto& b) { b.document["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = 6; },
     "/meshes/0/primitives/0/attributes/NORMAL"},
    {"negative attribute",
     [](auto& b) { b.document["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = -1; },
     "/meshes/0/primitives/0/attributes/NORMAL"},
    {"position type", [](auto& b) { b.document["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = 2; },
     "/accessors/2/type"},
    {"attribute count", [](auto& b) { b.document["accessors"][1]["count"] = 3; }, "/accessors/1/count"},
    {"float indices", [](auto& b) { b.document["accessors"][3]["componentType"] = 5126; },
     "/accessors/3/componentType"},
    {"index range", [](auto& b) { set_float(b, 3, 4, 1e-44f); }, "/accessors/3: index 4"},
    {"material index", [](auto& b) { b.document["meshes"][0]["primitives"][0]["material"] = 1; },
     "/meshes/0/primitives/0/material"},
    {"mode", [](auto& b) { b.document["meshes"][0]["primitives"][0]["mode"] = 7; },
     "/meshes/0/primitives/0/mode"},
    {"NaN position", [](auto& b) { set_float(b, 0, 7, kNan); }, "/accessors/0: element 2 is not finite"},
    {"huge position", [](auto& b) { set_float(b, 0, 7, -3e38f); }, "/accessors/0: element 2 exceeds 1e+30"},
    {"huge mesh",
     [](auto& b) {
       for (const size_t k : {3, 6, 7, 10}) set_float(b, 0, k, 1e20f);
       b.document["nodes"][1]["scale"] = {1e15, 1e15, 1e15};
     },
     "/nodes: node \"a\" places its mesh beyond 1e+30"},
    {"Inf normal", [](auto& b) { set_float(b, 1, 0, kInf); }, "/accessors/1: element 0 is not finite"},
    {"NaN uv", [](auto& b) { set_float(b, 2, 3, kNan); }, "/accessors/2: element 1 is not finite"},
    // Nodes
    {"child index", [](auto& b) { b.document["nodes"][0]["children"][1] = 77; }, "/nodes/0/children/1"},
    {"self loop", [](auto& b) { b.document["nodes"][3]["children"] = {0}; }, "/nodes/0/children"},
    {"loop beside the scene",
     [](auto& b) {
       b.append("nodes", {{"children", {5}}}), b.append("nodes", {{"children", {4}}});
     },
     "/nodes/4/children"},
    {"two parents", [](auto& b) { b.document["nodes"][1]["children"] = {2}; }, "node 2 is a child"},
    {"child twice",
     [](auto& b) {
       b.document["nodes"][0]["children"] = {1, 2, 3, 1};
     },
     "/nodes/0/children/3"},
    {"root has a parent",
     [](auto& b) {
       b.document["scenes"][0]["nodes"] = {0, 1};
     },
     "/scenes/0/nodes/1: node 1 is not a root"},
    {"root twice",
     [](auto& b) {
       b.document["scenes"][0]["nodes"] = {0, 0};
     },
     "/scenes/0/nodes/1"},
    {"scene index", [](auto& b) { b.document["scene"] = 3; }, "/scene"},
    {"mesh index", [](auto& b) { b.document["nodes"][1]["mesh"] = 1; }, "/nodes/1/mesh"},
    {"translation length",
     [](auto& b) {
       b.document["nodes"][1]["translation"] = {0, 0};
     },
     "/nodes/1/translation"},
    {"translation type",
     [](auto& b) {
       b.document["nodes"][1]["translation"] = {0, "a", 0};
     },
     "/nodes/1/translation/1: must be a number"},
    {"scale range",
     [](auto& b) {
       b.document["nodes"][1]["scale"] = {1e300, 1, 1};
     },
     "/nodes/1/scale/0"},
    {"rotation zero",
     [](auto& b) {
       b.document["nodes"][1]["rotation"] = {0, 0, 0, 0};
     },
     "/nodes/1/rotation"},
    {"projective matrix", [](auto& b) { b.document["nodes"][2]["matrix"][3] = 1; }, "/nodes/2/matrix"},
    {"matrix null", [](auto& b) { b.document["nodes"][2]["matrix"][0] = nullptr; }, "/nodes/2/matrix/0"},
    {"world overflow",
     [](auto& b) {
       b.document["nodes"][0]["scale"] = {1e37, 1, 1};
       b.document["nodes"][1]["scale"] = {1e37, 1, 1};
     },
     "world transform"},
    // Materials, textures, images
    {"texture index", [](auto& b) { b.document["materials"][0]["normalTexture"]["index"] = 1; },
     "/materials/0/normalTexture/index"},
    {"alpha mode", [](auto& b) { b.document["materials"][0]["alphaMode"] = "GLASS"; },
     "/materials/0/alphaMode"},
    {"color length",
     [](auto& b) {
       b.document["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = {1, 1, 1};
     },
     "/materials/0/pbrMetallicRoughness/baseColorFactor"},
    {"roughness range",
     [](auto& b) { b.document["materials"][0]["pbrMetallicRoughness"]["roughnessFactor"] = 2; },
     "/materials/0/pbrMetallicRoughness/roughnessFactor"},
    {"image source", [](auto& b) { b.document["textures"][0]["source"] = 4; }, "/textures/0/source"},
    {"sampler index", [](auto& b) { b.document["textures"][0]["sampler"] = 4; }, "/textures/0/sampler"},
    {"image view", [](auto& b) { b.document["images"][0]["bufferView"] = 99; }, "/images/0/bufferView"},
    {"image without data", [](auto& b) { b.document["images"][0].erase("bufferView"); }, "/images/0"},
    {"image is geometry", [](auto& b) { b.document["images"][0]["bufferView"] = 0; },
     "/images/0: is neither PNG nor JPEG"},
    {"external image",
     [](auto& b) {
       b.document["images"][0] = {{"uri", "a.png"}};
     },
     "/images/0/uri"},
    // Animations and lights
    {"animation sampler", [](auto& b) { b.document["animations"][0]["channels"][0]["sampler"] = 5; },
     "/animations/0/channels/0/sampler"},
    {"animation input", [](auto& b) { b.document["animations"][0]["samplers"][0]["input"] = 99; },
     "/animations/0/samplers/0/input"},
    {"animation node", [](auto& b) { b.document["animations"][0]["channels"][0]["target"]["node"] = 99; },
     "/animations/0/channels/0/target/node"},
    {"animation path",
     [](auto& b) { b.document["animations"][0]["channels"][0]["target"]["path"] = "color"; },
     "/animations/0/channels/0/target/path"},
    {"animated matrix", [](auto& b) { b.document["animations"][0]["channels"][0]["target"]["node"] = 2; },
     "/animations/0/channels/0/target/node"},
    {"NaN time", [](auto& b) { set_float(b, 4, 1, kNan); }, "/accessors/4: time 1"},
    {"times fall", [](auto& b) { set_float(b, 4, 2, 0.5f); }, "/accessors/4: time 2 does not increase"},
    {"Inf value", [](auto& b) { set_float(b, 5, 0, kInf); }, "/accessors/5: element 0"},
    {"value count", [](auto& b) { b.document["accessors"][5]["count"] = 2; }, "/accessors/5/count"},
    {"value type", [](auto& b) { b.document["animations"][0]["channels"][0]["target"]["path"] = "rotation"; },
     "/accessors/5/type"},
    {"light index", [](auto& b) { b.document["nodes"][3]["extensions"]["KHR_lights_punctual"]["light"] = 1; },
     "/nodes/3/extensions/KHR_lights_punctual/light"},
    {"light type",
     [](auto& b) { b.document["extensions"]["KHR_lights_punctual"]["lights"][0]["type"] = "laser"; },
     "/extensions/KHR_lights_punctual/lights/0/type"},
    {"nothing to draw", [](auto& b) { b.document["scenes"][0]["nodes"] = json::array(); }, "no triangles"},
};

TEST(Hostile, SampleFileIsValid) {
  const auto scene = load(sample_file());
  ASSERT_TRUE(scene.ok()) << scene.status();
}

TEST(Hostile, EveryFaultIsRefusedWithItsPlace) {
  for (const Fault& fault : kFaults) {
    GltfBuilder file = sample_file();
    fault.inject(file);
    const auto scene = load(file);
    ASSERT_FALSE(scene.ok()) << fault.name;
    EXPECT_THAT(std::string(scene.status().message()), HasSubstr(fault.message)) << fault.name;
    EXPECT_THAT(std::string(scene.status().message()), HasSubstr("test.glb: ")) << fault.name;
  }
}

TEST(Hostile, RequiredExtensionThatIsUnknownIsNamed) {
  GltfBuilder file = sample_file();
  file.document["extensionsRequired"] = {"KHR_lights_punctual", "KHR_draco_mesh_compression"};
  const auto scene = load(file);
  EXPECT_EQ(scene.status().code(), absl::StatusCode::kUnimplemented);
  EXPECT_THAT(std::string(scene.status().message()),
              HasSubstr("/extensionsRequired/1: the file needs KHR_draco_mesh_compression"));
}

TEST(Hostile, OversizedImageIsRefusedByItsHeader) {
  GltfBuilder file = sample_file();
  const size_t view = file.document["images"][0]["bufferView"];
  const size_t png = file.document["bufferViews"][view]["byteOffset"];
  file.bin[png + 17] = 0x10;  // width 4 becomes 1,048,580
  const auto scene = load(file);
  EXPECT_EQ(scene.status().code(), absl::StatusCode::kResourceExhausted);
  EXPECT_THAT(std::string(scene.status().message()), HasSubstr("/images/0: 1048580x2 pixels"));
}

TEST(Hostile, LimitsAreKept) {
  const auto code = [](const std::function<void(ImportLimits&)>& change) {
    ImportOptions options;
    change(options.limits);
    return load(sample_file(), options).status().code();
  };
  constexpr auto kOver = absl::StatusCode::kResourceExhausted;
  EXPECT_EQ(code([](auto& l) { l.max_file_bytes = 100; }), kOver);
  EXPECT_EQ(code([](auto& l) { l.max_triangles = 1; }), kOver);
  EXPECT_EQ(code([](auto& l) { l.max_instanced_triangles = 5; }), kOver);
  EXPECT_EQ(code([](auto& l) { l.max_texture_bytes = 63; }), kOver);  // two uses of 4x2 RGBA
  EXPECT_EQ(code([](auto& l) { l.max_texture_side = 3; }), kOver);
  EXPECT_EQ(code([](auto& l) { l.max_nodes = 3; }), absl::StatusCode::kInvalidArgument);
  ImportOptions fine_cut;
  fine_cut.max_edge_m = 1e-4f;
  EXPECT_EQ(load(sample_file(), fine_cut).status().code(), kOver);
}

TEST(Hostile, TheAutomaticSplitStaysWithinTheLimits) {
  GltfBuilder file = sample_file();
  file.document["nodes"][0]["scale"] = {100, 100, 100};
  ImportOptions options;
  options.limits.max_triangles = 300;
  options.limits.max_instanced_triangles = 400;
  const auto scene = load(file, options);
  ASSERT_TRUE(scene.ok()) << scene.status();
  EXPECT_GT((*scene)->geometries[0].triangle_count(), 20u);
  EXPECT_LE((*scene)->geometries[0].triangle_count(), 400u / 3);
  options.limits.max_triangles = 2;  // what the file has
  EXPECT_TRUE(load(file, options).ok());
}

std::string message_of(const std::vector<std::byte>& file) {
  return std::string(load_gltf(file, "test.glb", {}).status().message());
}

TEST(Hostile, ContainerFaults) {
  const std::vector<std::byte> file = sample_file().glb();
  for (size_t size = 0; size < file.size(); ++size) {
    EXPECT_FALSE(load_gltf({file.begin(), file.begin() + static_cast<ptrdiff_t>(size)}, "test.glb", {}).ok())
        << size;
  }
  const auto with_byte = [&](size_t offset, int value) {
    std::vector<std::byte> broken = file;
    broken[offset] = static_cast<std::byte>(value);
    return message_of(broken);
  };
  EXPECT_THAT(with_byte(4, 1), HasSubstr("GLB version 1"));
  EXPECT_THAT(with_byte(11, 0x7f), HasSubstr("the GLB header says"));
  EXPECT_THAT(with_byte(15, 0x7f), HasSubstr("reaches past the file's end"));
  EXPECT_THAT(with_byte(16, 0), HasSubstr("chunk at byte 12 is of type"));
  EXPECT_THAT(with_byte(20, '['), HasSubstr("not valid JSON"));
}

TEST(Hostile, DeepOrCrowdedJson) {
  const std::string deep = "{\"asset\":{\"version\":\"2.0\"},\"extras\":" + std::string(100'000, '[') +
                           std::string(100'000, ']') + "}";
  EXPECT_THAT(message_of(GltfBuilder::glb(deep, {})), HasSubstr("nested deeper than"));
  std::string crowded = "[0";
  for (int i = 0; i < 20'000'001; ++i) crowded += ",0";
  EXPECT_THAT(message_of(GltfBuilder::glb(crowded + "]", {})), HasSubstr("more than 20000000 values"));
  EXPECT_THAT(message_of(GltfBuilder::glb("{\"asset\":1e999}", {})), HasSubstr("not valid JSON"));
}

class ExternalFiles : public testing::Test {
 protected:
  void SetUp() override {
    root_ = std::filesystem::path(testing::TempDir()) / absl::StrCat("tessera_gltf_", getpid());
    std::filesystem::create_directories(root_ / "models" / "sub");
    const GltfBuilder sample = sample_file();
    for (const char* place : {"secret.bin", "models/data.bin", "models/sub/my data.bin"}) {
      std::ofstream(root_ / place, std::ios::binary)
          .write(reinterpret_cast<const char*>(sample.bin.data()),
                 static_cast<std::streamsize>(sample.bin.size()));
    }
  }
  void TearDown() override { std::filesystem::remove_all(root_); }

  Status load_with(const std::string& uri) const {
    GltfBuilder file = sample_file();
    file.document["buffers"] = {{{"byteLength", file.bin.size()}, {"uri", uri}}};
    const std::string text = file.document.dump();
    return load_gltf(std::as_bytes(std::span(text)), "test.gltf", root_ / "models").status();
  }
  std::filesystem::path root_;
};

TEST_F(ExternalFiles, BesideAndBelowTheFile) {
  EXPECT_TRUE(load_with("data.bin").ok()) << load_with("data.bin");
  EXPECT_TRUE(load_with("./sub/my%20data.bin").ok()) << load_with("./sub/my%20data.bin");
  EXPECT_TRUE(load_with("sub/../data.bin").ok());
}

TEST_F(ExternalFiles, NeverAbove) {
  std::filesystem::create_symlink(root_ / "secret.bin", root_ / "models" / "link.bin");
  for (const std::string& uri :
       {std::string("../secret.bin"), std::string("sub/../../secret.bin"), std::string("%2e%2e/secret.bin"),
        (root_ / "secret.bin").string(), std::string("link.bin"), std::string("http://host/data.bin"),
        std::string("file:///etc/passwd"), std::string(""), std::string("."), std::string("missing.bin")}) {
    const Status status = load_with(uri);
    EXPECT_FALSE(status.ok()) << uri;
    EXPECT_THAT(std::string(status.message()), HasSubstr("test.gltf: /buffers/0/uri")) << uri;
  }
}

}  // namespace
}  // namespace tessera::scene
