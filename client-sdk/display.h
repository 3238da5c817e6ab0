// Draws a SceneState with its atlas at the newest pose: EGL surfaceless, OpenGL ES 3.0, 4x MSAA, record per
// primitive (no vertex buffers: texelFetch(records, gl_VertexID / 3)).
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <optional>
#include <string>

#include "base/image.h"
#include "base/status.h"
#include "base/view.h"
#include "base/yuv.h"
#include "client-sdk/scene_state.h"

namespace tessera::client {

struct DisplaySettings {
  uint32_t width = 960, height = 540;  // of one eye
  uint32_t samples = 4;
  std::array<uint8_t, 3> background{135, 168, 205};  // sRGB
};

// Owns an EGL context; use it from the thread that created it. Several displays may share a thread.
class Display {
 public:
  static StatusOr<std::unique_ptr<Display>> create(const DisplaySettings& settings);
  ~Display();

  // Uploads what changed since the last call with the same object. `atlas` is converted to RGB on the device,
  // chroma replicated (never filtered across blocks).
  Status set_atlas(const YuvView& atlas);
  Status set_atlas(const Image8& atlas);  // uncoded, for the harness
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
