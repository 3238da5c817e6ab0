// Drawing in C.
#include <optional>

#include "client-sdk/c_api/handles.h"
#include "client-sdk/c_api/wall.h"
#include "client-sdk/gles/gl.h"
#include "codec/yuv.h"

namespace {

using namespace tessera;
using namespace tessera::client;
using namespace tessera::client::c_api;

constexpr uint32_t kMaxViewSide = 16384;

struct ViewToDraw {
  View view;
  DrawTarget target;
  std::optional<LensDistortion> lens;
};

bool is_zero(const TesseraFov& fov) {
  return fov.left == 0 && fov.right == 0 && fov.down == 0 && fov.up == 0;
}

StatusOr<LensDistortion> lens_of(const TesseraLensDistortion* given, const Fov& drawn) {
  TESSERA_RETURN_IF_ERROR(check_struct(given, TESSERA_TYPE_LENS_DISTORTION, "lens"));
  LensDistortion lens{.screen = drawn};
  if (!is_zero(given->screen)) {
    TESSERA_ASSIGN_OR_RETURN(lens.screen, fov_of(given->screen, "lens->screen"));
  }
  for (int i = 0; i < 3; ++i) {
    lens.red[i] = given->red[i];
    lens.green[i] = given->green[i];
    lens.blue[i] = given->blue[i];
    if (!std::isfinite(lens.red[i] + lens.green[i] + lens.blue[i]))
      return absl::InvalidArgumentError("a coefficient of the lens is not a finite number");
  }
  return lens;
}

StatusOr<ViewToDraw> view_of(const TesseraView& given) {
  TESSERA_RETURN_IF_ERROR(check_type(&given, TESSERA_TYPE_VIEW, "view"));
  ViewToDraw out;
  TESSERA_ASSIGN_OR_RETURN(out.view.pose, pose_of(given.pose, "view->pose"));
  TESSERA_ASSIGN_OR_RETURN(out.view.fov, fov_of(given.fov, "view->fov"));
  const TesseraViewport& viewport = given.viewport;
  if (viewport.width - 1 >= kMaxViewSide || viewport.height - 1 >= kMaxViewSide)
    return absl::InvalidArgumentError(absl::StrCat("view->viewport is ", viewport.width, "x", viewport.height,
                                                   " pixels; each side must be 1..", kMaxViewSide));
  out.view.width = viewport.width;
  out.view.height = viewport.height;
  out.target = {given.framebuffer, viewport.x, viewport.y};
  if (given.framebuffer == TESSERA_BOUND_FRAMEBUFFER) {
    GLint bound = 0;
    glGetIntegerv(GL_DRAW_FRAMEBUFFER_BINDING, &bound);
    out.target.framebuffer = static_cast<uint32_t>(bound);
  }
  if (given.next == nullptr) return out;
  TESSERA_ASSIGN_OR_RETURN(out.lens,
                           lens_of(static_cast<const TesseraLensDistortion*>(given.next), out.view.fov));
  return out;
}

// All are checked before the first is drawn.
StatusOr<std::vector<ViewToDraw>> views_of(const TesseraDrawInfo* info) {
  TESSERA_RETURN_IF_ERROR(check_struct(info, TESSERA_TYPE_DRAW_INFO, "info"));
  if (info->viewCount == 0 || info->viewCount > TESSERA_MAX_VIEWS || info->views == nullptr)
    return absl::InvalidArgumentError(
        absl::StrCat("info->views must be 1..", TESSERA_MAX_VIEWS, " views, not ", info->viewCount));
  std::vector<ViewToDraw> views;
  for (uint32_t i = 0; i < info->viewCount; ++i) {
    TESSERA_ASSIGN_OR_RETURN(views.emplace_back(), view_of(info->views[i]));
  }
  return views;
}

Status upload(TesseraRenderer_T& renderer) {
  const TesseraSession_T& session = *renderer.session;
  if (renderer.uploaded == session.acquired) return absl::OkStatus();
  const Pair& pair = *session.session.pair();
  TESSERA_RETURN_IF_ERROR(renderer.drawer->set_state(pair.state));
  TESSERA_RETURN_IF_ERROR(renderer.drawer->set_atlas(codec::view_of(pair.atlas)));
  renderer.uploaded = session.acquired;
  return absl::OkStatus();
}

TesseraResult check_context(TesseraRenderer renderer) {
  if (renderer == nullptr) return failure(TESSERA_ERROR_HANDLE_INVALID, "the renderer is NULL");
  if (eglGetCurrentContext() == renderer->context) return TESSERA_SUCCESS;
  return failure(TESSERA_ERROR_CONTEXT, "the EGL context in which the renderer was created is not current");
}

}  // namespace

extern "C" {

TesseraResult tesseraCreateRenderer(TesseraSession session, const TesseraRendererCreateInfo* info,
                                    TesseraRenderer* renderer) {
  return guarded([&] {
    if (session == nullptr) return failure(TESSERA_ERROR_HANDLE_INVALID, "the session is NULL");
    if (renderer == nullptr) return failure(TESSERA_ERROR_VALIDATION, "renderer is NULL");
    TESSERA_FAIL_IF_ERROR(check_struct(info, TESSERA_TYPE_RENDERER_CREATE_INFO, "info"));
    const EGLContext context = eglGetCurrentContext();
    if (context == EGL_NO_CONTEXT)
      return failure(TESSERA_ERROR_CONTEXT, "no EGL context is current: call eglMakeCurrent() before");
    const uint8_t* color = info->background;
    auto drawer = Drawer::create({color[0], color[1], color[2]});
    TESSERA_FAIL_IF_ERROR(drawer.status());
    *renderer = new TesseraRenderer_T{session, context, *std::move(drawer)};
    ++session->renderers;
    return TESSERA_SUCCESS;
  });
}

TesseraResult tesseraDestroyRenderer(TesseraRenderer renderer) {
  return guarded([&] {
    if (renderer == nullptr) return TESSERA_SUCCESS;
    if (const TesseraResult result = check_context(renderer); result != TESSERA_SUCCESS) return result;
    --renderer->session->renderers;
    delete renderer;
    return TESSERA_SUCCESS;
  });
}

TesseraResult tesseraDraw(TesseraRenderer renderer, const TesseraDrawInfo* info) {
  return guarded([&] {
    if (const TesseraResult result = check_context(renderer); result != TESSERA_SUCCESS) return result;
    const auto views = views_of(info);
    TESSERA_FAIL_IF_ERROR(views.status());
    TESSERA_FAIL_IF_ERROR(upload(*renderer));
    for (const ViewToDraw& v : *views) {
      TESSERA_FAIL_IF_ERROR(v.lens ? renderer->drawer->draw(v.view, v.target, *v.lens)
                                   : renderer->drawer->draw(v.view, v.target));
    }
    return renderer->uploaded == 0 ? TESSERA_FRAME_UNAVAILABLE : TESSERA_SUCCESS;
  });
}

}  // extern "C"
