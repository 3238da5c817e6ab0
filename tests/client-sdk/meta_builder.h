// Small meta frames for the tests of the client.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "geometry-compression/meta_frame.h"

namespace tessera::client::test {

using geometry_compression::MetaFrame;
using geometry_compression::PatchPlacement;
using geometry_compression::PlacementKind;

// A first frame: one mesh of 1 m steps, one object, `patches` patches of `triangles` triangles on the same
// five vertices.
inline MetaFrame first_frame(uint32_t frame, uint32_t patches = 1, uint8_t triangles = 2) {
  MetaFrame meta;
  meta.frame = frame;
  meta.atlas_width = meta.atlas_height = 16;
  meta.full_state = true;
  meta.meshes.push_back({});
  for (int32_t i = 0; i < 5; ++i) meta.vertices.push_back({0, {i, 2 * i, -i}});
  meta.objects.push_back({});
  for (uint32_t i = 0; i < patches; ++i) {
    geometry_compression::NewPatch patch{.object = 0, .triangles = triangles};
    for (uint32_t v = 0; v < triangles + 2u; ++v) patch.vertices[v] = v;
    meta.patches.push_back(patch);
  }
  return meta;
}

inline MetaFrame next_frame(uint32_t frame) {
  MetaFrame meta;
  meta.frame = frame;
  meta.atlas_width = meta.atlas_height = 16;
  return meta;
}

inline PatchPlacement in_color(uint32_t patch, uint32_t rgb) {
  return {.patch = patch, .kind = PlacementKind::color, .rgb = rgb};
}

inline PatchPlacement in_block(uint32_t patch, uint16_t x, uint16_t y, uint16_t width, uint16_t height) {
  return {.patch = patch, .kind = PlacementKind::block, .x = x, .y = y, .width = width, .height = height};
}

inline PatchPlacement in_l(uint32_t patch, uint8_t part, uint16_t x, uint16_t y, uint8_t level,
                           uint8_t splits = 1) {
  PatchPlacement p{.patch = patch, .part = part, .kind = PlacementKind::l, .x = x, .y = y};
  p.l = {level, splits, false, 0};
  return p;
}

// Both halves at one place.
inline PatchPlacement in_halves(uint32_t patch, uint8_t part, uint8_t apex, uint8_t across, uint16_t along,
                                uint16_t x, uint16_t y) {
  PatchPlacement p{.patch = patch, .part = part, .kind = PlacementKind::halves};
  p.halves = {apex, 30, across, {{{x, y, along, false}, {x, y, along, true}}}};
  return p;
}

inline PatchPlacement gone(uint32_t patch) {
  return {.patch = patch};
}

}  // namespace tessera::client::test
