#include "pvs/id_pass.h"

#include <algorithm>

#include "pvs/shaders/ids.frag.spv.h"
#include "pvs/shaders/ids.vert.spv.h"

namespace tessera::pvs {
namespace {

constexpr uint32_t kMaskedConstant = 1;  // kMasked in ids.vert, ids.frag
constexpr uint32_t kSizeStep = 64;  // views grow and shrink with the margin: targets do not follow each pixel

uint32_t rounded_up(uint32_t size) {
  return (size + kSizeStep - 1) / kSizeStep * kSizeStep;
}

}  // namespace

StatusOr<IdPass> IdPass::create(gpu::Device& device, const scene::GpuScene& scene) {
  IdPass out;
  out.device_ = &device;
  out.scene_ = &scene;
  const auto make = [&](bool masked) {
    std::vector<gpu::Constant> constants = scene.constants();
    constants.push_back({kMaskedConstant, masked});
    return gpu::RasterPipeline::create(device, {.name = masked ? "pvs masked ids" : "pvs ids",
                                                .vertex = ids_vert,
                                                .fragment = ids_frag,
                                                .layouts = {&scene.layout(), &scene.instant_layout()},
                                                .push_bytes = sizeof(mat4),
                                                .constants = constants,
                                                .colors = {gpu::Format::r32_uint},
                                                .depth = gpu::Format::depth32_float});
  };
  TESSERA_ASSIGN_OR_RETURN(out.opaque_, make(false));
  if (scene.scene().features.alpha_mask) {
    TESSERA_ASSIGN_OR_RETURN(out.masked_, make(true));
  }
  return out;
}

StatusOr<bool> IdPass::reserve(uint32_t width, uint32_t height) {
  if (width <= ids_.width() && height <= ids_.height() && depth_.width() > 0) return false;
  width = rounded_up(std::max(width, ids_.width()));
  height = rounded_up(std::max(height, ids_.height()));
  TESSERA_ASSIGN_OR_RETURN(
      ids_, gpu::Image::create(*device_, {.width = width, .height = height, .format = gpu::Format::r32_uint},
                               "pvs ids"));
  TESSERA_ASSIGN_OR_RETURN(
      depth_,
      gpu::Image::create(*device_, {.width = width, .height = height, .format = gpu::Format::depth32_float},
                         "pvs depth"));
  return true;
}

void IdPass::begin(gpu::Commands& commands, const View& view, bool clear) const {
  gpu::ColorAttachment ids{.image = &ids_};
  if (clear) ids.clear_uint = {0, 0, 0, 0};
  commands.begin_rendering({.colors = std::span(&ids, 1),
                            .depth = &depth_,
                            .clear_depth = clear,
                            .width = view.width,
                            .height = view.height});
}

void IdPass::bind(gpu::Commands& commands, const scene::SceneInstant& instant, const View& view,
                  const BucketState& state) const {
  commands.bind(pipeline(state.masked), {&scene_->group(), &instant.group()});
  commands.set_cull(state.cull);
  commands.bind_indices(scene_->indices());
  commands.push(view_projection(view, instant.origin()));
}

void IdPass::record(gpu::Commands& commands, const scene::SceneInstant& instant, const View& view,
                    const BucketTable& buckets, const MeshletCulling& culling, bool clear) const {
  begin(commands, view, clear);
  for (uint32_t b = 0; b < kBuckets; ++b) {
    if (buckets.meshlets[b] == 0) continue;
    bind(commands, instant, view, kBucketStates[b]);
    commands.draw_indexed_indirect_count(culling.draws(), MeshletCulling::draw_offset(buckets.first_draw[b]),
                                         culling.counts(), MeshletCulling::count_offset(b),
                                         buckets.meshlets[b]);
  }
  commands.end_rendering();
  commands.barrier();
}

void IdPass::record_all(gpu::Commands& commands, const scene::SceneInstant& instant, const View& view,
                        const BucketTable& buckets) const {
  const scene::Scene& scene = scene_->scene();
  begin(commands, view, true);
  for (uint32_t b = 0; b < kBuckets; ++b) {
    if (buckets.meshlets[b] == 0) continue;
    bind(commands, instant, view, kBucketStates[b]);
    uint32_t first_meshlet = 0;
    for (size_t i = 0; i < scene.instances.size(); ++i) {
      const uint32_t geometry = scene.instances[i].geometry;
      if (buckets.of_instance[i] == b) {
        commands.draw_indexed(3 * scene.geometries[geometry].triangle_count(), 1,
                              scene_->first_index(geometry), 0, first_meshlet);
      }
      first_meshlet += static_cast<uint32_t>(scene.geometries[geometry].meshlets.size());
    }
  }
  commands.end_rendering();
  commands.barrier();
}

void IdPass::record_warm_up(gpu::Commands& commands, const scene::SceneInstant& instant,
                            const View& view) const {
  begin(commands, view, true);
  for (const BucketState& state : kBucketStates) {
    if (state.masked && !scene_->scene().features.alpha_mask) continue;
    bind(commands, instant, view, state);
    commands.draw_indexed(3, 1, 0, 0, 0);
  }
  commands.end_rendering();
  commands.barrier();
}

}  // namespace tessera::pvs
