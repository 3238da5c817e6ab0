#include "client-sdk/gles/egl_context.h"

#include <EGL/eglext.h>

#include <string>
#include <utility>
#include <vector>

namespace tessera::client::gles {
namespace {

bool has_extension(const char* list, const char* name) {
  return list != nullptr &&
         absl::StrCat(" ", list, " ").find(absl::StrCat(" ", name, " ")) != std::string::npos;
}

Status error(const char* call) {
  return absl::UnavailableError(absl::StrFormat("%s failed with EGL error 0x%04x", call, eglGetError()));
}

struct Candidate {
  const char* name;
  EGLDisplay display;
};

std::vector<EGLDisplay> device_displays() {
  const auto query_devices =
      reinterpret_cast<PFNEGLQUERYDEVICESEXTPROC>(eglGetProcAddress("eglQueryDevicesEXT"));
  EGLDeviceEXT devices[16];
  EGLint count = 0;
  if (query_devices == nullptr || !query_devices(16, devices, &count)) return {};
  std::vector<EGLDisplay> displays;
  for (EGLint i = 0; i < count; ++i) {
    displays.push_back(eglGetPlatformDisplay(EGL_PLATFORM_DEVICE_EXT, devices[i], nullptr));
  }
  return displays;
}

std::vector<Candidate> candidates() {
  const char* extensions = eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
  std::vector<Candidate> list;
  if (has_extension(extensions, "EGL_MESA_platform_surfaceless")) {
    list.push_back(
        {"surfaceless", eglGetPlatformDisplay(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr)});
  }
  if (has_extension(extensions, "EGL_EXT_platform_device")) {
    for (EGLDisplay display : device_displays()) list.push_back({"device", display});
  }
  list.push_back({"default", eglGetDisplay(EGL_DEFAULT_DISPLAY)});
  return list;
}

}  // namespace

StatusOr<std::unique_ptr<EglContext>> EglContext::create() {
  std::string failures;
  for (const Candidate& candidate : candidates()) {
    if (candidate.display == EGL_NO_DISPLAY) continue;
    std::unique_ptr<EglContext> context(new EglContext);
    const Status status = context->open(candidate.display);
    if (status.ok()) return context;
    absl::StrAppend(&failures, failures.empty() ? "" : "; ", candidate.name, " display: ", status.message());
  }
  return absl::UnavailableError(
      absl::StrCat("no OpenGL ES 3.0 context (", failures,
                   "). Install a driver, e.g. the packages libegl1 and libgl1-mesa-dri"));
}

Status EglContext::open(EGLDisplay display) {
  if (!eglInitialize(display, nullptr, nullptr)) return error("eglInitialize");
  display_ = display;
  if (!eglBindAPI(EGL_OPENGL_ES_API)) return error("eglBindAPI");
  const bool surfaceless =
      has_extension(eglQueryString(display, EGL_EXTENSIONS), "EGL_KHR_surfaceless_context");
  const EGLint config_attributes[] = {EGL_RENDERABLE_TYPE, EGL_OPENGL_ES3_BIT, EGL_SURFACE_TYPE,
                                      surfaceless ? 0 : EGL_PBUFFER_BIT, EGL_NONE};
  EGLConfig config = nullptr;
  EGLint count = 0;
  if (!eglChooseConfig(display, config_attributes, &config, 1, &count) || count == 0)
    return error("eglChooseConfig");
  const EGLint context_attributes[] = {EGL_CONTEXT_MAJOR_VERSION, 3, EGL_CONTEXT_MINOR_VERSION, 0, EGL_NONE};
  context_ = eglCreateContext(display, config, EGL_NO_CONTEXT, context_attributes);
  if (context_ == EGL_NO_CONTEXT) return error("eglCreateContext");
  if (!surfaceless) {
    const EGLint surface_attributes[] = {EGL_WIDTH, 1, EGL_HEIGHT, 1, EGL_NONE};
    surface_ = eglCreatePbufferSurface(display, config, surface_attributes);
    if (surface_ == EGL_NO_SURFACE) return error("eglCreatePbufferSurface");
  }
  return make_current();
}

Status EglContext::make_current() {
  if (eglGetCurrentContext() == context_) return absl::OkStatus();
  if (!eglMakeCurrent(display_, surface_, surface_, context_)) return error("eglMakeCurrent");
  return absl::OkStatus();
}

EglContext::~EglContext() {
  if (display_ == EGL_NO_DISPLAY) return;
  if (eglGetCurrentContext() == context_)
    eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
  if (surface_ != EGL_NO_SURFACE) eglDestroySurface(display_, surface_);
  if (context_ != EGL_NO_CONTEXT) eglDestroyContext(display_, context_);
  // No eglTerminate: a display is one for the whole process, and other contexts may live on it.
}

}  // namespace tessera::client::gles
