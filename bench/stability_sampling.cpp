// Sampling: what the catalogue asks of levels, of perspective and of an atlas at its limits.
#include <algorithm>
#include <array>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "atlas/addressing/addressing.h"
#include "bench/stability_fill.h"
#include "bench/stability_mesh.h"
#include "bench/stability_stage.h"

namespace tessera::bench {
namespace {

namespace addressing = atlas::addressing;
using atlas::LayoutKind;
using atlas::Placement;
using Measures = std::vector<StabilityMeasure>;

constexpr uint32_t kSide = 128;          // of pictures, in pixels
constexpr uint32_t kAtlasSide = 512;     // texels
constexpr double kRounding = 3 / 255.0;  // of the atlas, its fetch and the picture
constexpr double kRange = 0.4;           // of an sRGB channel over the mesh: 0.48 to 0.86
// Of an sRGB channel that is interpolated over the whole mesh, which should be of a linear one.
constexpr double kCurve = 0.04;
const char* const kAsTruth = "the reference renderer's picture";

// A scene, its truth and a chain whose placements are made by hand.
struct HandPlaced {
  std::unique_ptr<StabilityScene> scene;
  std::unique_ptr<StabilityChain> chain;
  shading::ReferenceImage truth;
  View view = stability_view(kSide);

  static StatusOr<HandPlaced> create(const StabilityContext& context, const StabilityMesh& mesh) {
    HandPlaced hand;
    TESSERA_ASSIGN_OR_RETURN(const ImportedMesh imported, import_mesh(mesh));
    TESSERA_ASSIGN_OR_RETURN(hand.scene, StabilityScene::create(context, imported.scene));
    TESSERA_ASSIGN_OR_RETURN(
        hand.chain,
        StabilityChain::create(
            *hand.scene, atlas::layout_settings(LayoutKind::tessellated, kAtlasSide, kAtlasSide), kSide));
    TESSERA_ASSIGN_OR_RETURN(hand.truth, hand.scene->truth(hand.view));
    return hand;
  }

