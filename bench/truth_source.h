// The truth for a display moment: from the cache on disk, or rendered by the forward reference renderer.
//
// Baselines stream pictures for the poses of earlier display frames: what was rendered for one of those
// serves again, if nothing in it can have moved.
#pragma once

#include <deque>
#include <memory>
#include <string>
#include <utility>

#include "bench/truth_cache.h"
#include "server/shared_scene.h"
#include "shading/reference.h"

namespace tessera::bench {

class TruthSource {
 public:
  // `cache_dir`: a folder, "" for the default one, "none" for no cache. `scene_spec` names the scene in the
  // cache.
  static StatusOr<std::unique_ptr<TruthSource>> create(std::shared_ptr<server::SharedScene> scene,
                                                       const std::string& scene_spec,
                                                       const std::string& cache_dir, uint32_t samples);

  // Colour, ids and coverage.
  StatusOr<RenderedImage> truth(const View& view, TimeNs scene_time_ns);
  // A picture for the baselines, never cached on disk. It may have more planes than were asked for.
  StatusOr<RenderedImage> render(const View& view, TimeNs scene_time_ns,
                                 const shading::ReferenceRequest& request);
  // The scene at the last view and time that were asked for, relative to that view's eye.
  const scene::SceneInstant& instant() const { return *instant_; }
  TruthCache::Stats cache_stats() const { return cache_->stats(); }

 private:
  TruthSource() = default;
  TruthKey key_of(const View& view, TimeNs scene_time_ns, const shading::ReferenceRequest& request) const;
  RenderedImage find_recent(const TruthKey& key) const;
  void keep_recent(const TruthKey& key, const RenderedImage& image);

  std::shared_ptr<server::SharedScene> scene_;
  std::unique_ptr<scene::SceneInstant> instant_;
  std::unique_ptr<shading::ReferenceRenderer> renderer_;
  std::unique_ptr<TruthCache> cache_;
  std::string identity_;
  uint32_t samples_ = 4;
  std::deque<std::pair<TruthKey, RenderedImage>> recent_;  // newest last
};

}  // namespace tessera::bench
