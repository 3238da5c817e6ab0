// A display without a window: Drawer in an OpenGL ES 3.0 context of its own, and pictures on the CPU.
#pragma once

#include <array>
#include <memory>
#include <string>

#include "base/image.h"
#include "base/status.h"
#include "base/view.h"
#include "base/yuv.h"
#include "client-sdk/drawer.h"
#include "client-sdk/scene_state.h"

namespace tessera::client {

struct DisplaySettings {
  uint32_t width = 960, height = 540;  // of one eye
  uint32_t samples = 4;
  std::array<uint8_t, 3> background = kDefaultBackground;  // sRGB
};

// Owns an EGL context; use it from the thread that created it. Several displays may share a thread.
class Display {
 public:
  static StatusOr<std::unique_ptr<Display>> create(const DisplaySettings& settings);
  ~Display();

  // See Drawer.
  Status set_atlas(const YuvView& atlas);
  Status set_atlas(const Image8& atlas);
  Status set_state(const SceneState& state);

  // `view` has the size given in the settings. Draws it into an offscreen framebuffer and reads it back.
  StatusOr<Image8> draw(const View& view);
  struct StereoImage {
    Image8 left, right;
  };
  // Two views of the same pair.
  StatusOr<StereoImage> draw_stereo(const View& left, const View& right);
  std::string renderer() const;  // GL_RENDERER

 private:
  struct Impl;
  explicit Display(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera::client