  StatusOr<PictureErrors> errors(std::vector<Placement> placements) {
    TESSERA_RETURN_IF_ERROR(chain->serve(view, std::move(placements)));
    TESSERA_ASSIGN_OR_RETURN(const Image8 shown, chain->draw(view));
    return compare_pictures(truth, shown);
  }
};

Placement l_placement(scene::PatchId patch, uint32_t triangle, int level, bool turned, uint16_t x = 0,
                      uint16_t y = 0) {
  Placement p{.patch = patch, .part = atlas::part_of(triangle), .kind = atlas::PlacementKind::l};
  p.x = x;
  p.y = y;
  p.l = {.level = static_cast<uint8_t>(level), .splits = 1, .turned = turned, .next_y = 0};
  return p;
}

Placement halves_placement(int across, std::array<int, 2> along, int foot, int apex, bool turned) {
  Placement p{.patch = 0, .part = atlas::part_of(0), .kind = atlas::PlacementKind::halves};
  p.halves.apex = static_cast<uint8_t>(apex);
  p.halves.foot = static_cast<uint8_t>(foot);
  p.halves.across = static_cast<uint8_t>(across);
  for (int half = 0; half < 2; ++half)
    p.halves.half[half] = {.x = 5,
                           .y = static_cast<uint16_t>(kAtlasSide / 2 * half),
                           .along = static_cast<uint16_t>(along[half]),
                           .turned = turned};
  return p;
}

Placement block_placement(scene::PatchId patch, uint32_t width, uint32_t height, uint16_t x = 0,
                          bool transposed = false) {
  Placement p{.patch = patch, .kind = atlas::PlacementKind::block, .x = x};
  p.width = static_cast<uint16_t>(width);
  p.height = static_cast<uint16_t>(height);
  p.transposed = transposed;
  return p;
}

StabilityMesh lone_triangle() {
  StabilityMesh mesh;
  for (const vec2 uv : {vec2(0, 0), vec2(1, 0), vec2(0, 1)}) mesh.add(on_screen(uv.x, uv.y), uv);
  mesh.add_triangle(0, 1, 2);
  return mesh;
}

// Along the folds interpolation is off by up to a sixth of a step (l_packing.glsl).
double l_bound(int level) {
  return kRange / (6.0 * level) + kCurve / (level * level) + kRounding;
}
// Corners lie at texels: nothing is off but by the curve between two of them, and the tip of three triangles.
double block_bound(uint32_t width, uint32_t height) {
  const double steps = std::min(width, height) - 1.0;
  return kCurve / (steps * steps) + kRounding;
}

StatusOr<Measures> every_l(const StabilityContext& context) {
  TESSERA_ASSIGN_OR_RETURN(HandPlaced hand, HandPlaced::create(context, lone_triangle()));
  PictureErrors all{.covered = 1};
  double of_bound = 0, high = 0;
  for (int level = 1; level <= addressing::kMaxTessellationLevel; ++level)
    for (const bool turned : {false, true}) {
      TESSERA_ASSIGN_OR_RETURN(const PictureErrors errors,
                               hand.errors({l_placement(0, 0, level, turned, 4, 8)}));
      all = worst(all, errors);
      of_bound = std::max(of_bound, errors.color / l_bound(level));
      if (level >= 16) high = std::max(high, errors.color);
    }
  return Measures{
      {"colour, any level, of its bound", of_bound, 1, "a sixth of a step of the level, where it is folded"},
      {"colour, levels 16 to 64", high, l_bound(16), "a sixth of a step of level 16"},
      {"holes, any level", all.holes, 0, "levels change samples, not geometry"}};
}

// Samples lie on an even grid, so nothing is off but by the curve between two of them, unless those beyond
// the third side, up to a step away, are nearly black, where it bends most, or would have to be darker.
double halves_bound(int steps) {
  constexpr int kDarkSteps = 3;
  return (steps > kDarkSteps ? 0 : kRange / (2 * steps)) + kCurve / (steps * steps) + kRounding;
}

StatusOr<Measures> every_half(const StabilityContext& context) {
  TESSERA_ASSIGN_OR_RETURN(HandPlaced hand, HandPlaced::create(context, lone_triangle()));
  PictureErrors all{.covered = 1};
  double of_bound = 0, fine = 0;
  const auto try_halves = [&](int across, std::array<int, 2> along, int foot, int apex) -> Status {
    const bool turned = (across + along[0] + foot + apex) % 2 == 1;
    TESSERA_ASSIGN_OR_RETURN(const PictureErrors errors,
                             hand.errors({halves_placement(across, along, foot, apex, turned)}));
    all = worst(all, errors);
    const int least = std::min({across, along[0], along[1]});
    of_bound = std::max(of_bound, errors.color / halves_bound(least));
    if (least >= 16) fine = std::max(fine, errors.color);
    return absl::OkStatus();
  };
  constexpr int kLengths[] = {1, 2, 3, 7, 31, 100, 255, 500};
  for (const int across : {1, 2, 3, 5, 8, 16, 33, 64, 127, 128})
    for (size_t i = 0; i < std::size(kLengths); ++i)
      for (const int foot : {0, 13, 31, 63})
        for (int apex = 0; apex < 3; ++apex) {
          // Two lengths that differ, so that one taken for the other shows.
          const std::array<int, 2> along{kLengths[i], kLengths[(i + 1) % std::size(kLengths)]};
          TESSERA_RETURN_IF_ERROR(try_halves(across, along, foot, apex));
        }
  return Measures{
      {"colour, any halves, of its bound", of_bound, 1,
       "sRGB's curve between samples; up to 3 intervals half a step, where they reach black"},
      {"colour, 16 and more intervals", fine, halves_bound(16), "rounding, and sRGB's curve between samples"},
      {"holes, any halves", all.holes, 0, "halves change samples, not geometry"}};
}

StatusOr<Measures> every_block(const StabilityContext& context) {
  TESSERA_ASSIGN_OR_RETURN(HandPlaced hand, HandPlaced::create(context, grid_mesh(1, 1, on_screen)));
  PictureErrors all{.covered = 1};
  double of_bound = 0;
  const auto try_block = [&](uint32_t width, uint32_t height, bool transposed) -> Status {
    TESSERA_ASSIGN_OR_RETURN(const PictureErrors errors,
                             hand.errors({block_placement(0, width, height, 6, transposed)}));
    all = worst(all, errors);
    of_bound = std::max(of_bound, errors.color / block_bound(width, height));
    return absl::OkStatus();
  };
  for (uint32_t width = 2; width <= 256; width *= 2)
    for (uint32_t height = 2; height <= width; height *= 2)
      for (const bool transposed : {false, true})
        TESSERA_RETURN_IF_ERROR(try_block(width, height, transposed));
  for (uint32_t side = 2; side <= 64; side += 2)  // of layout coherent
    TESSERA_RETURN_IF_ERROR(try_block(side, 66 - side, false));
  return Measures{
      {"colour, any block, of its bound", of_bound, 1, "rounding, and sRGB's curve between texels"},
      {"holes, any block", all.holes, 0, "blocks change samples, not geometry"}};
}

// Towards a wall and back, a third nearer a frame: all levels change, some in each frame.
StatusOr<Measures> level_changes(const StabilityContext& context) {
  TESSERA_ASSIGN_OR_RETURN(const ImportedMesh imported, import_mesh(grid_mesh(6, 6, on_screen)));
  std::vector<View> views;
  for (int frame = -6; frame <= 6; ++frame)
    views.push_back(stability_view(kSide, {0, 0, std::pow(0.68, 6 - std::abs(frame)) * 6 - 1}));
  return measure_pictures(context, imported.scene, views,
                          {.color = kRounding, .why = "colours are linear: atlas, fetch and picture round"});
}

// A floor `height` below the eye whose near edge lies under it.
StatusOr<Measures> perspective(const StabilityContext& context, float height) {
  StabilityMesh mesh =
      grid_mesh(1, 1, [&](float u, float v) { return vec3(4 * u - 2, -height, 1e-3f - 4 * v); });
  TESSERA_ASSIGN_OR_RETURN(const ImportedMesh imported, import_mesh(mesh));
  const View view = stability_view(kSide);
  return measure_pictures(context, imported.scene, {&view, 1},
                          {.color = kRounding, .why = "colours are linear: atlas, fetch and picture round"});
}

// Two quads side by side, one with the fewest samples, one with very many.
StatusOr<Measures> unlike_neighbours(const StabilityContext& context) {
  TESSERA_ASSIGN_OR_RETURN(HandPlaced hand, HandPlaced::create(context, grid_mesh(2, 1, on_screen)));
  TESSERA_ASSIGN_OR_RETURN(const PictureErrors blocks,
                           hand.errors({block_placement(0, 2, 2), block_placement(1, 256, 256, 256)}));
  std::vector<Placement> ls;
  for (uint32_t triangle = 0; triangle < 2; ++triangle)
    ls.push_back(l_placement(0, triangle, 1, triangle == 1));
  for (uint32_t triangle = 0; triangle < 2; ++triangle)
    ls.push_back(l_placement(1, triangle, 64, triangle == 1, 16, 16));
  TESSERA_ASSIGN_OR_RETURN(const PictureErrors triangles, hand.errors(ls));
  Measures measures;
  add_measures("2x2 beside 256x256", blocks, {block_bound(2, 2), "of the coarser one"}, measures);
  add_measures("level 1 beside 64", triangles, {l_bound(1), "of the coarser one"}, measures);
  return measures;
}

// One tall quad beside 7 low ones: their corners lie on its edge, up to rounding, and no one shares them.
StatusOr<Measures> t_junctions(const StabilityContext& context) {
  const auto tilted = [](float u, float v) {
    return vec3(1.8f * u - 0.9f + 0.2f * v, 1.8f * v - 0.9f, -1 - 0.3f * v);
  };
  StabilityMesh mesh = grid_mesh({0, 0.5f}, {0, 1}, tilted);
  const StabilityMesh low = grid_mesh({0.5f, 1}, even_steps(7), tilted);
  const auto first = static_cast<uint32_t>(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), low.positions.begin(), low.positions.end());
  mesh.colors.insert(mesh.colors.end(), low.colors.begin(), low.colors.end());
  for (const uint32_t index : low.indices) mesh.indices.push_back(first + index);
  TESSERA_ASSIGN_OR_RETURN(const ImportedMesh imported, import_mesh(mesh));
  const View view = stability_view(kSide);
  return measure_pictures(context, imported.scene, {&view, 1},
                          {.color = kRounding,
                           .why = "colours are linear: atlas, fetch and picture round",
                           // 112 pixels of edge, of 112 x 112. Half a step of 1/8192 m and the grid that
                           // rasterisers round to, of 1/256 of a pixel of 1/64 m, can part its two sides.
                           .holes = (0.5 / 128 + 1 / 256.0) / 112,
                           .holes_why = "positions travel in steps of 1/8192 m, and pixels have 256"});
}

// A picture that needs many times the atlas.
StatusOr<Measures> tiny_atlas(const StabilityContext& context, LayoutKind kind) {
  TESSERA_ASSIGN_OR_RETURN(const ImportedMesh imported, import_mesh(grid_mesh(20, 20, on_screen)));
  TESSERA_ASSIGN_OR_RETURN(const auto scene, StabilityScene::create(context, imported.scene));
  const View view = stability_view(kSide);
  TESSERA_ASSIGN_OR_RETURN(const shading::ReferenceImage truth, scene->truth(view));
  TESSERA_ASSIGN_OR_RETURN(const auto chain,
                           StabilityChain::create(*scene, atlas::layout_settings(kind, 64, 32), kSide));
  PictureErrors errors{.covered = 1};
  for (int frame = 0; frame < 8; ++frame) {
    TESSERA_RETURN_IF_ERROR(chain->serve(view));
    TESSERA_ASSIGN_OR_RETURN(const Image8 shown, chain->draw(view));
    errors = worst(errors, compare_pictures(truth, shown));
  }
  Measures measures;
  add_measures(
      std::string(atlas::kLayoutNames[static_cast<size_t>(kind)]), errors,
      {.color = kRange * 2 / 20, .why = "a patch of a single colour: two thirds of its range, a fringe"},
      measures);
  return measures;
}

StatusOr<Measures> tiny_atlases(const StabilityContext& context) {
  Measures all;
  for (const LayoutKind kind : {LayoutKind::blocks, LayoutKind::coherent, LayoutKind::tessellated}) {
    TESSERA_ASSIGN_OR_RETURN(const Measures measures, tiny_atlas(context, kind));
    all.insert(all.end(), measures.begin(), measures.end());
  }
  return all;
}

}  // namespace

