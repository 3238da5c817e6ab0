// The three compilations of the one text give the same: whole numbers equal, others within a few units in the
// last place.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <fstream>
#include <iterator>

#include "atlas/addressing/glsl_text.h"
#include "client-sdk/gles/egl_context.h"
#include "client-sdk/gles/gl.h"
#include "questions.h"
#include "shaders/evaluate.comp.spv.h"
#include "tests/gpu/gpu_test.h"

namespace tessera::atlas::addressing::test {
namespace {

constexpr int kMaxUlps = 4;

int64_t ordered(float x) {
  const auto bits = std::bit_cast<int32_t>(x);
  return bits < 0 ? int64_t{INT32_MIN} - bits : bits;
}

// Also counts how many numbers were compared, so that a test of nothing fails.
void expect_same(int function, const std::vector<Question>& asked, const std::vector<Question>& cpp,
                 const std::vector<Question>& other) {
  ASSERT_EQ(cpp.size(), other.size());
  ASSERT_GT(cpp.size(), 100u);
  int64_t worst = 0;
  int different = 0;
  size_t example = 0;
  for (size_t i = 0; i < cpp.size(); ++i) {
    bool same = cpp[i].n == other[i].n;
    for (int c = 0; c < 4; ++c) {
      ASSERT_TRUE(std::isfinite(cpp[i].x[c]));
      const int64_t ulps = std::abs(ordered(cpp[i].x[c]) - ordered(other[i].x[c]));
      worst = std::max(worst, ulps);
      same = same && ulps <= kMaxUlps;
    }
    if (!same && different++ == 0) example = i;
  }
  const auto text = [](const Question& q) {
    std::string s;
    for (int c = 0; c < 4; ++c) s += absl::StrCat(q.n[c], " ");
    for (int c = 0; c < 4; ++c) s += absl::StrFormat("%.9g ", q.x[c]);
    return s;
  };
  EXPECT_EQ(different, 0) << function_name(function) << " of " << text(asked[example]) << "is "
                          << text(cpp[example]) << "in C++, " << text(other[example]) << "here";
  testing::Test::RecordProperty(function_name(function), static_cast<int>(worst));
}

using VulkanAgreement = gpu::GpuTest;

TEST_F(VulkanAgreement, ComputeShadersAnswerLikeCpp) {
  using gpu::value;
  const gpu::Binding bindings[] = {{0, gpu::BindingKind::storage_buffer},
                                   {1, gpu::BindingKind::storage_buffer}};
  const gpu::BindLayout layout = value(gpu::BindLayout::create(device(), bindings));
  const gpu::ComputePipeline pipeline = value(gpu::ComputePipeline::create(
      device(), {.name = "evaluate", .shader = evaluate_comp, .layouts = {&layout}, .push_bytes = 4}));
  for (int function = 0; function < function_count(); ++function) {
    const std::vector<Question> asked = questions(function);
    const gpu::Buffer in = filled(asked);
    const gpu::Buffer out = buffer(asked.size() * sizeof(Question), gpu::Memory::readback);
    gpu::BindGroup group = value(gpu::BindGroup::create(device(), layout));
    group.set(0, in);
    group.set(1, out);
    gpu::Commands commands = device().begin();
    commands.bind(pipeline, {&group});
    commands.push(function);
    commands.dispatch(static_cast<uint32_t>((asked.size() + 63) / 64));
    run(std::move(commands));
    const auto answers = out.as<Question>();
    expect_same(function, asked, answered(function, asked), {answers.begin(), answers.end()});
  }
}

constexpr const char* kVertex = R"(#version 300 es
void main() { gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0); }
)";
constexpr const char* kPrelude = R"(#version 300 es
precision highp float;
precision highp int;
)";
// Both kinds of number go in and out as bits: rendering to floats needs an extension.
constexpr const char* kFragment = R"(
uniform highp isampler2D asked;
uniform int function;
layout(location = 0) out ivec4 n;
layout(location = 1) out ivec4 x;
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  Answer a = evaluate(function, texelFetch(asked, ivec2(2 * at.x, at.y), 0),
                      intBitsToFloat(texelFetch(asked, ivec2(2 * at.x + 1, at.y), 0)));
  n = a.n;
  x = floatBitsToInt(a.x);
}
)";

