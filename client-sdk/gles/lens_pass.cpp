#include "client-sdk/gles/lens_pass.h"

#include "client-sdk/gles/shared_shaders.h"

namespace tessera::client::gles {
namespace {

// Fields of view come as (left, down, width, height) in tangents.
constexpr const char* kLensFragment = R"(
uniform highp sampler2D picture;
uniform vec4 screen;
uniform vec4 drawn;
uniform vec3 red;
uniform vec3 green;
uniform vec3 blue;
in highp vec2 position;
out vec4 color;

vec3 seen_at(vec2 tangents, vec3 k) {
  float r2 = dot(tangents, tangents);
  vec2 seen = tangents * (1.0 + r2 * (k.x + r2 * (k.y + r2 * k.z)));
  vec2 at = (seen - drawn.xy) / drawn.zw;
  if (any(lessThan(at, vec2(0.0))) || any(greaterThan(at, vec2(1.0)))) return vec3(0.0);
  return textureLod(picture, at, 0.0).rgb;
}

void main() {
  vec2 tangents = screen.xy + position * screen.zw;
  vec3 seen = vec3(seen_at(tangents, red).r, seen_at(tangents, green).g, seen_at(tangents, blue).b);
  color = vec4(for_target(seen), 1.0);
}
)";

void set_fov(GLint location, const Fov& fov) {
  glUniform4f(location, fov.left, fov.down, fov.right - fov.left, fov.up - fov.down);
}

}  // namespace

StatusOr<LensPass> LensPass::create() {
  LensPass pass;
  TESSERA_ASSIGN_OR_RETURN(pass.program_,
                           make_program({kFullScreenVertex}, {kPicturePrelude, kLensFragment}));
  set_sampler(pass.program_, "picture", 0);
  const auto location = [&](const char* name) { return glGetUniformLocation(pass.program_.id(), name); };
  pass.screen_ = location("screen");
  pass.drawn_ = location("drawn");
  pass.red_ = location("red");
  pass.green_ = location("green");
  pass.blue_ = location("blue");
  pass.srgb_target_ = location("srgb_target");
  pass.no_attributes_ = make_vertex_array();
  TESSERA_RETURN_IF_ERROR(check_errors("creation of the lens pass"));
  return pass;
}

Status LensPass::draw(const Texture& picture, const Fov& fov, const LensDistortion& lens, bool srgb_target) {
  glDisable(GL_DEPTH_TEST);
  glDisable(GL_CULL_FACE);
  glUseProgram(program_.id());
  set_fov(screen_, lens.screen);
  set_fov(drawn_, fov);
  glUniform3fv(red_, 1, lens.red.data());
  glUniform3fv(green_, 1, lens.green.data());
  glUniform3fv(blue_, 1, lens.blue.data());
  glUniform1i(srgb_target_, srgb_target ? 1 : 0);
  bind_texture(0, picture);
  glBindVertexArray(no_attributes_.id());
  glDrawArrays(GL_TRIANGLES, 0, 3);
  return check_errors("drawing through the lens");
}

}  // namespace tessera::client::gles
