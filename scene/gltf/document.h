// A glTF file, parsed and checked, with the bytes it refers to. The wall to tinygltf: its exceptions end
// here.
#pragma once

#include <tiny_gltf.h>

#include <memory>
#include <nlohmann/json_fwd.hpp>

#include "base/status.h"
#include "scene/gltf.h"

namespace tessera::scene {

class Document {
 public:
  // `bytes` must outlive the document.
  static StatusOr<std::unique_ptr<Document>> open(std::span<const std::byte> bytes, const std::string& name,
                                                  const std::filesystem::path& base_dir,
                                                  const ImportLimits& limits, ImportNotes& notes);

  // Types, ranges and indices are checked (schema.h), buffer views lie inside their buffers, and accessors
  // (accessor.h) inside their views. Buffers and images are not in it: see below.
  const tinygltf::Model& model() const { return model_; }
  const std::string& name() const { return name_; }
  // Bytes of a buffer view.
  std::span<const uint8_t> view(int buffer_view) const;
  // Encoded bytes of an image, read when asked for.
  StatusOr<std::vector<uint8_t>> image_file(int image) const;
  size_t image_count() const { return images_.size(); }

  Status error(const std::string& path, const std::string& what) const;
  // As error(), when a limit of ImportLimits or of memory is exceeded.
  Status over_limit(const std::string& path, const std::string& what) const;
  const ImportLimits& limits() const { return limits_; }

 private:
  struct ImageSource {
    std::string uri;
    int buffer_view = -1;
  };
  Document(std::string name, std::filesystem::path base_dir, const ImportLimits& limits)
      : name_(std::move(name)), base_dir_(std::move(base_dir)), limits_(limits) {}
  Status load(std::span<const std::byte> bytes, ImportNotes& notes);
  Status load_buffers(const nlohmann::json& json, std::span<const uint8_t> bin);
  Status check_views(const nlohmann::json& json) const;
  Status load_images(const nlohmann::json& json);
  Status parse_model(const std::string& text);
  StatusOr<std::vector<uint8_t>> read_uri(const std::string& uri, const std::string& path) const;

  std::string name_;
  std::filesystem::path base_dir_;
  ImportLimits limits_;
  tinygltf::Model model_;
  std::vector<std::span<const uint8_t>> buffers_;
  std::vector<std::vector<uint8_t>> owned_;  // buffers that did not come with the file
  std::vector<ImageSource> images_;
};

}  // namespace tessera::scene
