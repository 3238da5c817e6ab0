#include "scene/gltf/schema.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "scene/gltf/container.h"

namespace tessera::scene {
namespace {

using nlohmann::json;

constexpr double kFloatMax = std::numeric_limits<float>::max();
constexpr double kMaxBytes = 1e15;         // of a size or an offset: exact in double
constexpr uint64_t kMaxElements = 65'536;  // of arrays of materials, textures and other large records

enum class Kind { boolean, integer, number, string, numbers, index, indices, object, objects, index_map };

struct Rule;
using Schema = std::span<const Rule>;

struct Rule {
  std::string_view key;
  Kind kind;
  bool required = false;
  double min = -kFloatMax, max = kFloatMax;        // of a number, an integer, or each element of numbers
  size_t length = 0;                               // of numbers; 0 = any
  std::string_view target = {};                    // the array, at top level, that an index refers to
  const Schema* schema = nullptr;                  // of an object or of each of the objects
  std::span<const std::string_view> allowed = {};  // strings
};

// Factories, so that the tables below read like the specification.
constexpr Rule boolean(std::string_view key) {
  return {key, Kind::boolean};
}
constexpr Rule integer(std::string_view key, double min, double max) {
  return {key, Kind::integer, false, min, max};
}
constexpr Rule number(std::string_view key, double min = -kFloatMax, double max = kFloatMax) {
  return {key, Kind::number, false, min, max};
}
constexpr Rule text(std::string_view key) {
  return {key, Kind::string};
}
constexpr Rule one_of(std::string_view key, std::span<const std::string_view> allowed) {
  return {key, Kind::string, false, 0, 0, 0, {}, nullptr, allowed};
}
constexpr Rule numbers(std::string_view key, size_t length, double min = -kFloatMax, double max = kFloatMax) {
  return {key, Kind::numbers, false, min, max, length};
}
constexpr Rule index(std::string_view key, std::string_view target) {
  return {key, Kind::index, false, 0, 0, 0, target};
}
constexpr Rule indices(std::string_view key, std::string_view target) {
  return {key, Kind::indices, false, 0, 0, 0, target};
}
constexpr Rule index_map(std::string_view key, std::string_view target) {
  return {key, Kind::index_map, false, 0, 0, 0, target};
}
constexpr Rule object(std::string_view key, const Schema& schema) {
  return {key, Kind::object, false, 0, 0, 0, {}, &schema};
}
constexpr Rule objects(std::string_view key, const Schema& schema) {
  return {key, Kind::objects, false, 0, 0, 0, {}, &schema};
}
constexpr Rule required(Rule rule) {
  rule.required = true;
  return rule;
}

constexpr std::string_view kAccessorTypes[] = {"SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"};
constexpr std::string_view kAlphaModes[] = {"OPAQUE", "MASK", "BLEND"};
constexpr std::string_view kInterpolations[] = {"LINEAR", "STEP", "CUBICSPLINE"};
constexpr std::string_view kPaths[] = {"translation", "rotation", "scale", "weights"};
constexpr std::string_view kLightTypes[] = {"directional", "point", "spot"};

constexpr Rule kAssetRules[] = {required(text("version"))};
constexpr Schema kAsset = kAssetRules;
constexpr Rule kBufferRules[] = {text("uri"), required(integer("byteLength", 1, kMaxBytes))};
constexpr Schema kBuffer = kBufferRules;
constexpr Rule kBufferViewRules[] = {
    required(index("buffer", "buffers")), integer("byteOffset", 0, kMaxBytes),
    required(integer("byteLength", 1, kMaxBytes)), integer("byteStride", 4, 252)};
constexpr Schema kBufferView = kBufferViewRules;
constexpr Rule kSparseIndicesRules[] = {required(index("bufferView", "bufferViews")),
                                        integer("byteOffset", 0, std::numeric_limits<int>::max()),
                                        required(integer("componentType", 5121, 5125))};
constexpr Schema kSparseIndices = kSparseIndicesRules;
constexpr Rule kSparseValuesRules[] = {required(index("bufferView", "bufferViews")),
                                       integer("byteOffset", 0, std::numeric_limits<int>::max())};
constexpr Schema kSparseValues = kSparseValuesRules;
constexpr Rule kSparseRules[] = {required(integer("count", 1, std::numeric_limits<int>::max())),
                                 required(object("indices", kSparseIndices)),
                                 required(object("values", kSparseValues))};
constexpr Schema kSparse = kSparseRules;
constexpr Rule kAccessorRules[] = {index("bufferView", "bufferViews"),
                                   integer("byteOffset", 0, kMaxBytes),
                                   required(integer("componentType", 5120, 5126)),
                                   boolean("normalized"),
                                   required(integer("count", 1, kMaxBytes)),
                                   required(one_of("type", kAccessorTypes)),
                                   object("sparse", kSparse)};
constexpr Schema kAccessor = kAccessorRules;
constexpr Rule kPrimitiveRules[] = {required(index_map("attributes", "accessors")),
                                    index("indices", "accessors"), index("material", "materials"),
                                    integer("mode", 0, 6)};
constexpr Schema kPrimitive = kPrimitiveRules;
constexpr Rule kMeshRules[] = {required(objects("primitives", kPrimitive)), text("name")};
constexpr Schema kMesh = kMeshRules;
constexpr Rule kNodeLightRules[] = {required(index("light", "extensions/KHR_lights_punctual/lights"))};
constexpr Schema kNodeLight = kNodeLightRules;
constexpr Rule kNodeExtensionRules[] = {object("KHR_lights_punctual", kNodeLight)};
constexpr Schema kNodeExtensions = kNodeExtensionRules;
constexpr Rule kNodeRules[] = {text("name"),
                               indices("children", "nodes"),
                               index("mesh", "meshes"),
                               numbers("matrix", 16),
                               numbers("translation", 3),
                               numbers("rotation", 4),
                               numbers("scale", 3),
                               object("extensions", kNodeExtensions)};
constexpr Schema kNode = kNodeRules;
constexpr Rule kSceneRules[] = {indices("nodes", "nodes"), text("name")};
constexpr Schema kScene = kSceneRules;
constexpr Rule kTransformRules[] = {numbers("offset", 2), number("rotation"), numbers("scale", 2),
                                    integer("texCoord", 0, 255)};
constexpr Schema kTransform = kTransformRules;
constexpr Rule kTextureInfoExtensionRules[] = {object("KHR_texture_transform", kTransform)};
constexpr Schema kTextureInfoExtensions = kTextureInfoExtensionRules;
constexpr Rule kTextureInfoRules[] = {required(index("index", "textures")), integer("texCoord", 0, 255),
                                      number("scale"), number("strength", 0, 1),
                                      object("extensions", kTextureInfoExtensions)};
constexpr Schema kTextureInfo = kTextureInfoRules;
constexpr Rule kPbrRules[] = {numbers("baseColorFactor", 4, 0, kFloatMax),
                              object("baseColorTexture", kTextureInfo), number("metallicFactor", 0, 1),
                              number("roughnessFactor", 0, 1),
                              object("metallicRoughnessTexture", kTextureInfo)};
constexpr Schema kPbr = kPbrRules;
constexpr Rule kStrengthRules[] = {number("emissiveStrength", 0)};
constexpr Schema kStrength = kStrengthRules;
constexpr Schema kUnlit = {};
constexpr Rule kMaterialExtensionRules[] = {object("KHR_materials_emissive_strength", kStrength),
                                            object("KHR_materials_unlit", kUnlit)};
constexpr Schema kMaterialExtensions = kMaterialExtensionRules;
constexpr Rule kMaterialRules[] = {text("name"),
                                   object("pbrMetallicRoughness", kPbr),
                                   object("normalTexture", kTextureInfo),
                                   object("occlusionTexture", kTextureInfo),
                                   object("emissiveTexture", kTextureInfo),
                                   numbers("emissiveFactor", 3, 0, kFloatMax),
                                   one_of("alphaMode", kAlphaModes),
                                   number("alphaCutoff", 0),
                                   boolean("doubleSided"),
                                   object("extensions", kMaterialExtensions)};
constexpr Schema kMaterial = kMaterialRules;
constexpr Rule kImageRules[] = {text("name"), text("uri"), text("mimeType"),
                                index("bufferView", "bufferViews")};
constexpr Schema kImage = kImageRules;
constexpr Rule kTextureRules[] = {text("name"), index("sampler", "samplers"), index("source", "images")};
constexpr Schema kTexture = kTextureRules;
constexpr Rule kSamplerRules[] = {integer("magFilter", 9728, 9729), integer("minFilter", 9728, 9987),
                                  integer("wrapS", 10497, 33648), integer("wrapT", 10497, 33648)};
constexpr Schema kSampler = kSamplerRules;
constexpr Rule kTargetRules[] = {index("node", "nodes"), required(one_of("path", kPaths))};
constexpr Schema kTarget = kTargetRules;
constexpr Rule kChannelRules[] = {required(integer("sampler", 0, std::numeric_limits<int>::max())),
                                  required(object("target", kTarget))};
constexpr Schema kChannel = kChannelRules;
constexpr Rule kAnimationSamplerRules[] = {required(index("input", "accessors")),
                                           required(index("output", "accessors")),
                                           one_of("interpolation", kInterpolations)};
constexpr Schema kAnimationSampler = kAnimationSamplerRules;
constexpr Rule kAnimationRules[] = {required(objects("channels", kChannel)),
                                    required(objects("samplers", kAnimationSampler)), text("name")};
constexpr Schema kAnimation = kAnimationRules;
constexpr double kHalfPi = 1.5707963267948966;
constexpr Rule kSpotRules[] = {number("innerConeAngle", 0, kHalfPi),
                               number("outerConeAngle", 0, kHalfPi + 1e-6)};
constexpr Schema kSpot = kSpotRules;
constexpr Rule kLightRules[] = {required(one_of("type", kLightTypes)),
                                numbers("color", 3, 0, kFloatMax),
                                number("intensity", 0),
                                number("range", 0),
                                object("spot", kSpot),
                                text("name")};
constexpr Schema kLight = kLightRules;
constexpr Rule kLightsRules[] = {required(objects("lights", kLight))};
constexpr Schema kLights = kLightsRules;
constexpr Rule kRootExtensionRules[] = {object("KHR_lights_punctual", kLights)};
constexpr Schema kRootExtensions = kRootExtensionRules;
constexpr Rule kRootRules[] = {required(object("asset", kAsset)),
                               objects("buffers", kBuffer),
                               objects("bufferViews", kBufferView),
                               objects("accessors", kAccessor),
                               objects("meshes", kMesh),
                               objects("nodes", kNode),
                               objects("scenes", kScene),
                               objects("materials", kMaterial),
                               objects("images", kImage),
                               objects("textures", kTexture),
                               objects("samplers", kSampler),
                               objects("animations", kAnimation),
                               index("scene", "scenes"),
                               object("extensions", kRootExtensions)};
constexpr Schema kRoot = kRootRules;

constexpr std::string_view kKnownExtensions[] = {"KHR_lights_punctual", "KHR_materials_emissive_strength",
                                                 "KHR_materials_unlit", "KHR_mesh_quantization",
                                                 "KHR_texture_transform"};

// A place in the document; turned into text only for an error.
struct Place {
  const Place* parent = nullptr;
  std::string_view key;
  size_t index = 0;
  std::string text() const {
    if (!parent) return "";
    return absl::StrCat(parent->text(), "/", key.empty() ? absl::StrCat(index) : std::string(key));
  }
};

class Checker {
 public:
  Checker(const json& root, const std::string& file, const ImportLimits& limits)
      : root_(root), file_(file), limits_(limits) {}