// The text of evaluate.glsl without its includes.
std::string evaluate_text() {
  std::ifstream in(TESSERA_EVALUATE_GLSL);
  std::string text;
  for (std::string line; std::getline(in, line);)
    if (!line.starts_with("#include")) text += line + "\n";
  return text;
}

// A page of questions at a time: kWidth x kHeight.
class GlesAnswers {
 public:
  static constexpr int kWidth = 512, kHeight = 512;

  GlesAnswers() {
    context_ = gpu::value(client::gles::EglContext::create());
    EXPECT_TRUE(context_->make_current().ok());
    const std::string evaluate = evaluate_text();
    program_ =
        gpu::value(client::gles::make_program({kVertex}, {kPrelude, kGlslText, evaluate.c_str(), kFragment}));
    asked_ = make_page(2 * kWidth);
    framebuffer_ = client::gles::make_framebuffer();
    glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_.id());
    for (GLenum i = 0; i < 2; ++i) {
      answers_[i] = make_page(kWidth);
      glFramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0 + i, GL_TEXTURE_2D, answers_[i].id(), 0);
    }
    constexpr GLenum kBoth[] = {GL_COLOR_ATTACHMENT0, GL_COLOR_ATTACHMENT1};
    glDrawBuffers(2, kBoth);
    vertex_array_ = client::gles::make_vertex_array();
    glBindVertexArray(vertex_array_.id());
    glViewport(0, 0, kWidth, kHeight);
    client::gles::set_sampler(program_, "asked", 0);
  }

  std::vector<Question> operator()(int function, std::vector<Question> page) {
    const size_t count = page.size();
    page.resize(size_t{kWidth} * kHeight);
    client::gles::bind_texture(0, asked_);
    glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, 2 * kWidth, kHeight, GL_RGBA_INTEGER, GL_INT, page.data());
    glUniform1i(glGetUniformLocation(program_.id(), "function"), function);
    glDrawArrays(GL_TRIANGLES, 0, 3);
    std::vector<ivec4> n(page.size()), x(page.size());
    glReadBuffer(GL_COLOR_ATTACHMENT0);
    glReadPixels(0, 0, kWidth, kHeight, GL_RGBA_INTEGER, GL_INT, n.data());
    glReadBuffer(GL_COLOR_ATTACHMENT1);
    glReadPixels(0, 0, kWidth, kHeight, GL_RGBA_INTEGER, GL_INT, x.data());
    EXPECT_TRUE(client::gles::check_errors("drawing the answers").ok());
    for (size_t i = 0; i < count; ++i) page[i] = {n[i], std::bit_cast<vec4>(x[i])};
    page.resize(count);
    return page;
  }

 private:
  static client::gles::Texture make_page(GLsizei width) {
    client::gles::Texture texture = client::gles::make_texture();
    client::gles::set_sampling(texture, GL_NEAREST);
    glTexStorage2D(GL_TEXTURE_2D, 1, GL_RGBA32I, width, kHeight);
    return texture;
  }

  std::unique_ptr<client::gles::EglContext> context_;
  client::gles::Program program_;
  client::gles::Texture asked_, answers_[2];
  client::gles::Framebuffer framebuffer_;
  client::gles::VertexArray vertex_array_;
};

TEST(GlesAgreement, FragmentShadersAnswerLikeCpp) {
  GlesAnswers answers;
  for (int function = 0; function < function_count(); ++function) {
    const std::vector<Question> asked = questions(function);
    ASSERT_LE(asked.size(), size_t{GlesAnswers::kWidth} * GlesAnswers::kHeight);
    expect_same(function, asked, answered(function, asked), answers(function, asked));
  }
}

}  // namespace
}  // namespace tessera::atlas::addressing::test
