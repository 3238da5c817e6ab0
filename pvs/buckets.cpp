#include "pvs/buckets.h"

namespace tessera::pvs {
namespace {

uint32_t bucket_of(const scene::Material& material, const dmat4& transform) {
  const uint32_t first = material.alpha_mode == scene::AlphaMode::mask ? 3 : 0;
  if (material.double_sided) return first + 2;
  return first + (glm::determinant(glm::dmat3(transform)) < 0 ? 1 : 0);
}

}  // namespace

BucketTable make_buckets(const scene::Scene& scene, std::span<const dmat4> instance_transforms) {
  BucketTable out;
  out.of_instance.reserve(scene.instances.size());
  for (size_t i = 0; i < scene.instances.size(); ++i) {
    const scene::Instance& instance = scene.instances[i];
    const uint32_t bucket = bucket_of(scene.materials[instance.material], instance_transforms[i]);
    out.of_instance.push_back(bucket);
    out.meshlets[bucket] += static_cast<uint32_t>(scene.geometries[instance.geometry].meshlets.size());
  }
  for (uint32_t b = 1; b < kBuckets; ++b) out.first_draw[b] = out.first_draw[b - 1] + out.meshlets[b - 1];
  return out;
}

}  // namespace tessera::pvs
