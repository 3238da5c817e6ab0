#include <cmath>
#include <map>
#include <tuple>

#include "scene/gltf/images.h"
#include "scene/gltf/import.h"

namespace tessera::scene {
namespace {

WrapMode wrap_mode(int gltf) {
  return gltf == TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE     ? WrapMode::clamp_to_edge
         : gltf == TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT ? WrapMode::mirrored_repeat
                                                         : WrapMode::repeat;
}

float get_number(const tinygltf::Value& object, const char* key, float otherwise) {
  return object.Has(key) ? static_cast<float>(object.Get(key).GetNumberAsDouble()) : otherwise;
}

vec2 get_pair(const tinygltf::Value& object, const char* key, vec2 otherwise) {
  if (!object.Has(key)) return otherwise;
  const tinygltf::Value& pair = object.Get(key);
  return vec2(pair.Get(0).GetNumberAsDouble(), pair.Get(1).GetNumberAsDouble());
}

// KHR_texture_transform: translation * rotation * scale.
std::array<vec2, 3> transform_of(const tinygltf::Value& extension) {
  const vec2 scale = get_pair(extension, "scale", vec2(1)), offset = get_pair(extension, "offset", vec2(0));
  const float angle = get_number(extension, "rotation", 0), c = std::cos(angle), s = std::sin(angle);
  return {vec2(c, -s) * scale.x, vec2(s, c) * scale.y, offset};
}

// One entry of Scene::textures: the same image is two textures if its use or its sampler differs.
struct TextureKey {
  int image;
  bool srgb, nearest;
  WrapMode wrap_u, wrap_v;
  auto operator<=>(const TextureKey&) const = default;
};

class MaterialImporter {
 public:
  MaterialImporter(const Document& document, Scene& scene, ImportNotes& notes)
      : document_(document), scene_(scene), notes_(notes) {}

  Status run() {
    const auto& materials = document_.model().materials;
    for (size_t i = 0; i < materials.size(); ++i) {
      scene_.materials.push_back(read_material(materials[i], absl::StrCat("/materials/", i)));
    }
    Material plain;
    plain.name = "default";
    scene_.materials.push_back(plain);
    return load_textures();
  }

 private:
  Material read_material(const tinygltf::Material& source, const std::string& path) {
    const tinygltf::PbrMetallicRoughness& pbr = source.pbrMetallicRoughness;
    Material m;
    m.name = source.name;
    for (int c = 0; c < 4; ++c)
      m.base_color[c] = static_cast<float>(pbr.baseColorFactor[static_cast<size_t>(c)]);
    m.metallic = static_cast<float>(pbr.metallicFactor);
    m.roughness = static_cast<float>(pbr.roughnessFactor);
    m.normal_scale = static_cast<float>(source.normalTexture.scale);
    m.occlusion_strength = static_cast<float>(source.occlusionTexture.strength);
    m.emissive = emissive_of(source);
    m.alpha_cutoff = static_cast<float>(source.alphaCutoff);
    m.alpha_mode = source.alphaMode == "MASK"    ? AlphaMode::mask
                   : source.alphaMode == "BLEND" ? AlphaMode::blend
                                                 : AlphaMode::opaque;
    if (m.alpha_mode == AlphaMode::blend) {
      notes_.notes.push_back(absl::StrFormat("%s (%s): alphaMode BLEND is drawn opaque", path, m.name));
    }
    m.double_sided = source.doubleSided;
    m.unlit = source.extensions.contains("KHR_materials_unlit");
    m.base_color_texture =
        read_texture(pbr.baseColorTexture, true, path + "/pbrMetallicRoughness/baseColorTexture");
    m.metallic_roughness_texture = read_texture(pbr.metallicRoughnessTexture, false,
                                                path + "/pbrMetallicRoughness/metallicRoughnessTexture");
    m.normal_texture = read_texture(source.normalTexture, false, path + "/normalTexture");
    m.emissive_texture = read_texture(source.emissiveTexture, true, path + "/emissiveTexture");
    m.occlusion_texture = read_texture(source.occlusionTexture, false, path + "/occlusionTexture");
    return m;
  }

