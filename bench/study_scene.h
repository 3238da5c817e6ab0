// What a study runs on, by its settings.
#pragma once

#include <memory>

#include "base/camera_path.h"
#include "bench/result.h"
#include "bench/settings.h"
#include "bench/truth_source.h"
#include "server/shared_scene.h"

namespace tessera::bench {

struct StudyScene {
  std::shared_ptr<gpu::Device> device;
  std::shared_ptr<const scene::Scene> scene;
  std::shared_ptr<server::SharedScene> shared;
  CameraPath path;

  DeviceDescription description() const;
  // The truth that the settings ask for.
  StatusOr<std::unique_ptr<TruthSource>> truth(const LoopbackSettings& settings) const;
};

StatusOr<StudyScene> load_study_scene(const LoopbackSettings& settings);

}  // namespace tessera::bench
