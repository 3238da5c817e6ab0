// An OpenGL ES 3.0 context without a window: surfaceless, on a device, or on the default display with a tiny
// pbuffer, whichever the machine has first.
#pragma once

#include <EGL/egl.h>

#include <memory>

#include "base/status.h"

namespace tessera::client::gles {

class EglContext {
 public:
  static StatusOr<std::unique_ptr<EglContext>> create();
  ~EglContext();
  EglContext(const EglContext&) = delete;
  EglContext& operator=(const EglContext&) = delete;

  // On the thread that created it. Cheap if it is current already.
  Status make_current();

 private:
  EglContext() = default;
  Status open(EGLDisplay display);

  EGLDisplay display_ = EGL_NO_DISPLAY;
  EGLContext context_ = EGL_NO_CONTEXT;
  EGLSurface surface_ = EGL_NO_SURFACE;  // only where the display knows no surfaceless contexts
};

}  // namespace tessera::client::gles
