#include "client-sdk/display.h"

#include <utility>

#include "client-sdk/gles/egl_context.h"
#include "client-sdk/gles/offscreen_target.h"

namespace tessera::client {

struct Display::Impl {
  DisplaySettings settings;
  std::unique_ptr<gles::EglContext> context;  // outlives the objects below
  gles::OffscreenTarget target;
  std::unique_ptr<Drawer> drawer;

  ~Impl() {
    // Objects are deleted in the current context, which may be another display's.
    const Status status = context->make_current();
    (void)status;
  }
};

Display::Display(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Display::~Display() = default;

StatusOr<std::unique_ptr<Display>> Display::create(const DisplaySettings& settings) {
  TESSERA_ASSIGN_OR_RETURN(auto context, gles::EglContext::create());
  TESSERA_ASSIGN_OR_RETURN(auto target,
                           gles::OffscreenTarget::create(settings.width, settings.height, settings.samples));
  TESSERA_ASSIGN_OR_RETURN(auto drawer, Drawer::create(settings.background));
  return std::unique_ptr<Display>(new Display(
      std::unique_ptr<Impl>(new Impl{settings, std::move(context), std::move(target), std::move(drawer)})));
}

Status Display::set_atlas(const YuvView& atlas) {
  TESSERA_RETURN_IF_ERROR(impl_->context->make_current());
  return impl_->drawer->set_atlas(atlas);
}

Status Display::set_atlas(const Image8& atlas) {
  TESSERA_RETURN_IF_ERROR(impl_->context->make_current());
  return impl_->drawer->set_atlas(atlas);
}

Status Display::set_state(const SceneState& state) {
  TESSERA_RETURN_IF_ERROR(impl_->context->make_current());
  return impl_->drawer->set_state(state);
}

StatusOr<Image8> Display::draw(const View& view) {
  const DisplaySettings& settings = impl_->settings;
  if (view.width != settings.width || view.height != settings.height) {
    return absl::InvalidArgumentError(absl::StrCat("the view is ", view.width, "x", view.height,
                                                   " pixels, but the display was made for ", settings.width,
                                                   "x", settings.height));
  }
  TESSERA_RETURN_IF_ERROR(impl_->context->make_current());
  TESSERA_RETURN_IF_ERROR(impl_->drawer->draw(view, {.framebuffer = impl_->target.framebuffer()}));
  return impl_->target.read_back();
}

StatusOr<Display::StereoImage> Display::draw_stereo(const View& left, const View& right) {
  StereoImage image;
  TESSERA_ASSIGN_OR_RETURN(image.left, draw(left));
  TESSERA_ASSIGN_OR_RETURN(image.right, draw(right));
  return image;
}

std::string Display::renderer() const {
  if (!impl_->context->make_current().ok()) return "";
  const GLubyte* name = glGetString(GL_RENDERER);
  return name == nullptr ? "" : reinterpret_cast<const char*>(name);
}

}  // namespace tessera::client
