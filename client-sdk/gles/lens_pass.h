// Shows a picture so that it looks undistorted through a lens: for each pixel and colour, the picture where
// the lens will show it; black beyond its edges.
#pragma once

#include "base/view.h"
#include "client-sdk/gles/gl.h"
#include "client-sdk/lens.h"

namespace tessera::client::gles {

class LensPass {
 public:
  static StatusOr<LensPass> create();

  // `picture` covers the tangents `fov`. Over the viewport of the bound framebuffer; `srgb_target`: see
  // TargetKind.
  Status draw(const Texture& picture, const Fov& fov, const LensDistortion& lens, bool srgb_target);

 private:
  LensPass() = default;

  Program program_;
  // Uniform locations.
  GLint screen_ = -1, drawn_ = -1, red_ = -1, green_ = -1, blue_ = -1, srgb_target_ = -1;
  VertexArray no_attributes_;
};

}  // namespace tessera::client::gles
