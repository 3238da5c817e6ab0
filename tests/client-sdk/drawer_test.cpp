// Drawing into an app's context: its framebuffers, its state, and a lens.
#include "client-sdk/drawer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "app_context.h"
#include "codec/yuv.h"

namespace tessera::client {
namespace {

using namespace test;
using ::testing::HasSubstr;

constexpr uint32_t kSide = 64;

// A textured wall behind a coloured panel that hangs out of the view's middle.
SceneState scene() {
  SceneBuilder builder;
  const uint32_t object = builder.object();
  builder.block(builder.rectangle(object, -1.5f, -1.5f, 1.5f, 1.5f, -1.5f), 4, 8, 4, 4);
  builder.color(builder.rectangle(object, 0.1f, -0.3f, 0.6f, 0.4f, -1), {200, 120, 10});
  return builder.state();
}

class DrawerTest : public ::testing::Test {
 protected:
  void SetUp() override { use(scene()); }
  void use(const SceneState& state) {
    drawer_.reset();
    auto drawer = Drawer::create({0, 0, 60});
    ASSERT_TRUE(drawer.ok()) << drawer.status();
    drawer_ = *std::move(drawer);
    EXPECT_TRUE(drawer_->set_state(state).ok());
    EXPECT_TRUE(drawer_->set_atlas(codec::view_of(atlas_)).ok());
    state_ = state;
  }
  // What Display draws of the same, in a context of its own.
  Image8 reference(const View& view, uint32_t samples) {
    auto display = make_display(view.width, samples);
    const Image8 picture = picture_of(*display, state_, codec::view_of(atlas_), view);
    display.reset();
    EXPECT_TRUE(context_->make_current().ok());
    return picture;
  }

