// Which pipeline state draws an instance. Meshlets of one bucket share one list of draw commands.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/math.h"
#include "gpu/pipeline.h"
#include "scene/scene.h"

namespace tessera::pvs {

// Also in pvs/shaders/visibility.glsl.
constexpr uint32_t kBuckets = 6;

struct BucketState {
  bool masked;
  gpu::Cull cull;
};
// A mirroring transform turns front faces clockwise. Double-sided materials have no hidden side.
constexpr std::array<BucketState, kBuckets> kBucketStates{{{false, gpu::Cull::back},
                                                           {false, gpu::Cull::front},
                                                           {false, gpu::Cull::none},
                                                           {true, gpu::Cull::back},
                                                           {true, gpu::Cull::front},
                                                           {true, gpu::Cull::none}}};

struct BucketTable {
  std::vector<uint32_t> of_instance;
  std::array<uint32_t, kBuckets> meshlets{};    // the most that a bucket can hold
  std::array<uint32_t, kBuckets> first_draw{};  // buckets follow each other in the list of commands
};

BucketTable make_buckets(const scene::Scene& scene, std::span<const dmat4> instance_transforms);

}  // namespace tessera::pvs
