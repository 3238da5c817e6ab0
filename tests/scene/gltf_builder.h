// Makes glTF files in memory, right or wrong.
#pragma once

#include <stb_image_write.h>

#include <cstring>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "scene/gltf.h"

namespace tessera::scene {

using nlohmann::json;

class GltfBuilder {
 public:
  json document = {{"asset", {{"version", "2.0"}}}};
  std::vector<uint8_t> bin;

  template <typename T>
  int add_view(const std::vector<T>& values, int stride = 0) {
    while (bin.size() % 4 != 0) bin.push_back(0);
    json view = {{"buffer", 0}, {"byteOffset", bin.size()}, {"byteLength", values.size() * sizeof(T)}};
    if (stride > 0) view["byteStride"] = stride;
    const auto* bytes = reinterpret_cast<const uint8_t*>(values.data());
    bin.insert(bin.end(), bytes, bytes + values.size() * sizeof(T));
    return append("bufferViews", view);
  }

  int add_accessor(int view, int component_type, size_t count, const std::string& type,
                   bool normalized = false) {
    json accessor = {{"componentType", component_type}, {"count", count}, {"type", type}};
    if (view >= 0) accessor["bufferView"] = view;
    if (normalized) accessor["normalized"] = true;
    return append("accessors", accessor);
  }

  int add_floats(const std::vector<float>& values, int components) {
    const char* types[] = {"", "SCALAR", "VEC2", "VEC3", "VEC4"};
    return add_accessor(add_view(values), 5126, values.size() / static_cast<size_t>(components),
                        types[components]);
  }

  int add_indices(const std::vector<uint32_t>& values) {
    return add_accessor(add_view(values), 5125, values.size(), "SCALAR");
  }

  int add_image(int width, int height, uint8_t value) {
    const std::vector<uint8_t> pixels(static_cast<size_t>(width) * static_cast<size_t>(height) * 4, value);
    std::vector<uint8_t> png;
    stbi_write_png_to_func(
        [](void* out, void* data, int size) {
          const auto* bytes = static_cast<const uint8_t*>(data);
          auto& file = *static_cast<std::vector<uint8_t>*>(out);
          file.insert(file.end(), bytes, bytes + size);
        },
        &png, width, height, 4, pixels.data(), 4 * width);
    return append("images", {{"bufferView", add_view(png)}, {"mimeType", "image/png"}});
  }

  int append(const char* array, const json& element) {
    document[array].push_back(element);
    return static_cast<int>(document[array].size()) - 1;
  }

  std::vector<std::byte> glb() const {
    json complete = document;
    if (complete.is_object() && !bin.empty() && !complete.contains("buffers"))
      complete["buffers"] = {{{"byteLength", bin.size()}}};
    return glb(complete.dump(), bin);
  }

  static std::vector<std::byte> glb(std::string text, std::vector<uint8_t> data) {
    while (text.size() % 4 != 0) text.push_back(' ');
    while (data.size() % 4 != 0) data.push_back(0);
    std::vector<std::byte> file;
    const auto u32 = [&](size_t value) {
      for (int shift = 0; shift < 32; shift += 8)
        file.push_back(static_cast<std::byte>(value >> shift & 255));
    };
    u32(0x46546C67), u32(2), u32(12 + 8 + text.size() + (data.empty() ? 0 : 8 + data.size()));
    u32(text.size()), u32(0x4E4F534A);
    for (const char c : text) file.push_back(static_cast<std::byte>(c));
    if (data.empty()) return file;
    u32(data.size()), u32(0x004E4942);
    for (const uint8_t b : data) file.push_back(static_cast<std::byte>(b));
    return file;
  }
};

inline StatusOr<std::shared_ptr<Scene>> load(const GltfBuilder& builder, const ImportOptions& options = {},
                                             ImportNotes* notes = nullptr) {
  return load_gltf(builder.glb(), "test.glb", {}, options, notes);
}

// A file that uses most of what the import reads: a textured, normal-mapped unit quad in the xy plane,
// instanced by three nodes, one of them animated, and a spot light. Accessors: 0 positions, 1 normals, 2
// texture coordinates, 3 indices, 4 times, 5 translations.
inline GltfBuilder sample_file() {
  GltfBuilder b;
  b.add_floats({0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}, 3);
  b.add_floats({0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1}, 3);
  b.add_floats({0, 1, 1, 1, 1, 0, 0, 0}, 2);
  b.add_indices({0, 1, 2, 0, 2, 3});
  b.add_floats({0, 1, 2}, 1);
  b.add_floats({0, 0, 0, 4, 0, 0, 4, 2, 0}, 3);
  b.add_image(4, 2, 200);
  b.append("samplers", {{"wrapS", 33071}, {"wrapT", 33648}, {"magFilter", 9728}});
  b.append("textures", {{"source", 0}, {"sampler", 0}});
  b.append("materials",
           {{"name", "paint"},
            {"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}, {"roughnessFactor", 0.5}}},
            {"normalTexture", {{"index", 0}}},
            {"emissiveFactor", {0.5, 0, 0}}});
  b.append("meshes", {{"name", "quad"},
                      {"primitives",
                       {{{"attributes", {{"POSITION", 0}, {"NORMAL", 1}, {"TEXCOORD_0", 2}}},
                         {"indices", 3},
                         {"material", 0}}}}});
  b.append("nodes", {{"name", "root"}, {"children", {1, 2, 3}}, {"scale", {2, 2, 2}}});
  b.append("nodes", {{"name", "a"}, {"mesh", 0}, {"rotation", {0, 0, 0, 1}}});
  b.append("nodes",
           {{"name", "b"}, {"mesh", 0}, {"matrix", {-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 0, 0, 1}}});
  b.append("nodes", {{"name", "c"}, {"mesh", 0}, {"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
  b.append("scenes", {{"nodes", {0}}});
  b.append("animations",
           {{"channels", {{{"sampler", 0}, {"target", {{"node", 3}, {"path", "translation"}}}}}},
            {"samplers", {{{"input", 4}, {"output", 5}}}}});
  b.document["extensions"]["KHR_lights_punctual"]["lights"] = {
      {{"type", "spot"}, {"intensity", 7}, {"spot", {{"outerConeAngle", 0.5}}}}};
  b.document["extensionsUsed"] = {"KHR_lights_punctual"};
  return b;
}

}  // namespace tessera::scene
