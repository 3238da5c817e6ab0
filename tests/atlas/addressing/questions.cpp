#include "questions.h"

#include <cmath>
#include <random>

#include "tessellator.h"

namespace tessera::atlas::addressing::test {
namespace {

#include "tests/atlas/addressing/shaders/evaluate.glsl"

constexpr int kSides[] = {2, 3, 5, 8, 13, 32, 64, 100};

class List {
 public:
  void ask(ivec4 n, vec4 x = vec4(0)) { list_.push_back({n, x}); }
  void ask(ivec4 n, vec3 lambda) { ask(n, vec4(lambda, 0)); }
  // Uniform over the triangle.
  vec3 point() {
    const float a = std::sqrt(uniform(0, 1)), b = uniform(0, 1);
    return vec3(1 - a, a * (1 - b), a * b);
  }
  float uniform(float low, float high) { return std::uniform_real_distribution(low, high)(random_); }
  int code() { return std::uniform_int_distribution(0, kRatioCodeMax)(random_); }
  std::vector<Question> take() { return std::move(list_); }

 private:
  std::mt19937 random_{1};
  std::vector<Question> list_;
};

void ask_levels(List& list) {
  for (int count = 3; count <= kMaxTessellationVertices; ++count)
    list.ask(ivec4(count, count % 67 - 2, 0, 0));
}

void ask_texels(List& list) {
  for (int level = 1; level <= kMaxTessellationLevel; ++level)
    for (const vec3& p : perturbed(tessellated(uniform_levels(level)), level, 1)) list.ask(ivec4(level), p);
}

void ask_positions(List& list) {
  for (int level = 1; level <= kMaxTessellationLevel; ++level)
    for (int i = 0; i < 1000; ++i) list.ask(ivec4(level), list.point());
}

void ask_pair_texels(List& list) {
  for (int level = 1; level <= kMaxTessellationLevel; ++level) {
    const ivec2 size = l_pair_size(level);
    for (int y = 0; y < size.y; ++y)
      for (int x = 0; x < size.x; ++x) list.ask(ivec4(level, x, y, 0));
  }
}

void ask_pair_positions(List& list) {
  for (int level = 1; level <= kMaxTessellationLevel; ++level) {
    for (int i = 0; i < 32; ++i) {
      const float x = list.uniform(0, static_cast<float>(level));
      list.ask(ivec4(level, i % 2, i % (level + 1), level / (i + 1)), vec4(x, level - x, 0, 0));
    }
  }
}

// Every count of samples; of the larger ones every so manyth vertex, others for each count.
void ask_ids(List& list) {
  constexpr size_t kVertices = 70;
  for (int count = 3; count <= kMaxTessellationVertices; ++count) {
    const TessellationLevels levels = tessellation_levels(count);
    const std::vector<vec3> points = perturbed(tessellated(levels), levels.inner, 1);
    const size_t step = std::max<size_t>(1, points.size() / kVertices);
    for (size_t i = static_cast<size_t>(count) % step; i < points.size(); i += step)
      list.ask(ivec4(levels.outer, levels.inner), points[i]);
  }
}

void ask_staircases(List& list) {
  for (const ivec2& size : {ivec2(1, 1), ivec2(1, 9), ivec2(3, 3), ivec2(6, 17), ivec2(31, 64),
                            ivec2(37, 160), ivec2(100, 101), ivec2(127, 500), ivec2(128, 1024)})
    for (int id = 0; id < staircase_samples(size); ++id) list.ask(ivec4(id, size, 0));
}

void ask_perspective(List& list) {
  for (int i = 0; i < 20000; ++i) list.ask(ivec4(list.code(), list.code(), 0, 0), list.point());
}

void ask_ratios(List& list) {
  for (int code = -1; code <= 255; ++code) {
    for (int i = 0; i < 10; ++i) {
      // Near the middle of a code, since what lies between two may become either.
      const float exponent = static_cast<float>(code - kRatioCodeOne) + list.uniform(-0.45f, 0.45f);
      list.ask(ivec4(code), vec4(std::exp2(exponent / kRatioCodesPerOctave), 0, 0, 0));
    }
  }
}

void ask_blocks(List& list) {
  for (const int w : kSides) {
    for (const int h : kSides) {
      for (int flags = 0; flags < 32; ++flags) {
        if ((flags & 3) == 0) continue;  // no triangles
        for (int i = 0; i < 48; ++i) {
          const int x = static_cast<int>(list.uniform(0, w - 0.5f)),
                    y = static_cast<int>(list.uniform(0, h - 0.5f));
          list.ask(ivec4(flags, w, h, x | y << 10));
        }
      }
    }
  }
}

void ask_corners(List& list) {
  for (const int w : kSides)
    for (const int h : kSides)
      for (int count = 1; count <= 3; ++count)
        for (int corner = 0; corner < 3 * count; ++corner)
          list.ask(ivec4(count, corner / 3, corner % 3, 0), vec4(w - 1, h - 1, 0, 0));
}

void ask_samples(List& list) {
  for (int level = 1; level <= kMaxTessellationLevel; ++level)
    for (int i = 0; i < l_samples(level); ++i) list.ask(ivec4(level, i, 0, 0));
}

void ask_split_points(List& list) {
  for (int n = 1; n <= kMaxSplits; ++n)
    for (int i = 0; i < 300; ++i) list.ask(ivec4(n), list.point());
}

void ask_split_places(List& list) {
  for (int n = 1; n <= kMaxSplits; ++n)
    for (int i = 0; i < n * n; ++i) list.ask(ivec4(n, i, 0, 0));
}

void ask_pair_places(List& list) {
  for (int level = 1; level <= kMaxTessellationLevel; ++level)
    for (int i = 0; i < 60; ++i) list.ask(ivec4(level, i, 6 * i, 80));
}

void ask_half_texels(List& list) {
  for (int i = 0; i < 2000; ++i) list.ask(ivec4(i % 2, 1 + i % 128, 1 + i % 1000, i % 90 | (i % 70) << 7));
}

// Intervals along and across, the most and the fewest among them.
struct HalfSize {
  int across, along;
};
HalfSize half_size(List& list, int i) {
  const auto some = [&](int most) {
    return 1 + static_cast<int>(list.uniform(0, 1) * static_cast<float>(most - 1));
  };
  return {i % 8 == 0   ? kMaxHalfWidth
          : i % 8 == 1 ? 1
                       : some(kMaxHalfWidth),
          i % 8 < 3    ? kMaxHalfLength
          : i % 8 == 3 ? 1
                       : some(kMaxHalfLength)};
}

void ask_half_points(List& list) {
  for (int foot = 0; foot < 64; ++foot) {
    for (int i = 0; i < 500; ++i) {
      const HalfSize size = half_size(list, i);
      const vec3 p = list.point();
      list.ask(ivec4(foot, size.across, size.along, i / 8 % 2), vec4(p.y, p.z, 0, 0));
    }
  }
}

void ask_half_weights(List& list) {
  for (int foot = 0; foot < 64; ++foot) {
    for (int i = 0; i < 500; ++i) {
      const HalfSize size = half_size(list, i);
      const ivec2 stairs = half_staircase(size.across, size.along);
      const auto samples = static_cast<float>(staircase_samples(stairs) - 1);
      const ivec2 at = staircase_position(static_cast<int>(list.uniform(0, samples)), stairs);
      list.ask(ivec4(foot, size.across, size.along, at.x | at.y << 8 | i / 8 % 2 << 19),
               vec4(i / 16 % 2, 0, 0, 0));
    }
  }
}

}  // namespace

int function_count() {
  return kFunctions;
}

const char* function_name(int function) {
  constexpr const char* kNames[kFunctions] = {
      "levels",          "l_texels",     "l_position", "l_pair_owner", "l_pair_position",
      "oversampling_id", "staircase",    "to_surface", "to_grid",      "ratio_code",
      "block_point",     "block_corner", "l_sample",   "split_point",  "split_place",
      "l_pair_place",    "half_texel",   "half_point", "half_weights"};
  return kNames[function];
}

std::vector<Question> questions(int function) {
  using Ask = void (*)(List&);
  constexpr Ask kAsk[kFunctions] = {ask_levels,         ask_texels,       ask_positions,    ask_pair_texels,
                                    ask_pair_positions, ask_ids,          ask_staircases,   ask_perspective,
                                    ask_perspective,    ask_ratios,       ask_blocks,       ask_corners,
                                    ask_samples,        ask_split_points, ask_split_places, ask_pair_places,
                                    ask_half_texels,    ask_half_points,  ask_half_weights};
  List list;
  kAsk[function](list);
  return list.take();
}

std::vector<Question> answered(int function, const std::vector<Question>& questions) {
  std::vector<Question> answers;
  for (const Question& q : questions) {
    const Answer a = evaluate(function, q.n, q.x);
    answers.push_back({a.n, a.x});
  }
  return answers;
}

}  // namespace tessera::atlas::addressing::test
