#include "scene/gltf/document.h"

#include <absl/strings/escaping.h>
#include <absl/strings/match.h>
#include <absl/strings/numbers.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>

#include "scene/gltf/accessor.h"
#include "scene/gltf/container.h"
#include "scene/gltf/schema.h"

namespace tessera::scene {
namespace {

using nlohmann::json;

uint64_t get_uint(const json& object, const char* key) {
  const auto found = object.find(key);
  return found == object.end() ? 0 : found->get<uint64_t>();
}

const json& get_array(const json& object, const char* key) {
  static const json kEmpty = json::array();
  const auto found = object.find(key);
  return found == object.end() ? kEmpty : *found;
}

StatusOr<json> parse_json(std::string_view text, const std::string& file) {
  TESSERA_RETURN_IF_ERROR(check_json_shape(text, file));
  try {
    return json::parse(text);
  } catch (const json::exception& e) {
    return import_error(file, "", absl::StrCat("not valid JSON: ", e.what()));
  }
}

// A missing required extension makes the file undisplayable; a missing optional one only changes its look.
Status check_extensions(const json& document, const std::string& file, std::vector<std::string>& notes) {
  for (const char* key : {"extensionsUsed", "extensionsRequired"}) {
    const json& names = get_array(document, key);
    if (!names.is_array()) return import_error(file, absl::StrCat("/", key), "must be an array");
    for (size_t i = 0; i < names.size(); ++i) {
      const std::string path = absl::StrCat("/", key, "/", i);
      if (!names[i].is_string()) return import_error(file, path, "must be a string");
      const auto& name = names[i].get_ref<const std::string&>();
      if (is_known_extension(name)) continue;
      if (key == std::string_view("extensionsRequired")) {
        return absl::UnimplementedError(
            absl::StrCat(file, ": ", path, ": the file needs ", name, ", which is not supported"));
      }
      notes.push_back(absl::StrCat("extension ", name, " is ignored"));
    }
  }
  return absl::OkStatus();
}

std::string percent_decoded(const std::string& uri) {
  std::string decoded;
  for (size_t i = 0; i < uri.size(); ++i) {
    uint32_t code;
    if (uri[i] == '%' && i + 2 < uri.size() && absl::SimpleHexAtoi(uri.substr(i + 1, 2), &code)) {
      decoded.push_back(static_cast<char>(code));
      i += 2;
    } else {
      decoded.push_back(uri[i]);
    }
  }
  return decoded;
}

bool is_inside(const std::filesystem::path& file, const std::filesystem::path& directory) {
  std::error_code failed;
  const auto inner = std::filesystem::weakly_canonical(file, failed);
  if (failed) return false;
  const auto outer = std::filesystem::weakly_canonical(directory, failed);
  if (failed) return false;
  return std::mismatch(outer.begin(), outer.end(), inner.begin(), inner.end()).first == outer.end();
}

}  // namespace

Status Document::error(const std::string& path, const std::string& what) const {
  return import_error(name_, path, what);
}

Status Document::over_limit(const std::string& path, const std::string& what) const {
  return absl::ResourceExhaustedError(import_error(name_, path, what).message());
}

StatusOr<std::unique_ptr<Document>> Document::open(std::span<const std::byte> bytes, const std::string& name,
                                                   const std::filesystem::path& base_dir,
                                                   const ImportLimits& limits, ImportNotes& notes) {
  if (bytes.size() > limits.max_file_bytes) {
    return absl::ResourceExhaustedError(
        absl::StrFormat("%s: %d bytes; the limit is %d", name, bytes.size(), limits.max_file_bytes));
  }
  std::unique_ptr<Document> document(new Document(name, base_dir, limits));
  TESSERA_RETURN_IF_ERROR(document->load(bytes, notes));
  return document;
}

Status Document::load(std::span<const std::byte> bytes, ImportNotes& notes) {
  TESSERA_ASSIGN_OR_RETURN(const Container container, open_container(bytes, name_));
  TESSERA_ASSIGN_OR_RETURN(json document, parse_json(container.json, name_));
  TESSERA_RETURN_IF_ERROR(check_schema(document, name_, limits_));
  TESSERA_RETURN_IF_ERROR(check_extensions(document, name_, notes.notes));
  if (!absl::StartsWith(document["asset"]["version"].get_ref<const std::string&>(), "2.")) {
    return error("/asset/version", "only glTF 2.x can be read");
  }
  TESSERA_RETURN_IF_ERROR(load_buffers(document, container.bin));
  TESSERA_RETURN_IF_ERROR(check_views(document));
  TESSERA_RETURN_IF_ERROR(load_images(document));
  strip_unused(document, notes.notes);
  // tinygltf would read files and decode images unchecked: that is done here instead.
  document.erase("buffers");
  document.erase("images");
  TESSERA_RETURN_IF_ERROR(parse_model(document.dump()));
  return check_accessors(*this);
}

Status Document::load_buffers(const json& document, std::span<const uint8_t> bin) {
  const json& buffers = get_array(document, "buffers");
  uint64_t total = 0;
  owned_.reserve(buffers.size());
  for (size_t i = 0; i < buffers.size(); ++i) {
    const std::string path = absl::StrCat("/buffers/", i);
    const uint64_t length = buffers[i]["byteLength"].get<uint64_t>();
    std::span<const uint8_t> data = bin;
    if (const auto uri = buffers[i].find("uri"); uri != buffers[i].end()) {
      TESSERA_ASSIGN_OR_RETURN(std::vector<uint8_t> read, read_uri(uri->get<std::string>(), path + "/uri"));
      total += read.size();
      if (total > limits_.max_file_bytes)
        return over_limit(path, "the buffers exceed the limit on file size");
      data = owned_.emplace_back(std::move(read));
    } else if (i != 0) {
      return error(path + "/uri", "is missing (only buffer 0 may be the GLB's binary chunk)");
    }
    if (length > data.size()) {
      return error(path + "/byteLength",
                   absl::StrFormat("%d bytes, but the buffer has %d", length, data.size()));
    }
    buffers_.push_back(data.first(length));
  }
  return absl::OkStatus();
}

Status Document::check_views(const json& document) const {
  const json& views = get_array(document, "bufferViews");
  for (size_t i = 0; i < views.size(); ++i) {
    const std::span<const uint8_t> buffer = buffers_[get_uint(views[i], "buffer")];
    const uint64_t end = get_uint(views[i], "byteOffset") + get_uint(views[i], "byteLength");
    if (end > buffer.size()) {
      return error(absl::StrFormat("/bufferViews/%d/byteLength", i),
                   absl::StrFormat("the view ends at byte %d of a buffer of %d bytes", end, buffer.size()));
    }
    if (get_uint(views[i], "byteStride") % 4 != 0) {
      return error(absl::StrFormat("/bufferViews/%d/byteStride", i), "must be a multiple of 4");
    }
  }
  return absl::OkStatus();
}

Status Document::load_images(const json& document) {
  const json& images = get_array(document, "images");
  for (size_t i = 0; i < images.size(); ++i) {
    const bool has_uri = images[i].contains("uri"), has_view = images[i].contains("bufferView");
    if (has_uri == has_view) return error(absl::StrCat("/images/", i), "needs either uri or bufferView");
    images_.push_back({has_uri ? images[i]["uri"].get<std::string>() : "",
                       has_view ? images[i]["bufferView"].get<int>() : -1});
  }
  return absl::OkStatus();
}

Status Document::parse_model(const std::string& text) {
  try {
    std::string problem, warning;
    if (tinygltf::TinyGLTF().LoadASCIIFromString(&model_, &problem, &warning, text.data(),
                                                 static_cast<unsigned int>(text.size()), "")) {
      return absl::OkStatus();
    }
    return error("", std::string(absl::StripAsciiWhitespace(problem)));
  } catch (const std::exception& e) {
    return error("", absl::StrCat("the glTF parser gave up: ", e.what()));
  }
}

std::span<const uint8_t> Document::view(int buffer_view) const {
  const tinygltf::BufferView& view = model_.bufferViews[static_cast<size_t>(buffer_view)];
  return buffers_[static_cast<size_t>(view.buffer)].subspan(view.byteOffset, view.byteLength);
}

StatusOr<std::vector<uint8_t>> Document::image_file(int image) const {
  const ImageSource& source = images_[static_cast<size_t>(image)];
  if (source.buffer_view < 0) return read_uri(source.uri, absl::StrFormat("/images/%d/uri", image));
  const std::span<const uint8_t> bytes = view(source.buffer_view);
  return std::vector<uint8_t>(bytes.begin(), bytes.end());
}

StatusOr<std::vector<uint8_t>> Document::read_uri(const std::string& uri, const std::string& path) const {
  if (absl::StartsWith(uri, "data:")) {
    const size_t comma = uri.find(',');
    std::string decoded;
    if (comma == std::string::npos || !absl::EndsWith(uri.substr(0, comma), ";base64") ||
        !absl::Base64Unescape(uri.substr(comma + 1), &decoded)) {
      return error(path, "the data URI is not valid base64");
    }
    return std::vector<uint8_t>(decoded.begin(), decoded.end());
  }
  const std::filesystem::path relative = percent_decoded(uri);
  const std::string shown = uri.substr(0, 80);
  if (base_dir_.empty())
    return error(path, absl::StrCat("\"", shown, "\": external files are not allowed here"));
  const std::filesystem::path file = base_dir_ / relative;
  if (uri.empty() || relative.is_absolute() || absl::StrContains(uri, "://") || !is_inside(file, base_dir_)) {
    return error(path, absl::StrCat("\"", shown, "\" is not a file beside or below the glTF file"));
  }
  std::error_code failed;
  const uint64_t size =
      std::filesystem::is_regular_file(file, failed) ? std::filesystem::file_size(file, failed) : 0;
  std::ifstream in(file, std::ios::binary);
  if (failed || size == 0 || !in) return error(path, absl::StrCat("cannot read \"", shown, "\""));
  if (size > limits_.max_file_bytes)
    return over_limit(path, absl::StrFormat("%d bytes; the limit is %d", size, limits_.max_file_bytes));
  std::vector<uint8_t> bytes(size);
  if (!in.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(size))) {
    return error(path, absl::StrCat("cannot read \"", shown, "\""));
  }
  return bytes;
}

}  // namespace tessera::scene
