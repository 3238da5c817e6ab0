#include "bench/truth_cache.h"

#include <algorithm>
#include <cstdlib>
#include <vector>

#include "base/log.h"
#include "bench/file_io.h"
#include "bench/truth_entry.h"

namespace tessera::bench {
namespace {

namespace fs = std::filesystem;
constexpr std::string_view kExtension = ".truth";

std::string name_of(const TruthKey& key) {
  return fingerprint_hex(key.text()) + std::string(kExtension);
}

}  // namespace

std::string TruthKey::text() const {
  const dvec3& p = view.pose.position;
  const dquat& q = view.pose.orientation;
  const Fov& fov = view.fov;
  // %a writes every bit of a floating-point number.
  return absl::StrFormat("scene %s\nrenderer %s\ntime %d\n", scene, renderer, scene_time_ns) +
         absl::StrFormat("position %a %a %a\norientation %a %a %a %a\n", p.x, p.y, p.z, q.w, q.x, q.y, q.z) +
         absl::StrFormat("fov %a %a %a %a near %a\n", fov.left, fov.right, fov.down, fov.up, view.near_m) +
         absl::StrFormat("size %d %d samples %d ids %d depth %d\n", view.width, view.height, request.samples,
                         request.ids, request.depth);
}

std::string scene_identity(const std::string& spec) {
  std::error_code error;
  const fs::path file = fs::canonical(spec, error);
  if (error) return spec;
  const uint64_t size = fs::file_size(file, error);
  const auto changed = fs::last_write_time(file, error).time_since_epoch().count();
  return absl::StrCat(file.string(), " ", size, " bytes, changed ", static_cast<int64_t>(changed));
}

fs::path default_truth_cache() {
  if (const char* cache = std::getenv("XDG_CACHE_HOME"); cache && *cache)
    return fs::path(cache) / "tessera/truth";
  const char* home = std::getenv("HOME");
  return fs::path(home && *home ? home : ".") / ".cache/tessera/truth";
}

StatusOr<std::unique_ptr<TruthCache>> TruthCache::open(const fs::path& folder, uint64_t max_bytes) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) {
    return absl::UnavailableError(absl::StrCat(folder.string(), ": the truth cache cannot be made (",
                                               error.message(), "); choose another folder, or `none`"));
  }
  std::vector<std::pair<fs::file_time_type, Entry>> found;
  for (const auto& file : fs::directory_iterator(folder, error)) {
    if (file.path().extension() != kExtension) continue;
    std::error_code gone;  // another run may have removed it meanwhile
    found.push_back({file.last_write_time(gone), {file.path(), file.file_size(gone)}});
    if (gone) found.pop_back();
  }
  std::sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.first < b.first; });

  auto cache = std::make_unique<TruthCache>();
  cache->folder_ = folder;
  cache->max_bytes_ = max_bytes;
  for (const auto& [time, entry] : found) cache->add(entry.file, entry.bytes);
  return cache;
}

void TruthCache::add(const fs::path& file, uint64_t bytes) {
  forget(file.filename());
  by_use_[next_use_] = {file, bytes};
  use_of_[file.filename()] = next_use_++;
  stats_.bytes += bytes;
}

void TruthCache::forget(const std::string& name) {
  const auto use = use_of_.find(name);
  if (use == use_of_.end()) return;
  stats_.bytes -= by_use_.at(use->second).bytes;
  by_use_.erase(use->second);
  use_of_.erase(use);
}

void TruthCache::touch(const std::string& name) {
  const auto use = use_of_.find(name);
  if (use == use_of_.end()) return;
  const Entry entry = by_use_.at(use->second);
  add(entry.file, entry.bytes);
  std::error_code ignored;  // the order of use is a hint for the next run
  fs::last_write_time(entry.file, fs::file_time_type::clock::now(), ignored);
}

void TruthCache::remove_oldest(uint64_t bytes_needed) {
  while (!by_use_.empty() && stats_.bytes + bytes_needed > max_bytes_) {
    const fs::path file = by_use_.begin()->second.file;
    std::error_code ignored;
    fs::remove(file, ignored);
    forget(file.filename());
  }
}

std::optional<shading::ReferenceImage> TruthCache::find(const TruthKey& key) {
  std::optional<shading::ReferenceImage> image;
  if (!folder_.empty()) {
    const auto bytes = read_file(folder_ / name_of(key));
    if (bytes.ok()) image = unpack_truth(key.text(), *bytes);
  }
  const std::lock_guard lock(mutex_);
  ++(image ? stats_.hits : stats_.misses);
  if (image) touch(name_of(key));
  return image;
}

Status TruthCache::store(const TruthKey& key, const shading::ReferenceImage& image) {
  if (folder_.empty()) return absl::OkStatus();
  const std::vector<uint8_t> bytes = pack_truth(key.text(), image);
  if (bytes.size() > max_bytes_) return absl::OkStatus();
  const fs::path file = folder_ / name_of(key);
  const std::lock_guard lock(mutex_);
  forget(file.filename());  // it is replaced
  remove_oldest(bytes.size());
  TESSERA_RETURN_IF_ERROR(write_file(file, std::span<const uint8_t>(bytes)));
  add(file, bytes.size());
  return absl::OkStatus();
}

void TruthCache::finish_storing() {
  const std::lock_guard lock(storing_mutex_);
  if (storing_.valid()) storing_.get();
}

StatusOr<RenderedImage> TruthCache::get(const TruthKey& key,
                                        absl::FunctionRef<StatusOr<RenderedImage>()> render) {
  finish_storing();
  if (auto cached = find(key)) return std::make_shared<const shading::ReferenceImage>(*std::move(cached));
  TESSERA_ASSIGN_OR_RETURN(RenderedImage image, render());
  if (folder_.empty()) return image;
  const std::lock_guard storing_lock(storing_mutex_);
  storing_ = std::async(std::launch::async, [this, key, image] {
    const Status stored = store(key, *image);
    if (stored.ok()) return;
    const std::lock_guard lock(mutex_);
    if (!store_failure_logged_) spdlog::warn("truth cache: {}", stored.ToString());
    store_failure_logged_ = true;
  });
  return image;
}

TruthCache::Stats TruthCache::stats() const {
  const std::lock_guard lock(mutex_);
  return stats_;
}

}  // namespace tessera::bench
