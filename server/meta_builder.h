// Turns a frame's layout delta into the meta packet's values: gives dense ids to what the client has not seen
// yet, sends each vertex position once, and repeats a single colour only when it has changed visibly.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "atlas/placement.h"
#include "base/frame_number.h"
#include "geometry-compression/meta_codec.h"
#include "scene/scene.h"

namespace tessera::server {

struct MetaSettings {
  uint16_t atlas_width = 2048, atlas_height = 1024;
  double position_step_m =
      1.0 / 8192;           // quantisation of positions in the world; halved distance is the largest error
  int color_threshold = 4;  // a single colour is sent again when a channel moved by more than this (of 255)
};

// What the atlas of a frame holds.
struct Shown {
  std::span<const atlas::Placement> placements;  // sorted by patch and part
  std::span<const uint32_t>
      colors;  // 0xBBGGRR, one for each placement of kind color, in their order (shading::Gather)
};

// Per session. Not thread-safe.
class MetaBuilder {
 public:
  MetaBuilder(const scene::Scene& scene, const MetaSettings& settings);
  ~MetaBuilder();

  // `transforms`: the instances' world matrices. The first frame has full_state.
  geometry_compression::MetaFrame build(FrameNumber frame, const atlas::LayoutDelta& delta,
                                        const Shown& shown, std::span<const dmat4> transforms);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera::server
