#include "client-sdk/drawer.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "client-sdk/gles/atlas_texture.h"
#include "client-sdk/gles/lens_pass.h"
#include "client-sdk/gles/offscreen_target.h"
#include "client-sdk/gles/scene_pass.h"
#include "client-sdk/gles/state_scope.h"

namespace tessera::client {
namespace {

constexpr uint32_t kLensSamples = 4;

Status check_fov(const char* what, const Fov& fov) {
  if (fov.right > fov.left && fov.up > fov.down && std::isfinite(fov.right - fov.left) &&
      std::isfinite(fov.up - fov.down))
    return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat(what, " is empty: tangents ", fov.left, "..", fov.right, ", ", fov.down, "..", fov.up));
}

Status check_view(const View& view) {
  TESSERA_RETURN_IF_ERROR(check_fov("the view's frustum", view.fov));
  if (!(view.near_m > 0) || view.width == 0 || view.height == 0) {
    return absl::InvalidArgumentError(absl::StrCat("the view's frustum is empty: ", view.width, "x",
                                                   view.height, " pixels, near ", view.near_m, " m"));
  }
  return absl::OkStatus();
}

GLint attachment(GLenum which, GLenum property) {
  GLint value = 0;
  glGetFramebufferAttachmentParameteriv(GL_DRAW_FRAMEBUFFER, which, property, &value);
  return value;
}

// Whether what is drawn into the bound framebuffer is encoded on its way. With EXT_sRGB_write_control apps
// may turn that off.
bool encodes_srgb(GLenum color, bool can_be_off) {
  if (attachment(color, GL_FRAMEBUFFER_ATTACHMENT_COLOR_ENCODING) != GL_SRGB) return false;
  return !can_be_off || glIsEnabled(GL_FRAMEBUFFER_SRGB_EXT) == GL_TRUE;
}

// Of the bound framebuffer; an error says what it lacks.
StatusOr<gles::TargetKind> kind_of(uint32_t framebuffer, bool needs_depth, bool srgb_write_control) {
  const GLenum status = glCheckFramebufferStatus(GL_DRAW_FRAMEBUFFER);
  if (status != GL_FRAMEBUFFER_COMPLETE)
    return absl::FailedPreconditionError(
        absl::StrFormat("framebuffer %u is incomplete (0x%04x)", framebuffer, status));
  const GLenum color = framebuffer == 0 ? GL_BACK : GL_COLOR_ATTACHMENT0;
  const GLenum depth = framebuffer == 0 ? GL_DEPTH : GL_DEPTH_ATTACHMENT;
  if (attachment(color, GL_FRAMEBUFFER_ATTACHMENT_OBJECT_TYPE) == GL_NONE)
    return absl::FailedPreconditionError(absl::StrFormat("framebuffer %u has no colour", framebuffer));
  if (needs_depth && attachment(depth, GL_FRAMEBUFFER_ATTACHMENT_OBJECT_TYPE) == GL_NONE)
    return absl::FailedPreconditionError(
        absl::StrFormat("framebuffer %u has no depth: attach a depth buffer", framebuffer));
  GLint samples = 0;
  glGetIntegerv(GL_SAMPLES, &samples);
  return gles::TargetKind{.multisampled = samples > 1, .srgb = encodes_srgb(color, srgb_write_control)};
}

float linear_from_srgb(float c) {  // IEC 61966-2-1
  return c <= 0.04045f ? c / 12.92f : std::pow((c + 0.055f) / 1.055f, 2.4f);
}

// Clearing and drawing reach these pixels only.
void limit_to(int x, int y, uint32_t width, uint32_t height) {
  glViewport(x, y, static_cast<GLsizei>(width), static_cast<GLsizei>(height));
  glEnable(GL_SCISSOR_TEST);
  glScissor(x, y, static_cast<GLsizei>(width), static_cast<GLsizei>(height));
}

}  // namespace

struct Drawer::Impl {
  std::array<uint8_t, 3> background;
  gles::ClipControl clip_control;
  bool srgb_write_control;
  gles::AtlasTexture atlas;
  gles::ScenePass scene;
  // Only where a lens was asked for.
  std::optional<gles::LensPass> lens_pass;
  std::optional<gles::OffscreenTarget> before_lens;

  // `work` with the context as our passes want it, and then as it was.
  template <typename Work>
  Status in_scope(const Work& work) {
    TESSERA_RETURN_IF_ERROR(gles::check_errors("before Tessera's calls, in the app's own"));
    const gles::StateScope scope(clip_control);
    return work();
  }
  // Into the bound framebuffer.
  Status draw_scene(const View& view, const gles::TargetKind& kind, int x, int y);
  Status prepare_lens(uint32_t width, uint32_t height);
  Status draw_through_lens(const View& view, const DrawTarget& target, const LensDistortion& lens);
};

Drawer::Drawer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Drawer::~Drawer() = default;