  Status check_root() {
    const Place place;
    if (!root_.is_object()) return import_error(file_, "", "the document is not a JSON object");
    TESSERA_RETURN_IF_ERROR(check_lengths());
    return check_object(root_, kRoot, place);
  }

 private:
  Status error(const Place& place, const std::string& what) const {
    return import_error(file_, place.text(), what);
  }

  // Before anything is allocated per element.
  Status check_lengths() const {
    for (const auto& [key, value] : root_.items()) {
      const bool small_records =
          key == "nodes" || key == "meshes" || key == "accessors" || key == "bufferViews";
      const uint64_t limit =
          small_records ? limits_.max_nodes : std::min<uint64_t>(limits_.max_nodes, kMaxElements);
      if (value.is_array() && value.size() > limit) {
        return import_error(file_, "/" + key,
                            absl::StrFormat("%d elements; the limit is %d", value.size(), limit));
      }
    }
    return absl::OkStatus();
  }

  Status check_object(const json& value, const Schema& schema, const Place& place) const {
    if (!value.is_object()) return error(place, "must be an object");
    for (const Rule& rule : schema) {
      const auto found = value.find(rule.key);
      const Place field{&place, rule.key};
      if (found != value.end()) {
        TESSERA_RETURN_IF_ERROR(check_value(*found, rule, field));
      } else if (rule.required) {
        return error(field, "is missing");
      }
    }
    return absl::OkStatus();
  }

