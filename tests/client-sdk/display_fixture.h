// Small scenes and atlases to draw, and the pictures that come out.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <memory>
#include <utility>
#include <vector>

#include "base/view.h"
#include "client-sdk/display.h"
#include "client-sdk/scene_store.h"
#include "geometry-compression/meta_frame.h"

namespace tessera::client::test {

constexpr uint32_t kAtlasSide = 32;

struct Rgb {
  int r, g, b;
};

inline Rgb pixel(const Image8& image, uint32_t x, uint32_t y) {
  const uint8_t* p = image.at(x, y);
  return {p[0], p[1], p[2]};
}

inline bool near(Rgb a, Rgb b, int tolerance) {
  return std::abs(a.r - b.r) <= tolerance && std::abs(a.g - b.g) <= tolerance &&
         std::abs(a.b - b.b) <= tolerance;
}

inline std::ostream& operator<<(std::ostream& out, const Rgb& c) {
  return out << c.r << "," << c.g << "," << c.b;
}

inline uint32_t packed(Rgb c) {
  return static_cast<uint32_t>(c.r) | static_cast<uint32_t>(c.g) << 8 | static_cast<uint32_t>(c.b) << 16;
}

inline void fill(Image8& image, uint32_t x0, uint32_t y0, uint32_t width, uint32_t height, Rgb color) {
  for (uint32_t y = y0; y < y0 + height; ++y) {
    for (uint32_t x = x0; x < x0 + width; ++x) {
      uint8_t* p = image.at(x, y);
      p[0] = static_cast<uint8_t>(color.r);
      p[1] = static_cast<uint8_t>(color.g);
      p[2] = static_cast<uint8_t>(color.b);
      p[3] = 255;
    }
  }
}

// Red = 8 x, green = 8 y: a bilinear fetch at texel coordinate t reads 8 (t - 0.5), so pictures tell where
// they sampled.
inline Image8 ramp_atlas() {
  Image8 atlas(kAtlasSide, kAtlasSide);
  for (uint32_t y = 0; y < kAtlasSide; ++y) {
    for (uint32_t x = 0; x < kAtlasSide; ++x)
      fill(atlas, x, y, 1, 1, {static_cast<int>(8 * x), static_cast<int>(8 * y), 0});
  }
  return atlas;
}

struct ObjectFlags {
  bool mirrored = false, double_sided = false, masked = false;
};

// Collects a scene as the server would send it. Positions are multiples of 2^-16 m.
class SceneBuilder {
 public:
  SceneBuilder() {
    meta_.frame = 1;
    meta_.full_state = true;
    meta_.atlas_width = meta_.atlas_height = kAtlasSide;
    meta_.meshes.push_back({.step = 1.0 / 65536});
  }

  uint32_t object(const ObjectFlags& flags = {}, const dvec3& translation = dvec3(0),
                  const vec3& scale = vec3(1)) {
    geometry_compression::Transform transform;
    transform.linear = {scale.x, 0, 0, 0, scale.y, 0, 0, 0, scale.z};
    transform.translation = {translation.x, translation.y, translation.z};
    meta_.objects.push_back({transform, flags.mirrored, flags.double_sided, flags.masked});
    return static_cast<uint32_t>(meta_.objects.size() - 1);
  }

  // Corners in the order of scene::Patch; 3, 4 or 5 of them.
  uint32_t patch(uint32_t object, const std::vector<vec3>& corners) {
    geometry_compression::NewPatch patch{.object = object,
                                         .triangles = static_cast<uint8_t>(corners.size() - 2)};
    for (size_t i = 0; i < corners.size(); ++i) {
      patch.vertices[i] = static_cast<uint32_t>(meta_.vertices.size());
      const vec3 q = glm::round(corners[i] * 65536.0f);
      meta_.vertices.push_back({0, {static_cast<int>(q.x), static_cast<int>(q.y), static_cast<int>(q.z)}});
    }
    meta_.patches.push_back(patch);
    return static_cast<uint32_t>(meta_.patches.size() - 1);
  }

  // A rectangle that faces +Z; u runs right, v up.
  uint32_t rectangle(uint32_t object, float x0, float y0, float x1, float y1, float z) {
    return patch(object, {{x0, y0, z}, {x1, y0, z}, {x0, y1, z}, {x1, y1, z}});
  }
  // Fills a view of 90 degrees from the origin.
  uint32_t screen(uint32_t object) { return rectangle(object, -1, -1, 1, 1, -1); }

  void color(uint32_t patch, Rgb rgb) {
    meta_.placements.push_back(
        {.patch = patch, .kind = geometry_compression::PlacementKind::color, .rgb = packed(rgb)});
  }
  void block(uint32_t patch, uint32_t x, uint32_t y, uint32_t log_w, uint32_t log_h,
             bool transposed = false) {
    meta_.placements.push_back({.patch = patch,
                                .kind = geometry_compression::PlacementKind::block,
                                .x = static_cast<uint16_t>(x),
                                .y = static_cast<uint16_t>(y),
                                .width = static_cast<uint16_t>(1u << log_w),
                                .height = static_cast<uint16_t>(1u << log_h),
                                .transposed = transposed});
  }

  geometry_compression::MetaFrame& meta() { return meta_; }
  SceneState state() const {
    SceneStore store;
    store.apply(meta_);
    return store.state();
  }

 private:
  geometry_compression::MetaFrame meta_;
};

inline View square_view(uint32_t side, const dvec3& position = dvec3(0)) {
  View view;
  view.pose.position = position;
  view.fov = {-1, 1, -1, 1};
  view.width = view.height = side;
  return view;
}

constexpr Rgb kBackground{0, 0, 60};

inline std::unique_ptr<Display> make_display(uint32_t side = 64, uint32_t samples = 4) {
  auto display =
      Display::create({.width = side, .height = side, .samples = samples, .background = {0, 0, 60}});
  if (!display.ok()) {
    ADD_FAILURE() << display.status();
    std::abort();
  }
  return *std::move(display);
}

template <typename Atlas>
Image8 picture_of(Display& display, const SceneState& state, const Atlas& atlas, const View& view) {
  EXPECT_TRUE(display.set_atlas(atlas).ok());
  EXPECT_TRUE(display.set_state(state).ok());
  auto image = display.draw(view);
  EXPECT_TRUE(image.ok()) << image.status();
  return image.ok() ? *std::move(image) : Image8(view.width, view.height);
}

}  // namespace tessera::client::test