StatusOr<std::unique_ptr<Drawer>> Drawer::create(const std::array<uint8_t, 3>& background) {
  TESSERA_RETURN_IF_ERROR(gles::check_errors("before Tessera's calls, in the app's own"));
  const gles::ClipControl clip_control = gles::find_clip_control();
  const gles::StateScope scope(clip_control);
  TESSERA_ASSIGN_OR_RETURN(auto atlas, gles::AtlasTexture::create());
  TESSERA_ASSIGN_OR_RETURN(auto pass, gles::ScenePass::create(clip_control));
  return std::unique_ptr<Drawer>(
      new Drawer(std::unique_ptr<Impl>(new Impl{background,
                                                clip_control,
                                                gles::has_extension("GL_EXT_sRGB_write_control"),
                                                std::move(atlas),
                                                std::move(pass),
                                                {},
                                                {}})));
}

Status Drawer::set_atlas(const YuvView& atlas) {
  return impl_->in_scope([&] { return impl_->atlas.set(atlas); });
}

Status Drawer::set_atlas(const Image8& atlas) {
  return impl_->in_scope([&] { return impl_->atlas.set(atlas); });
}

Status Drawer::set_state(const SceneState& state) {
  return impl_->in_scope([&] { return impl_->scene.set_state(state); });
}

Status Drawer::draw(const View& view, const DrawTarget& target) {
  TESSERA_RETURN_IF_ERROR(check_view(view));
  return impl_->in_scope([&]() -> Status {
    glBindFramebuffer(GL_DRAW_FRAMEBUFFER, target.framebuffer);
    TESSERA_ASSIGN_OR_RETURN(const gles::TargetKind kind,
                             kind_of(target.framebuffer, true, impl_->srgb_write_control));
    return impl_->draw_scene(view, kind, target.x, target.y);
  });
}

Status Drawer::draw(const View& view, const DrawTarget& target, const LensDistortion& lens) {
  TESSERA_RETURN_IF_ERROR(check_view(view));
  TESSERA_RETURN_IF_ERROR(check_fov("the lens's screen", lens.screen));
  return impl_->in_scope([&] { return impl_->draw_through_lens(view, target, lens); });
}

Status Drawer::Impl::draw_scene(const View& view, const gles::TargetKind& kind, int x, int y) {
  limit_to(x, y, view.width, view.height);
  std::array<float, 3> color{};
  for (int i = 0; i < 3; ++i) {
    color[i] = static_cast<float>(background[i]) / 255.0f;
    if (kind.srgb) color[i] = linear_from_srgb(color[i]);
  }
  glClearColor(color[0], color[1], color[2], 1.0f);
  glClear(GL_COLOR_BUFFER_BIT);
  // Alpha serves only as coverage; the picture stays opaque.
  glColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_FALSE);
  const Status status = scene.draw(view, atlas, kind);
  glColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
  return status;
}

Status Drawer::Impl::prepare_lens(uint32_t width, uint32_t height) {
  if (!lens_pass) {
    TESSERA_ASSIGN_OR_RETURN(lens_pass, gles::LensPass::create());
  }
  if (before_lens && before_lens->width() == width && before_lens->height() == height)
    return absl::OkStatus();
  const uint32_t samples = std::min(kLensSamples, gles::OffscreenTarget::max_samples());
  TESSERA_ASSIGN_OR_RETURN(before_lens, gles::OffscreenTarget::create(width, height, samples));
  return absl::OkStatus();
}

Status Drawer::Impl::draw_through_lens(const View& view, const DrawTarget& target,
                                       const LensDistortion& lens) {
  glBindFramebuffer(GL_DRAW_FRAMEBUFFER, target.framebuffer);
  TESSERA_ASSIGN_OR_RETURN(const gles::TargetKind kind,
                           kind_of(target.framebuffer, false, srgb_write_control));

  // A lens leaves sizes at its centre as they are, so there the picture has the screen's pixels one to one.
  GLint limit = 0;
  glGetIntegerv(GL_MAX_TEXTURE_SIZE, &limit);
  const auto pixels = [&](uint32_t of_screen, float drawn, float screen) {
    const float wanted = std::round(static_cast<float>(of_screen) * drawn / screen);
    return static_cast<uint32_t>(std::clamp(wanted, 1.0f, static_cast<float>(limit)));
  };
  View picture = view;
  picture.width = pixels(view.width, view.fov.right - view.fov.left, lens.screen.right - lens.screen.left);
  picture.height = pixels(view.height, view.fov.up - view.fov.down, lens.screen.up - lens.screen.down);
  TESSERA_RETURN_IF_ERROR(prepare_lens(picture.width, picture.height));

  glBindFramebuffer(GL_DRAW_FRAMEBUFFER, before_lens->framebuffer());
  TESSERA_ASSIGN_OR_RETURN(const gles::TargetKind inner,
                           kind_of(before_lens->framebuffer(), true, srgb_write_control));
  TESSERA_RETURN_IF_ERROR(draw_scene(picture, inner, 0, 0));
  glDisable(GL_SCISSOR_TEST);
  before_lens->resolve();

  glBindFramebuffer(GL_DRAW_FRAMEBUFFER, target.framebuffer);
  limit_to(target.x, target.y, view.width, view.height);
  return lens_pass->draw(before_lens->picture(), view.fov, lens, kind.srgb);
}

}  // namespace tessera::client
