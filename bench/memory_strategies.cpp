#include "bench/memory_strategies.h"

#include <array>
#include <memory>

#include "atlas/blocks/layout.h"
#include "bench/path_views.h"
#include "bench/streamer.h"
#include "pvs/retention.h"
#include "pvs/visibility.h"
#include "scene/gltf.h"
#include "scene/procedural.h"

namespace tessera::bench {
namespace {

using atlas::blocks::Layout;
using atlas::blocks::Strategy;

constexpr std::array kStrategies{Strategy::reference, Strategy::no_columns, Strategy::no_stacks,
                                 Strategy::no_resets};

// Sums until finish().
void add(const Layout& layout, StrategyRow& row) {
  const atlas::LayoutStats& stats = layout.stats();
  const atlas::blocks::AllocatorStats memory = layout.memory();
  const auto share = [&memory](uint64_t texels) {
    return static_cast<double>(texels) / static_cast<double>(memory.capacity_texels);
  };
  ++row.frames;
  row.used += share(memory.used_texels);
  row.carried += share(memory.carry_texels);
  row.stacks += share(memory.stack_texels);
  row.inaccessible += share(memory.inaccessible_texels);
  row.free += share(memory.free_texels);
  row.out_of_memory_frames += stats.colors_out_of_memory > 0;
  row.out_of_memory_patches += stats.colors_out_of_memory;
  row.halved_frames += stats.blocks_halved > 0;
  row.halved_patches += stats.blocks_halved;
  row.resets = stats.resets_total;
  row.reset_frames += stats.reset;
  row.bias += stats.bias;
  row.blocks += stats.blocks;
  row.colors += stats.colors;
}

void finish(StrategyRow& row) {
  for (double* sum : {&row.used, &row.carried, &row.stacks, &row.inaccessible, &row.free,
                      &row.out_of_memory_patches, &row.halved_patches, &row.bias, &row.blocks, &row.colors}) {
    *sum /= std::max(1u, row.frames);
  }
}

}  // namespace

std::string_view name_of(Strategy strategy) {
  constexpr std::array<std::string_view, kStrategies.size()> kNames{"S0", "S1", "S2", "S3"};
  return kNames[static_cast<size_t>(strategy)];
}

StatusOr<std::vector<StrategyRow>> compare_strategies(gpu::Device& device, const LoopbackSettings& settings,
                                                      uint32_t frames, Progress& progress) {
  TESSERA_ASSIGN_OR_RETURN(const std::shared_ptr<const scene::Scene> scene,
                           scene::load_scene(settings.scene));
  TESSERA_ASSIGN_OR_RETURN(const CameraPath path, scene::load_path(settings.path));
  TESSERA_ASSIGN_OR_RETURN(const auto gpu_scene, scene::GpuScene::create(device, scene));
  TESSERA_ASSIGN_OR_RETURN(const auto instant, scene::SceneInstant::create(device, *gpu_scene));
  TESSERA_ASSIGN_OR_RETURN(const auto visibility, pvs::Visibility::create(device, *gpu_scene, {}));

  const atlas::LayoutSettings layout_settings =
      atlas::blocks::settings_for(settings.atlas.width, settings.atlas.height);
  std::vector<StrategyRow> rows;
  std::vector<std::unique_ptr<Layout>> layouts;
  for (const Strategy strategy : kStrategies) {
    TESSERA_ASSIGN_OR_RETURN(auto layout, Layout::create(*scene, layout_settings, strategy));
    layouts.push_back(std::move(layout));
    rows.push_back({.strategy = strategy});
  }

  pvs::Retention retention;
  progress.begin("path frames", frames);
  for (uint32_t i = 0; i < frames; ++i) {
    const PathViews from = path_views(settings, path, settings.start_s + i / settings.server_fps);
    instant->set(from.newest.time_ns, from.newest.pose.position);
    TESSERA_ASSIGN_OR_RETURN(const scene::VisiblePatches seen,
                             visibility->determine(*instant, from.views, client_view(settings)));
    const scene::VisiblePatches visible =
        retention.update(from.newest.time_ns, from_ms(2 * settings.delay_ms), seen);
    for (size_t s = 0; s < layouts.size(); ++s) {
      layouts[s]->update({.visible = visible});
      add(*layouts[s], rows[s]);
    }
    progress.advance();
  }
  for (StrategyRow& row : rows) finish(row);
  return rows;
}

}  // namespace tessera::bench