  Status check_value(const json& value, const Rule& rule, const Place& place) const {
    switch (rule.kind) {
      case Kind::boolean:
        return value.is_boolean() ? absl::OkStatus() : error(place, "must be true or false");
      case Kind::string:
        return check_string(value, rule, place);
      case Kind::integer:
        if (!value.is_number_integer()) return error(place, "must be an integer");
        return check_number(value, rule, place);
      case Kind::number:
        return check_number(value, rule, place);
      case Kind::index:
        return check_index(value, rule, place);
      case Kind::object:
        return check_object(value, *rule.schema, place);
      case Kind::index_map:
        return check_map(value, rule, place);
      case Kind::numbers:
      case Kind::indices:
      case Kind::objects:
        return check_array(value, rule, place);
    }
    return absl::OkStatus();
  }

  Status check_string(const json& value, const Rule& rule, const Place& place) const {
    if (!value.is_string()) return error(place, "must be a string");
    const auto& text = value.get_ref<const std::string&>();
    if (rule.allowed.empty() || std::ranges::find(rule.allowed, text) != rule.allowed.end())
      return absl::OkStatus();
    std::string options;
    for (const std::string_view option : rule.allowed)
      options += (options.empty() ? "" : ", ") + std::string(option);
    return error(place, absl::StrCat("\"", text.substr(0, 40), "\" is not one of ", options));
  }

