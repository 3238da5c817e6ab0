#include <fstream>

#include "scene/gltf/import.h"

namespace tessera::scene {
namespace {

StatusOr<std::vector<std::byte>> read_file(const std::filesystem::path& file, uint64_t max_bytes) {
  std::error_code failed;
  const bool is_file = std::filesystem::is_regular_file(file, failed);
  const uint64_t size = is_file ? std::filesystem::file_size(file, failed) : 0;
  std::ifstream in(file, std::ios::binary);
  if (!is_file || failed || !in)
    return absl::NotFoundError(absl::StrCat(file.string(), ": cannot open the file"));
  if (size > max_bytes) {
    return absl::ResourceExhaustedError(
        absl::StrFormat("%s: %d bytes; the limit is %d", file.string(), size, max_bytes));
  }
  std::vector<std::byte> bytes(size);
  if (!in.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(size))) {
    return absl::UnavailableError(absl::StrCat(file.string(), ": cannot read the file"));
  }
  return bytes;
}

StatusOr<std::shared_ptr<Scene>> import(std::span<const std::byte> bytes, const std::string& name,
                                        const std::filesystem::path& base_dir, const ImportOptions& options,
                                        ImportNotes& notes) {
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<Document> document,
                           Document::open(bytes, name, base_dir, options.limits, notes));
  auto scene = std::make_shared<Scene>();
  scene->name = std::filesystem::path(name).stem().string();
  TESSERA_ASSIGN_OR_RETURN(const std::vector<uint32_t> node_of, import_nodes(*document, *scene));
  TESSERA_RETURN_IF_ERROR(import_animations(*document, node_of, *scene));
  import_lights(*document, node_of, *scene);
  TESSERA_RETURN_IF_ERROR(import_materials(*document, *scene, notes));
  TESSERA_RETURN_IF_ERROR(import_meshes(*document, node_of, options, *scene, notes));
  if (scene->instances.empty()) return document->error("", "the scene holds no triangles");
  scene->index_instances();
  return scene;
}

}  // namespace

StatusOr<std::shared_ptr<Scene>> load_gltf(const std::filesystem::path& file, const ImportOptions& options,
                                           ImportNotes* notes) {
  TESSERA_ASSIGN_OR_RETURN(const std::vector<std::byte> bytes,
                           read_file(file, options.limits.max_file_bytes));
  const std::filesystem::path directory = file.has_parent_path() ? file.parent_path() : ".";
  return load_gltf(bytes, file.filename().string(), directory, options, notes);
}

StatusOr<std::shared_ptr<Scene>> load_gltf(std::span<const std::byte> bytes, const std::string& name,
                                           const std::filesystem::path& base_dir,
                                           const ImportOptions& options, ImportNotes* notes) {
  ImportNotes unread;
  try {
    return import(bytes, name, base_dir, options, notes ? *notes : unread);
  } catch (const std::bad_alloc&) {
    return absl::ResourceExhaustedError(absl::StrCat(name, ": out of memory during import"));
  } catch (const std::exception& e) {
    return absl::InternalError(absl::StrCat(name, ": import failed: ", e.what()));
  }
}

}  // namespace tessera::scene
