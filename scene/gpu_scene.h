// A scene on the device. GpuScene is uploaded once and shared by all sessions; SceneInstant is the scene at
// one time with its transforms relative to one origin (camera-relative rendering), one a session and frame in
// flight.
#pragma once

#include <memory>

#include "gpu/buffer.h"
#include "gpu/commands.h"
#include "gpu/image.h"
#include "gpu/pipeline.h"
#include "scene/scene.h"

namespace tessera::scene {

// Descriptor set 0 in every pass that touches the scene: see scene/shaders/scene.glsl for the bindings.
// Holds vertices, indices, patches, meshlets, materials and textures (2D arrays by size and format, so their
// number is not limited by the device's bindings).
class GpuScene {
 public:
  static StatusOr<std::unique_ptr<GpuScene>> create(gpu::Device& device, std::shared_ptr<const Scene> scene);
  ~GpuScene();

  const Scene& scene() const;
  const gpu::BindLayout& layout() const;          // set 0
  const gpu::BindLayout& instant_layout() const;  // set 1
  const gpu::BindGroup& group() const;
  const gpu::Buffer& indices() const;  // all geometries', as uint32; values are global vertex indices
  // Range of a geometry in indices().
  uint32_t first_index(uint32_t geometry) const;
  // (instance, meshlet) pairs over the whole scene, in instance order: the unit of culling passes.
  uint32_t instanced_meshlet_count() const;
  // Values for the specialization constants that scene.glsl declares.
  std::vector<gpu::Constant> constants() const;
  uint64_t device_bytes() const;

 private:
  struct Impl;
  explicit GpuScene(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

// Descriptor set 1: per-instance transforms (3x4, relative to the origin).
class SceneInstant {
 public:
  static StatusOr<std::unique_ptr<SceneInstant>> create(gpu::Device& device, const GpuScene& scene);
  ~SceneInstant();

  // Writes the transforms for `time_ns` relative to `origin`. Must not overlap GPU work that reads this
  // instant.
  void set(TimeNs time_ns, const dvec3& origin);
  const dvec3& origin() const;
  TimeNs time_ns() const;
  const gpu::BindGroup& group() const;
  // World matrices in double precision of the instances, as of set().
  const std::vector<dmat4>& instance_transforms() const;

 private:
  struct Impl;
  explicit SceneInstant(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera::scene
