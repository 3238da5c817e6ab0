#include "scene/procedural/textures.h"

#include <algorithm>
#include <cmath>
#include <functional>

namespace tessera::scene {
namespace {

constexpr uint32_t kSide = 256;

uint32_t hash(uint32_t x, uint32_t y, uint32_t seed) {
  uint32_t h = x * 0x9E3779B1u ^ y * 0x85EBCA77u ^ seed * 0xC2B2AE3Du;
  h = (h ^ (h >> 15)) * 0x2C1B3C6Du;
  h = (h ^ (h >> 12)) * 0x297A2D39u;
  return h ^ (h >> 15);
}

float lattice(int x, int y, int period, uint32_t seed) {
  const auto wrap = [&](int i) { return static_cast<uint32_t>(((i % period) + period) % period); };
  return static_cast<float>(hash(wrap(x), wrap(y), seed) & 0xffffff) / static_cast<float>(0xffffff);
}

// Value noise in 0..1 that repeats after `period` cells; u, v in 0..1 span one repeat.
float noise(float u, float v, int period, uint32_t seed) {
  const float x = u * static_cast<float>(period), y = v * static_cast<float>(period);
  const int i = static_cast<int>(std::floor(x)), j = static_cast<int>(std::floor(y));
  const auto smooth = [](float t) { return t * t * (3 - 2 * t); };
  const float s = smooth(x - static_cast<float>(i)), t = smooth(y - static_cast<float>(j));
  return glm::mix(glm::mix(lattice(i, j, period, seed), lattice(i + 1, j, period, seed), s),
                  glm::mix(lattice(i, j + 1, period, seed), lattice(i + 1, j + 1, period, seed), s), t);
}

float fractal(float u, float v, int period, int octaves, uint32_t seed) {
  float sum = 0, weight = 0.5f, total = 0;
  for (int o = 0; o < octaves; ++o, period *= 2, weight *= 0.5f) {
    sum += weight * noise(u, v, period, seed + static_cast<uint32_t>(o));
    total += weight;
  }
  return sum / total;
}

struct Texel {
  vec3 color{0.5f};  // linear
  float height = 0;  // of the texture's width
  float roughness = 1, metallic = 0, alpha = 1;
};
using Pattern = std::function<Texel(float u, float v)>;

uint8_t to_byte(float x) {
  return static_cast<uint8_t>(std::clamp(x, 0.f, 1.f) * 255.f + 0.5f);
}

float to_srgb(float x) {
  return x <= 0.0031308f ? 12.92f * x : 1.055f * std::pow(x, 1 / 2.4f) - 0.055f;
}

Texture blank(const std::string& name, bool srgb) {
  return {name, kSide, kSide, std::vector<uint8_t>(size_t{4} * kSide * kSide), srgb};
}

void set(Texture& texture, uint32_t x, uint32_t y, vec4 value) {
  for (int c = 0; c < 4; ++c)
    texture.rgba[size_t{4} * (y * kSide + x) + static_cast<size_t>(c)] = to_byte(value[c]);
}

std::vector<Texel> evaluate(const Pattern& pattern) {
  std::vector<Texel> texels;
  texels.reserve(size_t{kSide} * kSide);
  for (uint32_t y = 0; y < kSide; ++y) {
    for (uint32_t x = 0; x < kSide; ++x) {
      texels.push_back(
          pattern((static_cast<float>(x) + 0.5f) / kSide, (static_cast<float>(y) + 0.5f) / kSide));
    }
  }
  return texels;
}

vec4 color_of(const Texel& t) {
  return vec4(to_srgb(t.color.r), to_srgb(t.color.g), to_srgb(t.color.b), t.alpha);
}

Texture make_color(const std::string& name, const Pattern& pattern) {
  Texture texture = blank(name, true);
  const std::vector<Texel> texels = evaluate(pattern);
  for (uint32_t i = 0; i < texels.size(); ++i) set(texture, i % kSide, i / kSide, color_of(texels[i]));
  return texture;
}

Surface make_surface(const std::string& name, const Pattern& pattern) {
  Surface surface{make_color(name, pattern), blank(name + " normal", false),
                  blank(name + " roughness", false)};
  const std::vector<Texel> texels = evaluate(pattern);
  const auto height = [&](uint32_t x, uint32_t y) { return texels[(y % kSide) * kSide + x % kSide].height; };
  for (uint32_t y = 0; y < kSide; ++y) {
    for (uint32_t x = 0; x < kSide; ++x) {
      const float slope_u = 0.5f * kSide * (height(x + 1, y) - height(x + kSide - 1, y));
      const float slope_v = 0.5f * kSide * (height(x, y + 1) - height(x, y + kSide - 1));
      // The map's +Y is up, v runs down.
      const vec3 n = glm::normalize(vec3(-slope_u, slope_v, 1));
      set(surface.normal, x, y, vec4(0.5f * n + 0.5f, 1));
      const Texel& t = texels[y * kSide + x];
      set(surface.metallic_roughness, x, y, vec4(1, t.roughness, t.metallic, 1));
    }
  }
  return surface;
}

// Distance to the border of a running bond of bricks, in rows, and a number that is its own for each brick.
struct Brick {
  float border, shade;
};
Brick brick_at(float u, float v, int columns, int rows, uint32_t seed) {
  const float y = v * static_cast<float>(rows);
  const int row = static_cast<int>(y);
  const float x = u * static_cast<float>(columns) + (row % 2 ? 0.5f : 0.f);
  const int column = static_cast<int>(x) % columns;
  const float fx = x - std::floor(x), fy = y - std::floor(y);
  const float aspect = static_cast<float>(rows) / static_cast<float>(columns);
  return {std::min(std::min(fx, 1 - fx) * aspect, std::min(fy, 1 - fy)), lattice(column, row, 64, seed)};
}

Surface make_bricks(const std::string& name, int columns, int rows, vec3 dark, vec3 light, vec3 joint,
                    float joint_width, uint32_t seed) {
  return make_surface(name, [=](float u, float v) {
    const Brick brick = brick_at(u, v, columns, rows, seed);
    const float grain = fractal(u, v, 16, 4, seed + 1);
    const float inside = glm::smoothstep(0.4f * joint_width, joint_width, brick.border);
    const vec3 face = glm::mix(dark, light, 0.6f * brick.shade + 0.4f * grain);
    return Texel{glm::mix(joint, face, inside), 0.012f * inside + 0.004f * grain,
                 0.95f - 0.25f * inside * brick.shade};
  });
}

}  // namespace

Surface marble_tiles() {
  return make_surface("marble tiles", [](float u, float v) {
    const bool dark = (u < 0.5f) != (v < 0.5f);
    const float fx = std::fmod(2 * u, 1.f), fy = std::fmod(2 * v, 1.f);
    const float joint = glm::smoothstep(0.006f, 0.014f, std::min(std::min(fx, 1 - fx), std::min(fy, 1 - fy)));
    const float cloud = fractal(u, v, 4, 5, dark ? 11 : 23);
    const float vein =
        std::pow(1 - std::abs(2 * fractal(u + 0.13f * cloud, v, 3, 5, dark ? 31 : 37) - 1), 14.f);
    const vec3 face =
        dark ? glm::mix(vec3(0.045f, 0.055f, 0.06f), vec3(0.35f, 0.34f, 0.3f), 0.7f * vein + 0.12f * cloud)
             : glm::mix(vec3(0.74f, 0.7f, 0.63f), vec3(0.4f, 0.36f, 0.32f), 0.6f * vein + 0.2f * cloud);
    return Texel{glm::mix(vec3(0.18f), face, joint), 0.004f * joint,
                 glm::mix(0.9f, 0.16f + 0.25f * cloud, joint)};
  });
}

Surface stone() {
  return make_bricks("stone", 2, 4, vec3(0.34f, 0.3f, 0.24f), vec3(0.6f, 0.54f, 0.44f),
                     vec3(0.26f, 0.23f, 0.19f), 0.06f, 41);
}

Surface brick() {
  return make_bricks("brick", 4, 12, vec3(0.25f, 0.07f, 0.045f), vec3(0.48f, 0.17f, 0.1f),
                     vec3(0.42f, 0.4f, 0.37f), 0.12f, 53);
}

Surface roof_tiles() {
  return make_bricks("roof tiles", 8, 8, vec3(0.16f, 0.05f, 0.04f), vec3(0.36f, 0.12f, 0.08f),
                     vec3(0.06f, 0.03f, 0.03f), 0.16f, 61);
}

Surface plaster() {
  return make_surface("plaster", [](float u, float v) {
    const float rough = fractal(u, v, 8, 5, 71), stain = fractal(u, v, 2, 3, 79);
    return Texel{glm::mix(vec3(0.66f, 0.6f, 0.5f), vec3(0.8f, 0.76f, 0.68f), 0.5f * rough + 0.5f * stain),
                 0.02f * rough, 0.82f + 0.15f * rough};
  });
}

Surface wood() {
  return make_surface("wood", [](float u, float v) {
    const float plank = std::floor(4 * u), edge = std::abs(4 * u - plank - 0.5f) * 2;
    const float bend = fractal(u, v, 2, 3, 83 + static_cast<uint32_t>(plank));
    const float ring = 0.5f + 0.5f * std::sin(kSide * 0.1f * (4 * u + 1.5f * bend));
    const float fibre = noise(u, v, 64, 89) * 0.3f;
    const float joint = 1 - glm::smoothstep(0.93f, 0.985f, edge);
    return Texel{joint * glm::mix(vec3(0.2f, 0.09f, 0.035f), vec3(0.42f, 0.22f, 0.09f),
                                  glm::clamp(0.7f * ring + fibre, 0.f, 1.f)),
                 0.006f * joint + 0.002f * ring, 0.45f + 0.25f * ring};
  });
}

Surface brushed_metal() {
  return make_surface("brushed metal", [](float u, float v) {
    const float scratch = 0.5f * noise(u, v, 128, 97) + 0.5f * fractal(u, v, 4, 4, 101);
    return Texel{vec3(0.9f, 0.88f, 0.85f), 0.0015f * scratch, 0.18f + 0.3f * scratch, 1};
  });
}

Surface asphalt() {
  return make_surface("asphalt", [](float u, float v) {
    const float grain = fractal(u, v, 64, 2, 103), patch = fractal(u, v, 2, 3, 107);
    return Texel{vec3(0.05f + 0.06f * grain + 0.05f * patch), 0.004f * grain, 0.95f};
  });
}

Texture leaf_mask() {
  return make_color("leaf", [](float u, float v) {
    const float x = 2 * u - 1, along = 1 - v;  // the stalk is at the bottom
    const float half =
        0.9f * std::pow(std::sin(0.5f * 6.2831853f * glm::clamp(0.94f * along + 0.03f, 0.f, 1.f)), 0.8f) *
        (1 - 0.35f * along);
    const float rib =
        std::abs(x) < 0.03f ? 1.f : std::pow(0.5f + 0.5f * std::cos(40 * (along - 0.5f * std::abs(x))), 12.f);
    const float tone = fractal(u, v, 4, 4, 109);
    return Texel{glm::mix(vec3(0.035f, 0.14f, 0.02f), vec3(0.13f, 0.3f, 0.06f), 0.5f * rib + 0.5f * tone), 0,
                 1, 0, std::abs(x) < half ? 1.f : 0.f};
  });
}

Texture foliage_mask() {
  return make_color("foliage", [](float u, float v) {
    constexpr int kCells = 9;
    float best = 0, shade = 0;
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        const int i = static_cast<int>(u * kCells) + dx, j = static_cast<int>(v * kCells) + dy;
        const vec2 center((static_cast<float>(i) + lattice(i, j, kCells, 113)) / kCells,
                          (static_cast<float>(j) + lattice(i, j, kCells, 127)) / kCells);
        const float angle = 6.2831853f * lattice(i, j, kCells, 131);
        const vec2 d = (vec2(u, v) - center) * static_cast<float>(kCells);
        const vec2 turned(std::cos(angle) * d.x + std::sin(angle) * d.y,
                          std::cos(angle) * d.y - std::sin(angle) * d.x);
        const float inside = 1 - std::abs(turned.x) / 0.75f - turned.y * turned.y / 0.12f;
        if (inside > best) best = inside, shade = lattice(i, j, kCells, 137);
      }
    }
    const float disc = glm::length(vec2(u, v) - 0.5f) < 0.46f + 0.04f * noise(u, v, 8, 139) ? 1.f : 0.f;
    return Texel{glm::mix(vec3(0.03f, 0.1f, 0.015f), vec3(0.16f, 0.3f, 0.05f), shade), 0, 1, 0,
                 best > 0.15f ? disc : 0.f};
  });
}

Texture chain_link_mask() {
  return make_color("chain link", [](float u, float v) {
    const auto wire = [](float t) { return std::abs(std::fmod(t + 8, 1.f) - 0.5f); };
    const float a = wire(4 * (u + v)), b = wire(4 * (u - v));
    const float near = std::min(a, b);
    return Texel{vec3(0.5f + 0.3f * (near < 0.04f ? 1.f : 0.f)), 0, 0.4f, 1, near < 0.085f ? 1.f : 0.f};
  });
}

}  // namespace tessera::scene