std::vector<StabilityCase> sampling_stability_cases() {
  const auto bind = [](auto function, auto... arguments) {
    return [=](const StabilityContext& context) { return function(context, arguments...); };
  };
  std::vector<StabilityCase> cases = {
      {"sampling", "every-l-level", "a triangle with an L of each level from 1 to 64, upright and turned",
       kAsTruth, every_l},
      {"sampling", "every-half",
       "a triangle as two halves of 1x1 to 128x500 intervals, from each corner, upright and turned", kAsTruth,
       every_half},
      {"sampling", "every-block", "two triangles with each block from 2x2 to 256x256, and even ones",
       kAsTruth, every_block},
      {"sampling", "level-changes", "13 frames towards a wall and back, a third a frame", kAsTruth,
       level_changes},
      {"sampling", "perspective-1", "a floor 1 m below the eye that begins under it", kAsTruth,
       bind(perspective, 1.0f)},
      {"sampling", "perspective-1e-2", "a floor 1 cm below the eye that begins under it", kAsTruth,
       bind(perspective, 1e-2f)},
      {"sampling", "perspective-5e-3", "a floor 5 mm below the eye that begins under it", kAsTruth,
       bind(perspective, 5e-3f)},
      {"sampling", "unlike-neighbours", "quads with the fewest and with very many samples share an edge",
       kAsTruth, unlike_neighbours},
      {"sampling", "t-junctions", "one quad beside seven whose corners lie on its edge", kAsTruth,
       t_junctions},
      {"sampling", "tiny-atlas", "an atlas of 64x32 for a picture of 128x128, 8 frames",
       "all is shown, coarsely", tiny_atlases},
  };
  for (StabilityCase& fill : fill_stability_cases()) cases.push_back(std::move(fill));
  return cases;
}

}  // namespace tessera::bench