  Status check_number(const json& value, const Rule& rule, const Place& place) const {
    if (!value.is_number()) return error(place, "must be a number");
    const double x = value.get<double>();
    if (x >= rule.min && x <= rule.max) return absl::OkStatus();
    return error(place, absl::StrFormat("%g is outside %g to %g", x, rule.min, rule.max));
  }

  Status check_index(const json& value, const Rule& rule, const Place& place) const {
    if (!value.is_number_unsigned()) return error(place, "must be a non-negative integer");
    const size_t count = target_size(rule.target);
    const uint64_t index = value.get<uint64_t>();
    if (index < count) return absl::OkStatus();
    return error(place, absl::StrFormat("%d does not exist: /%s has %d elements", index,
                                        std::string(rule.target), count));
  }

  Status check_map(const json& value, const Rule& rule, const Place& place) const {
    if (!value.is_object()) return error(place, "must be an object");
    for (const auto& [key, element] : value.items()) {
      TESSERA_RETURN_IF_ERROR(check_index(element, rule, Place{&place, key}));
    }
    return absl::OkStatus();
  }

  Status check_array(const json& value, const Rule& rule, const Place& place) const {
    if (!value.is_array()) return error(place, "must be an array");
    if (rule.length != 0 && value.size() != rule.length) {
      return error(place, absl::StrFormat("%d elements, expected %d", value.size(), rule.length));
    }
    for (size_t i = 0; i < value.size(); ++i) {
      const Place element{&place, "", i};
      TESSERA_RETURN_IF_ERROR(rule.kind == Kind::numbers   ? check_number(value[i], rule, element)
                              : rule.kind == Kind::indices ? check_index(value[i], rule, element)
                                                           : check_object(value[i], *rule.schema, element));
    }
    return absl::OkStatus();
  }

  size_t target_size(std::string_view target) const {
    const json* at = &root_;
    while (!target.empty()) {
      const size_t slash = std::min(target.find('/'), target.size());
      const auto found = at->is_object() ? at->find(target.substr(0, slash)) : at->end();
      if (!at->is_object() || found == at->end()) return 0;
      at = &*found;
      target.remove_prefix(std::min(slash + 1, target.size()));
    }
    return at->is_array() ? at->size() : 0;
  }

  const json& root_;
  const std::string& file_;
  const ImportLimits& limits_;
};

// Depth is bounded by check_json_shape().
void strip_extras(json& value) {
  if (value.is_object()) {
    value.erase("extras");
    if (const auto extensions = value.find("extensions");
        extensions != value.end() && extensions->is_object()) {
      for (auto it = extensions->begin(); it != extensions->end();) {
        it = is_known_extension(it.key()) ? std::next(it) : extensions->erase(it);
      }
    }
  }
  if (value.is_structured()) {
    for (json& child : value) strip_extras(child);
  }
}

bool erase(json& object, const char* key) {
  return object.is_object() && object.erase(key) > 0;
}

// Channels without a target node are legal and mean nothing without extensions.
void strip_aimless_channels(json& document) {
  if (!document.contains("animations")) return;
  for (json& animation : document["animations"]) {
    json kept = json::array();
    for (json& channel : animation["channels"]) {
      if (channel["target"].contains("node")) kept.push_back(std::move(channel));
    }
    animation["channels"] = std::move(kept);
  }
}

}  // namespace

bool is_known_extension(std::string_view name) {
  return std::ranges::find(kKnownExtensions, name) != std::end(kKnownExtensions);
}

Status check_schema(const json& document, const std::string& file, const ImportLimits& limits) {
  return Checker(document, file, limits).check_root();
}

void strip_unused(json& document, std::vector<std::string>& notes) {
  strip_extras(document);
  strip_aimless_channels(document);
  erase(document, "cameras");
  if (erase(document, "skins")) notes.push_back("skins are ignored: skinned meshes stand in their bind pose");
  bool morphs = false;
  if (document.contains("meshes")) {
    for (json& mesh : document["meshes"]) {
      erase(mesh, "weights");
      for (json& primitive : mesh["primitives"]) morphs |= erase(primitive, "targets");
    }
  }
  if (morphs) notes.push_back("morph targets are ignored");
}

}  // namespace tessera::scene
