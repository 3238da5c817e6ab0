#include "client-sdk/display.h"

#include <cmath>
#include <utility>

#include "client-sdk/gles/atlas_texture.h"
#include "client-sdk/gles/egl_context.h"
#include "client-sdk/gles/offscreen_target.h"
#include "client-sdk/gles/scene_pass.h"

namespace tessera::client {
namespace {

Status check_view(const View& view, const DisplaySettings& settings) {
  if (view.width != settings.width || view.height != settings.height) {
    return absl::InvalidArgumentError(absl::StrCat("the view is ", view.width, "x", view.height,
                                                   " pixels, but the display was made for ", settings.width,
                                                   "x", settings.height));
  }
  const Fov& fov = view.fov;
  if (!(fov.right > fov.left) || !(fov.up > fov.down) || !(view.near_m > 0)) {
    return absl::InvalidArgumentError(absl::StrCat("the view's frustum is empty: tangents ", fov.left, "..",
                                                   fov.right, ", ", fov.down, "..", fov.up, ", near ",
                                                   view.near_m, " m"));
  }
  return absl::OkStatus();
}

}  // namespace

struct Display::Impl {
  DisplaySettings settings;
  std::unique_ptr<gles::EglContext> context;  // outlives the objects below
  gles::OffscreenTarget target;
  gles::AtlasTexture atlas;
  gles::ScenePass scene;

  ~Impl() {
    // Objects are deleted in the current context, which may be another display's.
    const Status status = context->make_current();
    (void)status;
  }
  Status clear_and_draw(const View& view);
};

Display::Display(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Display::~Display() = default;

StatusOr<std::unique_ptr<Display>> Display::create(const DisplaySettings& settings) {
  TESSERA_ASSIGN_OR_RETURN(auto context, gles::EglContext::create());
  TESSERA_ASSIGN_OR_RETURN(auto target,
                           gles::OffscreenTarget::create(settings.width, settings.height, settings.samples));
  TESSERA_ASSIGN_OR_RETURN(auto atlas, gles::AtlasTexture::create());
  TESSERA_ASSIGN_OR_RETURN(auto scene, gles::ScenePass::create(settings.samples > 1));
  return std::unique_ptr<Display>(new Display(std::unique_ptr<Impl>(
      new Impl{settings, std::move(context), std::move(target), std::move(atlas), std::move(scene)})));
}

Status Display::set_atlas(const YuvView& atlas) {
  TESSERA_RETURN_IF_ERROR(impl_->context->make_current());
  return impl_->atlas.set(atlas);
}

Status Display::set_atlas(const Image8& atlas) {
  TESSERA_RETURN_IF_ERROR(impl_->context->make_current());
  return impl_->atlas.set(atlas);
}

Status Display::set_state(const SceneState& state) {
  TESSERA_RETURN_IF_ERROR(impl_->context->make_current());
  return impl_->scene.set_state(state);
}

Status Display::Impl::clear_and_draw(const View& view) {
  target.bind();
  const auto& background = settings.background;
  glColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
  glClearColor(background[0] / 255.0f, background[1] / 255.0f, background[2] / 255.0f, 1.0f);
  glClear(GL_COLOR_BUFFER_BIT);
  // Alpha serves only as coverage; the picture stays opaque.
  glColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_FALSE);
  return scene.draw(view, atlas);
}

StatusOr<Image8> Display::draw(const View& view) {
  TESSERA_RETURN_IF_ERROR(check_view(view, impl_->settings));
  TESSERA_RETURN_IF_ERROR(impl_->context->make_current());
  TESSERA_RETURN_IF_ERROR(impl_->clear_and_draw(view));
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
