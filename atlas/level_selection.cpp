#include "atlas/level_selection.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

namespace tessera::atlas {
namespace {

constexpr float kMaxSidePx = 1e6f;  // beyond any screen; keeps the products below finite
constexpr float kMaxElongation = 65536.0f;

// NaN and negative values count as 0.
float sane(float value, float max) {
  return value > 0 ? std::min(value, max) : 0.0f;
}

// Valid in (-64, 64).
int round_to_int(float value) {
  return static_cast<int>(value + 64.5f) - 64;
}

// The nearest integer of the same parity as `like`.
int round_to_parity(float value, int like) {
  const int odd = like & 1;
  return odd + 2 * round_to_int(0.5f * (value - static_cast<float>(odd)));
}

// A and a of eq. 3.2, for the colour part of a block. The aspect has a sign: < 0 = the u axis runs down.
struct Shape {
  int area = 0, aspect = 0;
};

int min_area(bool masked, int max_log) {
  return masked ? std::min(2 * kMinLog, 2 * max_log - 1) : 2 * kMinLog;
}
int max_area(bool masked, int max_log) {
  return masked ? 2 * max_log - 1 : 2 * max_log;
}

// The largest aspect that a block of this area can have between the shortest and the longest side; has the
// area's parity.
int max_aspect(int area, bool masked, int max_log) {
  if (masked && area == max_area(masked, max_log)) return 1;  // half of the largest square
  const int max_width = masked ? max_log - 1 : max_log;
  return std::min(area - 2 * kMinLog, 2 * max_width - area);
}

LevelWish wish_of(Shape shape, bool masked, int max_log) {
  int width = (shape.area + std::abs(shape.aspect)) / 2;
  int height = (shape.area - std::abs(shape.aspect)) / 2;
  if (masked) (width < max_log ? width : height) += 1;  // room for coverage
  return {false, {static_cast<uint8_t>(width), static_cast<uint8_t>(height)}, shape.aspect < 0};
}

Shape shape_of(const LevelWish& wish, bool masked) {
  int width = wish.level.log_w, height = wish.level.log_h;
  if (masked) (width > height ? width : height) -= 1;
  return {width + height, wish.transposed ? height - width : width - height};
}

// Texels of the block for a biased area, given as its logarithm; 0 = single colour.
double block_texels(float area_log, float color_log, float max_area_log) {
  if (area_log < color_log) return 0;
  const float clamped = std::clamp(area_log, static_cast<float>(2 * kMinLog), max_area_log);
  return static_cast<double>(uint64_t{1} << static_cast<int>(clamped + 0.5f));
}

// Ideal areas, counted in bins that are linear within an octave: a float's exponent and leading mantissa
// bits.
class AreaHistogram {
 public:
  explicit AreaHistogram(std::span<const float> areas) {
    for (const float area : areas) {
      if (area > 0) ++counts_[bin(area)];
    }
  }

  // Texels in use after level selection with `bias` (without hysteresis). Falls as the bias grows.
  double texels(float bias, const LevelSettings& settings) const {
    const float color_log = std::log2(settings.color_area_px2);
    double sum = 0;
    for (int octave = 0; octave < kOctaves; ++octave) {
      for (int step = 0; step < kSteps; ++step) {
        const uint32_t count = counts_[octave * kSteps + step];
        if (count == 0) continue;
        const float area_log = static_cast<float>(kFirstOctave + octave) + step_log_[step];
        sum += count * block_texels(area_log - bias, color_log, 2.0f * settings.max_log);
      }
    }
    return sum;
  }

 private:
  static constexpr int kStepBits = 6, kSteps = 1 << kStepBits;
  static constexpr int kFirstOctave = -8, kOctaves = 64;

  static int bin(float area) {
    constexpr int kMantissaBits = 23, kExponentOfOne = 127;
    constexpr int kFirst = (kExponentOfOne + kFirstOctave) << kStepBits;
    const int index = static_cast<int>(std::bit_cast<uint32_t>(area) >> (kMantissaBits - kStepBits)) - kFirst;
    return std::clamp(index, 0, kOctaves * kSteps - 1);
  }
  // Logarithm of a bin's centre above its octave.
  static std::array<float, kSteps> step_logs() {
    std::array<float, kSteps> logs;
    for (int i = 0; i < kSteps; ++i) logs[i] = std::log2(1 + (static_cast<float>(i) + 0.5f) / kSteps);
    return logs;
  }

