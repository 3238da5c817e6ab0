// The scenes that a daemon holds, by name. Each is on the device once, however many sessions stream it.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "server/frame_plan.h"
#include "server/shared_scene.h"
#include "server/stream_server.h"

namespace tessera::server {

struct SceneInfo {
  std::string name, source;
  uint64_t triangles = 0;  // instanced
  uint32_t materials = 0;
  Aabb bounds;            // at the animation's start
  double device_mib = 0;  // what loading it added
  std::vector<std::string> notes;
  FramePlan plan;
};

// Thread-safe. `server` runs all that touches the device; both outlive the library.
class SceneLibrary {
 public:
  // `root`: files that load() may read lie below it; empty: only procedural scenes.
  // `max_device_mib`: of all scenes together; 0: no limit.
  SceneLibrary(std::shared_ptr<gpu::Device> device, StreamServer& server, std::filesystem::path root,
               uint32_t max_device_mib, shading::GatherPath gather = shading::GatherPath::automatic);
  ~SceneLibrary();

  // InvalidArgument: a name that is not 1..64 of [A-Za-z0-9._-], or a source outside the root. AlreadyExists.
  // ResourceExhausted: max_device_mib, or kMaxLoading. Else what the import says.
  StatusOr<SceneInfo> load(const std::string& name, const std::string& source);
  // The operator's own: any file.
  StatusOr<SceneInfo> load_trusted(const std::string& name, const std::string& source);
  // NotFound.
  StatusOr<std::shared_ptr<SharedScene>> find(const std::string& name) const;
  // NotFound; FailedPrecondition: sessions use it.
  Status unload(const std::string& name);
  std::vector<SceneInfo> list() const;
  static constexpr size_t kMaxLoading = 4;  // at a time: each takes memory while it is read

 private:
  struct Entry {
    SceneInfo info;
    std::shared_ptr<SharedScene> scene;  // empty while it loads
  };
  StatusOr<std::string> inside_root(const std::string& source) const;
  Status reserve(const std::string& name);
  StatusOr<Entry> make(const std::string& name, const std::string& source);
  double room_mib() const;

  const std::shared_ptr<gpu::Device> device_;
  StreamServer& server_;
  const std::filesystem::path root_;
  const uint32_t max_device_mib_;
  const shading::GatherPath gather_;
  mutable std::mutex mutex_;
  std::map<std::string, Entry> entries_;
};

}  // namespace tessera::server
