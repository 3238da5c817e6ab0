// Block sizes from footprints (thesis 3.5, eqs. 3.2, 3.3): the bias that makes the wish list fit, the
// adaptive target, and hysteresis against flicker between two levels (thesis 8.3).
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "atlas/patch_traits.h"
#include "scene/visible_set.h"

namespace tessera::atlas {

struct LevelSettings {
  uint8_t max_log = 8;  // log2 of the superblock's side
  float hysteresis =
      0.25f;  // in levels of area: a patch changes only when its wish lies this far past the border
  float min_bias = -2.0f;  // negative: the atlas has room for more than one texel a pixel (thesis 4.1)
  float max_bias = 16.0f;
  float color_area_px2 = 1.5f;  // biased area below which a patch becomes a single colour
};

// Binary logarithms of a block's sides in texels; width >= height; kMinLog..log2(superblock side).
struct Level {
  uint8_t log_w = 0, log_h = 0;
  bool operator==(const Level&) const = default;
};
constexpr uint8_t kMinLog = 1;  // 2 texels: a block owns its 4:2:0 chroma samples

struct LevelWish {
  bool single_color = false;
  Level level;
  bool transposed = false;
};

// What a footprint asks for, before bias; both finite.
struct BlockNeed {
  float area =
      0;  // texels: what the triangles need on screen, and the part of the block that they leave unused
  float elongation = 1;  // longer edge : shorter edge
  bool upright = false;  // v is the longer one
};
BlockNeed block_need(const scene::Footprint& footprint, const PatchTraits& traits);

// Ideal block area of a footprint: the area of its block_need().
float ideal_area(const scene::Footprint& footprint, const PatchTraits& traits);

// The level for one patch (eq. 3.2). `previous` (or nullptr) anchors the hysteresis. Total: any finite or
// infinite footprint gives a valid level; NaN counts as 0.
LevelWish select_level(const scene::Footprint& footprint, const PatchTraits& traits, float bias,
                       const LevelWish* previous, const LevelSettings& settings);
LevelWish select_level(const BlockNeed& need, bool masked, float bias, const LevelWish* previous,
                       const LevelSettings& settings);

// The smallest bias in the settings' range at which `fits`, or the largest if it does at none. What is in use
// falls in steps as the bias grows, so that the search is on a fixed grid: the result is monotonic in what
// must fit. `near`: where to look first, such as the result of the last frame.
float least_bias(const LevelSettings& settings, const std::function<bool(float)>& fits, float near = 0);

// Global bias b for `target_texels`: the smallest that fits them. Eq. 3.3, b = log2((I - d) / (S - d)), is
// its value where blocks are not clamped at either end, rounded, or replaced by a colour; here all of that
// counts. Monotonic: a smaller target never gives a smaller bias. Clamped to [min_bias, max_bias].
float select_bias(std::span<const float> ideal_areas, double target_texels, const LevelSettings& settings);

// The bias stays between what is needed and a little more, so that a camera that sways does not move it.
class BiasFollower {
 public:
  // `needed`: of this frame, by select_bias(). Returns the one to use.
  float follow(float needed);

 private:
  float bias_ = 0;
  bool has_bias_ = false;
};

// The target S, calibrated by experience (thesis 3.5): memory that ran out shrinks it, quiet time grows it.
class AdaptiveTarget {
 public:
  // `patience_frames`: so many quiet ones for each hundredth of the atlas that it grows by.
  explicit AdaptiveTarget(double atlas_texels, double share = 0.8, int patience_frames = 90)
      : atlas_texels_(atlas_texels), share_(share), patience_frames_(patience_frames) {}
  double texels() const { return share_ * atlas_texels_; }
  void on_out_of_memory();
  void on_quiet_frame();

 private:
  double atlas_texels_;
  double share_;
  int patience_frames_;
  int quiet_frames_ = 0;
};

}  // namespace tessera::atlas