  std::array<uint32_t, kOctaves * kSteps> counts_{};
  std::array<float, kSteps> step_log_ = step_logs();
};

}  // namespace

BlockNeed block_need(const scene::Footprint& footprint, const PatchTraits& traits) {
  const float unused = traits.triangle_count == 1 ? 2.0f : 1.0f;
  const float area = unused * sane(footprint.area_px2, kMaxSidePx * kMaxSidePx);
  const float u = sane(footprint.u_px, kMaxSidePx), v = sane(footprint.v_px, kMaxSidePx);
  BlockNeed need{.upright = v > u};
  // Edges that vanish together have no direction.
  if (u > 0 || v > 0) need.elongation = std::min(std::max(u, v) / std::min(u, v), kMaxElongation);
  need.area = (traits.masked ? 2.0f : 1.0f) * area;
  return need;
}

float ideal_area(const scene::Footprint& footprint, const PatchTraits& traits) {
  return block_need(footprint, traits).area;
}

LevelWish select_level(const scene::Footprint& footprint, const PatchTraits& traits, float bias,
                       const LevelWish* previous, const LevelSettings& settings) {
  return select_level(block_need(footprint, traits), traits.masked, bias, previous, settings);
}

LevelWish select_level(const BlockNeed& need, bool masked, float bias, const LevelWish* previous,
                       const LevelSettings& settings) {
  const float margin = settings.hysteresis;
  const float block_log = std::log2(need.area) - bias;

  float color_log = std::log2(settings.color_area_px2);
  if (previous) color_log += previous->single_color ? margin : -margin;
  if (block_log < color_log) return {.single_color = true};

  const bool anchored = previous && !previous->single_color;
  const Shape before = anchored ? shape_of(*previous, masked) : Shape{};
  const int max_log = settings.max_log;
  const float area_log =
      std::clamp(masked ? block_log - 1 : block_log, static_cast<float>(min_area(masked, max_log)),
                 static_cast<float>(max_area(masked, max_log)));
  Shape shape{.area = round_to_int(area_log)};
  if (anchored && std::abs(area_log - static_cast<float>(before.area)) <= 0.5f + margin)
    shape.area = before.area;

  // Sides that would leave the range keep the area, so that its sum can be foretold.
  const float limit = static_cast<float>(max_aspect(shape.area, masked, max_log));
  const float elongation_log = std::min(std::log2(need.elongation), limit);
  const float aspect_log = need.upright ? -elongation_log : elongation_log;
  shape.aspect = round_to_parity(aspect_log, shape.area);
  // Aspects of one parity are two apart: so is the share of the border that the margin covers.
  if (anchored && before.area == shape.area &&
      std::abs(aspect_log - static_cast<float>(before.aspect)) <= 1 + 2 * margin) {
    shape.aspect = before.aspect;
  }
  return wish_of(shape, masked, max_log);
}

float least_bias(const LevelSettings& settings, const std::function<bool(float)>& fits, float near) {
  constexpr float kStep = 1.0f / 64;
  const auto bias_at = [&](int i) {
    return std::min(settings.max_bias, settings.min_bias + kStep * static_cast<float>(i));
  };
  int too_small = -1;
  int enough = static_cast<int>(std::ceil((settings.max_bias - settings.min_bias) / kStep));
  int at = static_cast<int>(std::clamp((near - settings.min_bias) / kStep, 0.0f, static_cast<float>(enough)));
  const bool down = fits(bias_at(at));
  (down ? enough : too_small) = at;
  // Steps away from the guess, each twice as long as the last, until the result lies between two of them.
  for (int step = 1; enough - too_small > 1; step *= 2) {
    at = std::clamp(at + (down ? -step : step), too_small + 1, enough - 1);
    const bool fit = fits(bias_at(at));
    (fit ? enough : too_small) = at;
    if (fit != down) break;
  }
  while (enough - too_small > 1) {
    const int middle = (too_small + enough) / 2;
    (fits(bias_at(middle)) ? enough : too_small) = middle;
  }
  return bias_at(enough);
}

float select_bias(std::span<const float> ideal_areas, double target_texels, const LevelSettings& settings) {
  const AreaHistogram histogram(ideal_areas);
  const auto fits = [&](float bias) { return histogram.texels(bias, settings) <= target_texels; };
  return least_bias(settings, fits);
}

float BiasFollower::follow(float needed) {
  constexpr float kSlack = 0.25f;     // the bias may be this much larger than needed
  constexpr float kStep = 1.0f / 16;  // and falls this much a frame beyond
  if (!has_bias_ || needed > bias_) {
    bias_ = needed;
  } else if (needed + kSlack < bias_) {
    bias_ = std::max(needed + kSlack, bias_ - kStep);
  }
  has_bias_ = true;
  return bias_;
}

void AdaptiveTarget::on_out_of_memory() {
  constexpr double kShrink = 0.92, kMinShare = 0.25;
  share_ = std::max(kMinShare, share_ * kShrink);
  quiet_frames_ = 0;
}

void AdaptiveTarget::on_quiet_frame() {
  constexpr double kGrowth = 0.01, kMaxShare = 0.95;
  if (++quiet_frames_ < patience_frames_) return;
  share_ = std::min(kMaxShare, share_ + kGrowth);
  quiet_frames_ = 0;
}

}  // namespace tessera::atlas
