// Draws a scene's state with its atlas, at any pose, in the OpenGL ES 3.0 context that is current: an app's,
// or Display's own. One record a primitive, no vertex buffers: texelFetch(records, gl_VertexID / 3).
#pragma once

#include <array>
#include <cstdint>
#include <memory>

#include "base/image.h"
#include "base/status.h"
#include "base/view.h"
#include "base/yuv.h"
#include "client-sdk/lens.h"
#include "client-sdk/scene_state.h"

namespace tessera::client {

constexpr std::array<uint8_t, 3> kDefaultBackground{135, 168, 205};  // sRGB

// The corner of a framebuffer that a view is drawn into; the view has its size.
struct DrawTarget {
  uint32_t framebuffer = 0;  // its OpenGL name; 0: the default framebuffer
  int x = 0, y = 0;          // of the lower left pixel
};

// Every call needs the context in which it was created, the destructor too, and leaves that context's state
// as it was. An OpenGL error that was pending before a call is named as the app's.
class Drawer {
 public:
  static StatusOr<std::unique_ptr<Drawer>> create(const std::array<uint8_t, 3>& background);
  ~Drawer();

  // Uploads what changed since the last call with the same object. `atlas` is converted to RGB on the device,
  // chroma replicated (never filtered across blocks).
  Status set_atlas(const YuvView& atlas);
  Status set_atlas(const Image8& atlas);  // uncoded, for the harness
  Status set_state(const SceneState& state);

  // Fills the view's rectangle of the target: the background where nothing else is, and before the first
  // state. FailedPrecondition: the target is incomplete or lacks colour or, without a lens, depth. Its depth
  // is overwritten and means nothing to others.
  Status draw(const View& view, const DrawTarget& target);
  // The same by way of a texture of its own (thesis 7.1.6).
  Status draw(const View& view, const DrawTarget& target, const LensDistortion& lens);

 private:
  struct Impl;
  explicit Drawer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera::client
