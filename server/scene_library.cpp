#include "server/scene_library.h"

#include <algorithm>
#include <cctype>
#include <utility>

#include "scene/gltf.h"
#include "scene/procedural.h"

namespace tessera::server {
namespace {

namespace fs = std::filesystem;

Status check_name(const std::string& name) {
  const auto fits = [](unsigned char c) { return std::isalnum(c) || c == '.' || c == '_' || c == '-'; };
  if (!name.empty() && name.size() <= 64 && std::all_of(name.begin(), name.end(), fits))
    return absl::OkStatus();
  return absl::InvalidArgumentError("name: must be 1 to 64 of A-Z a-z 0-9 . _ -");
}

StatusOr<std::shared_ptr<scene::Scene>> import(const std::string& source, scene::ImportNotes& notes) {
  if (scene::is_procedural(source)) return scene::load_scene(source);
  return scene::load_gltf(source, {}, &notes);
}

}  // namespace

SceneLibrary::SceneLibrary(std::shared_ptr<gpu::Device> device, StreamServer& server, fs::path root,
                           uint32_t max_device_mib, shading::GatherPath gather)
    : device_(std::move(device)),
      server_(server),
      root_(std::move(root)),
      max_device_mib_(max_device_mib),
      gather_(gather) {}

SceneLibrary::~SceneLibrary() {
  (void)server_.run_on_device([this] {
    entries_.clear();
    return absl::OkStatus();
  });
}

// Links are followed first, so that none leads out.
StatusOr<std::string> SceneLibrary::inside_root(const std::string& source) const {
  if (scene::is_procedural(source)) return source;
  if (root_.empty())
    return absl::InvalidArgumentError(
        "source: this daemon reads no files on request; start it with --scene-root");
  std::error_code error;
  const fs::path root = fs::canonical(root_, error);
  if (error)
    return absl::InvalidArgumentError(absl::StrCat("--scene-root ", root_.string(), ": ", error.message()));
  const fs::path file = fs::weakly_canonical(root / source, error);
  const fs::path relative = error ? fs::path() : file.lexically_relative(root);
  if (relative.empty() || *relative.begin() == "..")
    return absl::InvalidArgumentError(absl::StrCat("source: ", source, " lies outside --scene-root"));
  return file.string();
}

StatusOr<SceneInfo> SceneLibrary::load(const std::string& name, const std::string& source) {
  TESSERA_ASSIGN_OR_RETURN(const std::string file, inside_root(source));
  return load_trusted(name, file);
}

StatusOr<SceneInfo> SceneLibrary::load_trusted(const std::string& name, const std::string& source) {
  TESSERA_RETURN_IF_ERROR(check_name(name));
  TESSERA_RETURN_IF_ERROR(reserve(name));
  StatusOr<Entry> entry = make(name, source);
  const std::lock_guard lock(mutex_);
  if (!entry.ok()) {
    entries_.erase(name);
    return entry.status();
  }
  return (entries_[name] = *std::move(entry)).info;
}

Status SceneLibrary::reserve(const std::string& name) {
  const std::lock_guard lock(mutex_);
  if (entries_.contains(name))
    return absl::AlreadyExistsError(
        absl::StrCat("there is a scene ", name, "; unload it or choose another name"));
  const auto loading = std::ranges::count_if(entries_, [](const auto& e) { return !e.second.scene; });
  if (static_cast<size_t>(loading) >= kMaxLoading)
    return absl::ResourceExhaustedError(absl::StrCat(loading, " scenes are loading; try again later"));
  entries_.try_emplace(name);
  return absl::OkStatus();
}

double SceneLibrary::room_mib() const {
  const std::lock_guard lock(mutex_);
  double room = max_device_mib_;
  for (const auto& [name, entry] : entries_) room -= entry.info.device_mib;
  return room;
}

// Reading goes on beside the streaming; only the upload holds it up.
StatusOr<SceneLibrary::Entry> SceneLibrary::make(const std::string& name, const std::string& source) {
  scene::ImportNotes notes;
  TESSERA_ASSIGN_OR_RETURN(const std::shared_ptr<scene::Scene> scene, import(source, notes));
  Entry entry{.info = {.name = name,
                       .source = source,
                       .triangles = scene->triangle_count,
                       .materials = static_cast<uint32_t>(scene->materials.size()),
                       .bounds = scene->world_bounds(0),
                       .notes = notes.notes,
                       .plan = make_frame_plan(scene->features)}};
  TESSERA_RETURN_IF_ERROR(server_.run_on_device([&]() -> Status {
    const uint64_t before = device_->memory_in_use();
    TESSERA_ASSIGN_OR_RETURN(entry.scene, SharedScene::create(device_, scene, {}, gather_));
    entry.info.device_mib = static_cast<double>(device_->memory_in_use() - before) / (1 << 20);
    const double room = room_mib();  // others may have come in meanwhile
    if (max_device_mib_ == 0 || entry.info.device_mib <= room) {
      const std::lock_guard lock(mutex_);
      entries_[name].info.device_mib = entry.info.device_mib;
      return absl::OkStatus();
    }
    entry.scene.reset();
    return absl::ResourceExhaustedError(
        absl::StrFormat("scene %s takes %.1f MiB of the device, of which --max-scene-mib %u leaves %.1f; "
                        "unload a scene or raise "
                        "it",
                        name, entry.info.device_mib, max_device_mib_, room));
  }));
  return entry;
}

StatusOr<std::shared_ptr<SharedScene>> SceneLibrary::find(const std::string& name) const {
  const std::lock_guard lock(mutex_);
  const auto found = entries_.find(name);
  if (found == entries_.end() || !found->second.scene)
    return absl::NotFoundError(absl::StrCat("there is no scene ", name, "; load it first"));
  return found->second.scene;
}

Status SceneLibrary::unload(const std::string& name) {
  std::shared_ptr<SharedScene> scene;
  {
    const std::lock_guard lock(mutex_);
    const auto found = entries_.find(name);
    if (found == entries_.end() || !found->second.scene)
      return absl::NotFoundError(absl::StrCat("there is no scene ", name));
    if (found->second.scene.use_count() > 1)
      return absl::FailedPreconditionError(
          absl::StrCat("scene ", name, " is in use; delete its sessions first"));
    scene = std::move(found->second.scene);
    entries_.erase(found);
  }
  return server_.run_on_device([&] {
    scene.reset();
    return absl::OkStatus();
  });
}

std::vector<SceneInfo> SceneLibrary::list() const {
  const std::lock_guard lock(mutex_);
  std::vector<SceneInfo> infos;
  for (const auto& [name, entry] : entries_)
    if (entry.scene) infos.push_back(entry.info);
  return infos;
}

}  // namespace tessera::server