  std::unique_ptr<gles::EglContext> context_ = make_app_context();
  const YuvImage atlas_ = codec::rgb_to_yuv(ramp_atlas());
  SceneState state_;
  std::unique_ptr<Drawer> drawer_;
};

TEST_F(DrawerTest, DrawsWhatADisplayDraws) {
  const View view = square_view(kSide, dvec3(0.1, 0, 0.2));
  for (GLsizei samples : {0, 4}) {
    const AppFramebuffer framebuffer(kSide, kSide, {.depth = GL_DEPTH_COMPONENT32F, .samples = samples});
    ASSERT_TRUE(drawer_->draw(view, {.framebuffer = framebuffer.id()}).ok());
    EXPECT_EQ(largest_difference(framebuffer.picture(), reference(view, samples ? 4 : 1)), 0) << samples;
  }
}

TEST_F(DrawerTest, AFramebufferThatEncodesItselfGetsTheSamePicture) {
  const View view = square_view(kSide);
  const AppFramebuffer framebuffer(kSide, kSide, {.color = GL_SRGB8_ALPHA8, .depth = GL_DEPTH_COMPONENT32F});
  const Image8 expected = reference(view, 1);
  ASSERT_TRUE(drawer_->draw(view, {.framebuffer = framebuffer.id()}).ok());
  EXPECT_LE(largest_difference(framebuffer.picture(), expected), 1);
  ASSERT_TRUE(
      drawer_->draw(view, {.framebuffer = framebuffer.id()}, LensDistortion{.screen = view.fov}).ok());
  EXPECT_LE(largest_difference(framebuffer.picture(), reference(view, 4)), 1);

  if (!gles::has_extension("GL_EXT_sRGB_write_control")) return;
  glDisable(GL_FRAMEBUFFER_SRGB_EXT);
  ASSERT_TRUE(drawer_->draw(view, {.framebuffer = framebuffer.id()}).ok());
  EXPECT_EQ(largest_difference(framebuffer.picture(), expected), 0) << "encoding switched off by the app";
}

TEST_F(DrawerTest, HalvesOfAFramebufferAreTheEyesPictures) {
  const View left = square_view(kSide, dvec3(-0.03, 0, 0)), right = square_view(kSide, dvec3(0.03, 0, 0));
  const AppFramebuffer framebuffer(2 * kSide + 10, kSide + 6, {.depth = GL_DEPTH_COMPONENT32F});
  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer.id());
  glClearColor(1, 0, 1, 1);
  glClear(GL_COLOR_BUFFER_BIT);
  ASSERT_TRUE(drawer_->draw(left, {.framebuffer = framebuffer.id(), .x = 5, .y = 2}).ok());
  ASSERT_TRUE(drawer_->draw(right, {.framebuffer = framebuffer.id(), .x = 5 + int(kSide), .y = 2}).ok());
  const Image8 both = framebuffer.picture();
  const uint32_t top = 4;  // 2 rows are left below, 4 above
  EXPECT_EQ(largest_difference(cut(both, 5, top, kSide, kSide), reference(left, 1)), 0);
  EXPECT_EQ(largest_difference(cut(both, 5 + kSide, top, kSide, kSide), reference(right, 1)), 0);
  for (uint32_t y = 0; y < kSide + 6; ++y) {
    for (uint32_t x = 0; x < 2 * kSide + 10; ++x) {
      if (y >= top && y < top + kSide && x >= 5 && x < 5 + 2 * kSide) continue;
      ASSERT_TRUE(near(pixel(both, x, y), {255, 0, 255}, 0)) << "outside the viewports: " << x << "," << y;
    }
  }
}

TEST_F(DrawerTest, UnsuitableFramebuffersAreNamed) {
  const View view = square_view(kSide);
  const auto message = [&](GLuint framebuffer) {
    const Status status = drawer_->draw(view, {.framebuffer = framebuffer});
    EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
    return std::string(status.message());
  };
  const AppFramebuffer flat(kSide, kSide, {.depth = GL_NONE}), colourless(kSide, kSide, {.color = GL_NONE});
  EXPECT_THAT(message(flat.id()), HasSubstr("no depth"));
  EXPECT_THAT(message(colourless.id()), HasSubstr("no colour"));
  EXPECT_THAT(message(0), HasSubstr("incomplete"))
      << "a context without a surface has no default framebuffer";
  EXPECT_TRUE(drawer_->draw(view, {.framebuffer = flat.id()}, {.screen = view.fov}).ok())
      << "a lens needs no depth there";
}

TEST_F(DrawerTest, AnErrorOfTheAppsIsNamedAsTheApps) {
  const AppFramebuffer framebuffer(kSide, kSide);
  glEnable(GL_TEXTURE_2D);  // not of OpenGL ES 3
  const Status status = drawer_->draw(square_view(kSide), {.framebuffer = framebuffer.id()});
  EXPECT_THAT(std::string(status.message()), HasSubstr("the app's own"));
  EXPECT_TRUE(drawer_->draw(square_view(kSide), {.framebuffer = framebuffer.id()}).ok());
}

// Everything that an app could have set, set otherwise than we want it.
class UglyState {
 public:
  UglyState() : framebuffer_(8, 8), texture_(gles::make_texture()), array_(gles::make_vertex_array()) {
    program_ = *gles::make_program({"#version 300 es\nvoid main() { gl_Position = vec4(0.0); }"},
                                   {"#version 300 es\nvoid main() {}"});
    glGenSamplers(1, &sampler_);
    glSamplerParameteri(sampler_, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    glGenBuffers(1, &buffer_);
    glBindBuffer(GL_PIXEL_UNPACK_BUFFER, buffer_);
    glBufferData(GL_PIXEL_UNPACK_BUFFER, 4, nullptr, GL_STATIC_DRAW);
    glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_.id());
    for (GLuint unit = 0; unit < 6; ++unit) {
      gles::bind_texture(unit, texture_);
      glBindSampler(unit, sampler_);
    }
    glUseProgram(program_.id());
    glBindVertexArray(array_.id());
    for (GLenum toggle :
         {GL_BLEND, GL_CULL_FACE, GL_DEPTH_TEST, GL_DITHER, GL_SCISSOR_TEST, GL_STENCIL_TEST,
          GL_SAMPLE_COVERAGE, GL_SAMPLE_ALPHA_TO_COVERAGE, GL_POLYGON_OFFSET_FILL, GL_RASTERIZER_DISCARD})
      glEnable(toggle);
    glStencilFunc(GL_NEVER, 1, 1);
    glBlendFunc(GL_ZERO, GL_ZERO);
    glSampleCoverage(0, GL_FALSE);
    glPolygonOffset(3, 3);
    glScissor(1, 1, 1, 1);
    glViewport(1, 2, 3, 4);
    glColorMask(GL_FALSE, GL_TRUE, GL_FALSE, GL_TRUE);
    glClearColor(0.25f, 0.5f, 0.75f, 0.5f);
    glDepthMask(GL_FALSE);
    glClearDepthf(0.5f);
    glDepthRangef(0.5f, 0.25f);
    glDepthFunc(GL_NEVER);
    glCullFace(GL_FRONT_AND_BACK);
    glFrontFace(GL_CW);
    glPixelStorei(GL_UNPACK_ALIGNMENT, 8);
    glPixelStorei(GL_UNPACK_ROW_LENGTH, 7);
    glPixelStorei(GL_UNPACK_SKIP_ROWS, 3);
    glPixelStorei(GL_UNPACK_SKIP_PIXELS, 2);
    if (const gles::ClipControl control = gles::find_clip_control())
      control(GL_UPPER_LEFT_EXT, GL_ZERO_TO_ONE_EXT);
  }
  ~UglyState() {
    glDeleteSamplers(1, &sampler_);
    glDeleteBuffers(1, &buffer_);
  }