  static vec3 emissive_of(const tinygltf::Material& source) {
    vec3 emissive(0);
    for (size_t c = 0; c < source.emissiveFactor.size(); ++c)
      emissive[static_cast<int>(c)] = static_cast<float>(source.emissiveFactor[c]);
    const auto strength = source.extensions.find("KHR_materials_emissive_strength");
    if (strength == source.extensions.end()) return emissive;
    return glm::min(emissive * get_number(strength->second, "emissiveStrength", 1),
                    vec3(std::numeric_limits<float>::max()));
  }

  template <typename TextureInfo>
  TextureRef read_texture(const TextureInfo& info, bool srgb, const std::string& path) {
    TextureRef ref;
    if (info.index < 0) return ref;
    const tinygltf::Texture& texture = document_.model().textures[static_cast<size_t>(info.index)];
    auto texcoord = static_cast<uint32_t>(info.texCoord);
    const auto transform = info.extensions.find("KHR_texture_transform");
    if (transform != info.extensions.end()) {
      ref.uv_from_texcoord = transform_of(transform->second);
      if (transform->second.Has("texCoord"))
        texcoord = static_cast<uint32_t>(transform->second.Get("texCoord").GetNumberAsInt());
    }
    if (texture.source < 0 || texcoord > 1) {
      notes_.notes.push_back(path + (texcoord > 1
                                         ? ": is ignored: only texture coordinates 0 and 1 are supported"
                                         : ": is ignored: the texture has no image that is supported"));
      return {};
    }
    ref.texcoord = texcoord;
    ref.texture = find_texture(texture, srgb);
    return ref;
  }

  uint32_t find_texture(const tinygltf::Texture& texture, bool srgb) {
    tinygltf::Sampler sampler;
    if (texture.sampler >= 0) sampler = document_.model().samplers[static_cast<size_t>(texture.sampler)];
    const TextureKey key{texture.source, srgb, sampler.magFilter == TINYGLTF_TEXTURE_FILTER_NEAREST,
                         wrap_mode(sampler.wrapS), wrap_mode(sampler.wrapT)};
    const auto [found, is_new] = textures_.try_emplace(key, static_cast<uint32_t>(scene_.textures.size()));
    if (is_new) {
      scene_.textures.push_back({texture.name, 0, 0, {}, key.srgb, key.wrap_u, key.wrap_v, key.nearest});
    }
    return found->second;
  }

  Status load_textures() {
    std::map<int, std::vector<uint32_t>> uses;  // textures by image
    for (const auto& [key, texture] : textures_) uses[key.image].push_back(texture);
    std::vector<int> images;
    uint64_t bytes = 0;
    for (const auto& [image, users] : uses) {
      TESSERA_ASSIGN_OR_RETURN(const ImageSize size, read_image_size(document_, image));
      bytes += size.rgba_bytes() * users.size();
      if (bytes > document_.limits().max_texture_bytes) {
        return document_.over_limit(absl::StrCat("/images/", image),
                                    absl::StrFormat("the decoded textures exceed the limit of %d bytes",
                                                    document_.limits().max_texture_bytes));
      }
      for (const uint32_t user : users) {
        scene_.textures[user].width = size.width;
        scene_.textures[user].height = size.height;
      }
      images.push_back(image);
    }
    TESSERA_ASSIGN_OR_RETURN(auto pixels, decode_images(document_, images));
    for (size_t i = 0; i < images.size(); ++i) {
      const std::vector<uint32_t>& users = uses[images[i]];
      for (size_t u = 1; u < users.size(); ++u) scene_.textures[users[u]].rgba = pixels[i];
      Texture& first = scene_.textures[users[0]];
      first.rgba = std::move(pixels[i]);
      if (first.rgba.size() != size_t{4} * first.width * first.height) {
        return document_.error(absl::StrCat("/images/", images[i]),
                               "the decoded size is not that of the header");
      }
    }
    return absl::OkStatus();
  }

  const Document& document_;
  Scene& scene_;
  ImportNotes& notes_;
  std::map<TextureKey, uint32_t> textures_;
};

}  // namespace

Status import_materials(const Document& document, Scene& scene, ImportNotes& notes) {
  return MaterialImporter(document, scene, notes).run();
}

}  // namespace tessera::scene
