// Rendered truth pictures on disk, so that a second run over the same path does not render them again.
#pragma once

#include <filesystem>
#include <future>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "absl/functional/function_ref.h"
#include "base/status.h"
#include "base/view.h"
#include "shading/reference.h"

namespace tessera::bench {

// Read by several at once, beside the rendering of the next one.
using RenderedImage = std::shared_ptr<const shading::ReferenceImage>;

// Everything that decides a picture's pixels.
struct TruthKey {
  std::string scene;         // scene_identity()
  std::string renderer;      // renderer sources and device, see bench/version.h
  TimeNs scene_time_ns = 0;  // 0 where nothing moves
  View view;
  shading::ReferenceRequest request;

  std::string text() const;
};

// A file's absolute path, size and time of change; the specification itself for a procedural scene (whose
// maker is part of the renderer's sources).
std::string scene_identity(const std::string& spec);

// $XDG_CACHE_HOME/tessera/truth, or ~/.cache/tessera/truth.
std::filesystem::path default_truth_cache();

// One file an entry: colour as PNG, the rest deflated, with a checksum and its whole key. A damaged or
// foreign entry is a miss. Thread-safe.
class TruthCache {
 public:
  static constexpr uint64_t kDefaultMaxBytes = uint64_t{4} << 30;

  // Keeps nothing.
  TruthCache() = default;
  // Entries that were used longest ago are removed when the folder would exceed `max_bytes`.
  static StatusOr<std::unique_ptr<TruthCache>> open(const std::filesystem::path& folder,
                                                    uint64_t max_bytes = kDefaultMaxBytes);

  std::optional<shading::ReferenceImage> find(const TruthKey& key);
  Status store(const TruthKey& key, const shading::ReferenceImage& image);

  // From the cache, or rendered and then kept: packing and writing go on beside the caller's work, until the
  // next get() or the end. A failure to store is logged once and is no error.
  StatusOr<RenderedImage> get(const TruthKey& key, absl::FunctionRef<StatusOr<RenderedImage>()> render);

  struct Stats {
    uint64_t hits = 0, misses = 0, bytes = 0;
  };
  Stats stats() const;

 private:
  struct Entry {
    std::filesystem::path file;
    uint64_t bytes;
  };

  void finish_storing();
  void touch(const std::string& name);
  void remove_oldest(uint64_t bytes_needed);
  void add(const std::filesystem::path& file, uint64_t bytes);
  void forget(const std::string& name);

  std::filesystem::path folder_;  // empty: keeps nothing
  uint64_t max_bytes_ = 0;
  mutable std::mutex mutex_;
  Stats stats_;
  bool store_failure_logged_ = false;
  std::map<uint64_t, Entry> by_use_;        // oldest use first
  std::map<std::string, uint64_t> use_of_;  // file name → key in by_use_
  uint64_t next_use_ = 0;
  std::mutex storing_mutex_;   // of storing_; taken before mutex_
  std::future<void> storing_;  // last, so that it ends first
};

}  // namespace tessera::bench