 private:
  AppFramebuffer framebuffer_;
  gles::Texture texture_;
  gles::VertexArray array_;
  gles::Program program_;
  GLuint sampler_ = 0, buffer_ = 0;
};

// As text, one setting a line.
std::string state_of_context() {
  std::string text;
  for (GLenum name : {GL_DRAW_FRAMEBUFFER_BINDING,
                      GL_READ_FRAMEBUFFER_BINDING,
                      GL_RENDERBUFFER_BINDING,
                      GL_CURRENT_PROGRAM,
                      GL_VERTEX_ARRAY_BINDING,
                      GL_PIXEL_UNPACK_BUFFER_BINDING,
                      GL_ACTIVE_TEXTURE,
                      GL_BLEND,
                      GL_CULL_FACE,
                      GL_DEPTH_TEST,
                      GL_DITHER,
                      GL_SCISSOR_TEST,
                      GL_STENCIL_TEST,
                      GL_SAMPLE_COVERAGE,
                      GL_SAMPLE_ALPHA_TO_COVERAGE,
                      GL_POLYGON_OFFSET_FILL,
                      GL_RASTERIZER_DISCARD,
                      GL_DEPTH_WRITEMASK,
                      GL_DEPTH_FUNC,
                      GL_CULL_FACE_MODE,
                      GL_FRONT_FACE,
                      GL_UNPACK_ALIGNMENT,
                      GL_UNPACK_ROW_LENGTH,
                      GL_UNPACK_SKIP_ROWS,
                      GL_UNPACK_SKIP_PIXELS,
                      GL_VIEWPORT,
                      GL_SCISSOR_BOX,
                      GL_COLOR_WRITEMASK,
                      GL_STENCIL_FUNC,
                      GL_BLEND_SRC_RGB,
                      GL_PACK_ALIGNMENT,
                      GL_ARRAY_BUFFER_BINDING,
                      GL_GENERATE_MIPMAP_HINT}) {
    GLint values[4] = {};
    glGetIntegerv(name, values);
    absl::StrAppendFormat(&text, "0x%04x: %d %d %d %d\n", name, values[0], values[1], values[2], values[3]);
  }
  for (GLenum name : {GL_COLOR_CLEAR_VALUE, GL_DEPTH_CLEAR_VALUE, GL_DEPTH_RANGE}) {
    GLfloat values[4] = {};
    glGetFloatv(name, values);
    absl::StrAppendFormat(&text, "0x%04x: %g %g %g %g\n", name, values[0], values[1], values[2], values[3]);
  }
  if (gles::find_clip_control() != nullptr) {
    GLint origin = 0, depth = 0;
    glGetIntegerv(GL_CLIP_ORIGIN_EXT, &origin);
    glGetIntegerv(GL_CLIP_DEPTH_MODE_EXT, &depth);
    absl::StrAppendFormat(&text, "clip: 0x%04x 0x%04x\n", origin, depth);
  }
  GLint active = 0;
  glGetIntegerv(GL_ACTIVE_TEXTURE, &active);
  for (GLenum unit = 0; unit < 8; ++unit) {
    GLint bound = 0, sampler = 0;
    glActiveTexture(GL_TEXTURE0 + unit);
    glGetIntegerv(GL_TEXTURE_BINDING_2D, &bound);
    glGetIntegerv(GL_SAMPLER_BINDING, &sampler);
    absl::StrAppendFormat(&text, "unit %u: %d %d\n", unit, bound, sampler);
  }
  glActiveTexture(static_cast<GLenum>(active));
  return text;
}

TEST_F(DrawerTest, TheAppsStateNeitherDisturbsNorIsDisturbed) {
  const View view = square_view(kSide);
  const LensDistortion lens{.screen = view.fov, .red = {0.1f, 0, 0}};
  const FramebufferKind kind{.depth = GL_DEPTH_COMPONENT32F, .samples = 4};
  const AppFramebuffer plain(kSide, kSide, kind), bent(kSide, kSide), ugly(kSide, kSide, kind),
      ugly_bent(kSide, kSide);
  ASSERT_TRUE(drawer_->draw(view, {.framebuffer = plain.id()}).ok());
  ASSERT_TRUE(drawer_->draw(view, {.framebuffer = bent.id()}, lens).ok());
  const Image8 expected = plain.picture(), expected_bent = bent.picture();
  {
    const UglyState state;
    const std::string before = state_of_context();
    use(scene());
    EXPECT_EQ(state_of_context(), before) << "after creation and upload";
    EXPECT_TRUE(drawer_->draw(view, {.framebuffer = ugly.id()}).ok());
    EXPECT_EQ(state_of_context(), before) << "after drawing";
    EXPECT_TRUE(drawer_->draw(view, {.framebuffer = ugly_bent.id()}, lens).ok());
    EXPECT_EQ(state_of_context(), before) << "after drawing through a lens";
    EXPECT_FALSE(drawer_->draw(view, {.framebuffer = 0}).ok());
    EXPECT_EQ(state_of_context(), before) << "after an error";
    glDisable(GL_SCISSOR_TEST);
    glDisable(GL_RASTERIZER_DISCARD);
  }
  EXPECT_EQ(largest_difference(ugly.picture(), expected), 0);
  EXPECT_EQ(largest_difference(ugly_bent.picture(), expected_bent), 0);
}

TEST_F(DrawerTest, ALensThatBendsNothingChangesNothing) {
  const View view = square_view(kSide, dvec3(0.1, 0, 0.2));
  const AppFramebuffer framebuffer(kSide, kSide, {.depth = GL_NONE});
  ASSERT_TRUE(drawer_->draw(view, {.framebuffer = framebuffer.id()}, {.screen = view.fov}).ok());
  EXPECT_LE(largest_difference(framebuffer.picture(), reference(view, 4)), 1);
}

// The edge between a black and a white half at tangent `edge`: on the middle rows it is drawn at the pixel
// whose tangent t has t (1 + k1 t² + k2 t⁴ + k3 t⁶) = edge, in each colour by its own k.
TEST_F(DrawerTest, ALensMovesPointsToWhereTheFormulaSays) {
  constexpr uint32_t kFine = 256;
  constexpr float kEdge = 0.5f;
  SceneBuilder builder;
  const uint32_t object = builder.object();
  builder.color(builder.rectangle(object, -2, -2, 2, 2, -1.01f), {0, 0, 0});
  builder.color(builder.rectangle(object, kEdge, -2, 2, 2, -1), {255, 255, 255});
  use(builder.state());
  const View view = square_view(kFine);
  const Fov screen{-0.8f, 0.9f, -0.8f, 0.8f};
  const LensDistortion lens{
      .screen = screen, .red = {0.22f, 0.24f, 0}, .green = {0.3f, 0, 0.5f}, .blue = {-0.1f, 0, 0}};
  const AppFramebuffer framebuffer(kFine, kFine);
  ASSERT_TRUE(drawer_->draw(view, {.framebuffer = framebuffer.id()}, lens).ok());
  const Image8 picture = framebuffer.picture();

  const std::array<std::array<float, 3>, 3> coefficients{lens.red, lens.green, lens.blue};
  for (int channel = 0; channel < 3; ++channel) {
    uint32_t edge = 0;  // the first bright pixel
    while (edge < kFine && picture.at(edge, kFine / 2)[channel] < 128) ++edge;
    const auto tangent = [&](double x) { return screen.left + x / kFine * (screen.right - screen.left); };
    const auto seen = [&](double t) {
      const auto& k = coefficients[channel];
      return t * (1 + k[0] * t * t + k[1] * std::pow(t, 4) + k[2] * std::pow(t, 6));
    };
    // A pixel in width, as the picture before the lens has pixels, too.
    EXPECT_GT(seen(tangent(edge + 1.0)), kEdge) << channel << " at " << edge;
    EXPECT_LT(seen(tangent(edge - 1.0)), kEdge) << channel << " at " << edge;
  }
}

TEST_F(DrawerTest, BeyondWhatIsDrawnALensShowsBlack) {
  SceneBuilder builder;
  builder.color(builder.screen(builder.object()), {255, 255, 255});
  use(builder.state());
  const View view = square_view(kSide);
  const LensDistortion lens{
      .screen = view.fov, .red = {0.5f, 0, 0}, .green = {0.5f, 0, 0}, .blue = {0.5f, 0, 0}};
  const AppFramebuffer framebuffer(kSide, kSide);
  ASSERT_TRUE(drawer_->draw(view, {.framebuffer = framebuffer.id()}, lens).ok());
  const Image8 picture = framebuffer.picture();
  EXPECT_TRUE(near(pixel(picture, kSide / 2, kSide / 2), {255, 255, 255}, 0));
  EXPECT_TRUE(near(pixel(picture, 0, kSide / 2), {0, 0, 0}, 0)) << "the edge would be seen at tangent -1.5";
  EXPECT_TRUE(near(pixel(picture, 0, 0), {0, 0, 0}, 0));
}

TEST_F(DrawerTest, BadViewsAreNamed) {
  View view = square_view(kSide);
  const AppFramebuffer framebuffer(kSide, kSide);
  std::swap(view.fov.left, view.fov.right);
  EXPECT_THAT(std::string(drawer_->draw(view, {.framebuffer = framebuffer.id()}).message()),
              HasSubstr("frustum"));
  LensDistortion lens;
  lens.screen.up = lens.screen.down;
  EXPECT_THAT(
      std::string(drawer_->draw(square_view(kSide), {.framebuffer = framebuffer.id()}, lens).message()),
      HasSubstr("screen"));
}

}  // namespace
}  // namespace tessera::client
