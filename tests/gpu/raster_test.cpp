#include <numeric>

#include "gpu_test.h"
#include "shaders/color.frag.spv.h"
#include "shaders/id.frag.spv.h"
#include "shaders/sample.frag.spv.h"
#include "shaders/triangle.vert.spv.h"

namespace tessera::gpu {
namespace {

constexpr uint32_t kSize = 16;

struct Vertex {
  float x, y, z, w;
};

// Clip space, +Y up.
using Triangle = std::array<Vertex, 3>;

Triangle upper_left(float depth) {  // counter-clockwise
  return {{{-1, 1, depth, 1}, {-1, -1, depth, 1}, {1, 1, depth, 1}}};
}

Triangle whole(float depth) {  // counter-clockwise, larger than the target
  return {{{-1, -1, depth, 1}, {3, -1, depth, 1}, {-1, 3, depth, 1}}};
}

class RasterTest : public GpuTest {
 protected:
  void SetUp() override {
    const Binding binding{0, BindingKind::storage_buffer};
    layout_ = value(BindLayout::create(device(), {&binding, 1}));
    ids_ = image({.width = kSize, .height = kSize, .format = Format::r32_uint});
    depth_ = image({.width = kSize, .height = kSize, .format = Format::depth32_float});
  }

  void TearDown() override {
    ids_ = {};
    depth_ = {};
    GpuTest::TearDown();
  }

  RasterPipelineDesc id_desc() {
    return {.name = "ids",
            .vertex = triangle_vert,
            .fragment = id_frag,
            .layouts = {&layout_},
            .colors = {Format::r32_uint},
            .depth = Format::depth32_float};
  }
  BindGroup bound(const Buffer& positions) {
    BindGroup group = value(BindGroup::create(device(), layout_));
    group.set(0, positions);
    return group;
  }
  static Buffer upload(const std::vector<Triangle>& triangles) { return filled(triangles); }

  // Draws with `pipeline`, triangle i as instance i, and returns the id image.
  std::vector<uint32_t> draw(const RasterPipeline& pipeline, const std::vector<Triangle>& triangles,
                             std::optional<Cull> cull = {}) {
    const Buffer positions = upload(triangles);
    const BindGroup group = bound(positions);
    const ColorAttachment color{.image = &ids_, .clear_uint = std::array<uint32_t, 4>{}};
    Commands commands = device().begin();
    commands.begin_rendering({.colors = {&color, 1}, .depth = &depth_, .width = kSize, .height = kSize});
    commands.bind(pipeline, {&group});
    if (cull) commands.set_cull(*cull);
    for (uint32_t i = 0; i < triangles.size(); ++i) commands.draw(3, 1, 3 * i, i);
    commands.end_rendering();
    run(std::move(commands));
    return read<uint32_t>(ids_, kSize * kSize);
  }

  BindLayout layout_;
  Image ids_, depth_;
};

TEST_F(RasterTest, FirstRowOfTheImageIsTheTop) {
  const auto pipeline = value(RasterPipeline::create(device(), id_desc()));
  const auto ids = draw(pipeline, {upper_left(0.5f)});
  EXPECT_EQ(ids[0], 1u) << "top left is inside";
  EXPECT_EQ(ids[kSize - 2], 1u) << "top right is inside";
  EXPECT_EQ(ids[kSize * (kSize - 2)], 1u) << "bottom left is inside";
  EXPECT_EQ(ids[kSize * kSize - 1], 0u) << "bottom right is outside";
}

TEST_F(RasterTest, FrontFacesAreCounterClockwiseWithYUp) {
  const Triangle ccw = whole(0.5f);
  const Triangle cw = {ccw[0], ccw[2], ccw[1]};
  RasterPipelineDesc desc = id_desc();
  desc.cull = Cull::back;
  const auto pipeline = value(RasterPipeline::create(device(), desc));
  EXPECT_THAT(draw(pipeline, {ccw}), testing::Each(1u));
  EXPECT_THAT(draw(pipeline, {cw}), testing::Each(0u));
  EXPECT_THAT(draw(pipeline, {ccw}, Cull::front), testing::Each(0u));
  EXPECT_THAT(draw(pipeline, {cw}, Cull::front), testing::Each(1u));
  EXPECT_THAT(draw(pipeline, {cw}, Cull::none), testing::Each(1u));
}

TEST_F(RasterTest, GreaterDepthIsNearerAndTheLaterOfEqualsWins) {
  const auto pipeline = value(RasterPipeline::create(device(), id_desc()));
  EXPECT_THAT(draw(pipeline, {whole(0.25f), whole(0.75f)}), testing::Each(2u));
  EXPECT_THAT(draw(pipeline, {whole(0.75f), whole(0.25f)}), testing::Each(1u));
  EXPECT_THAT(read<float>(depth_, kSize * kSize), testing::Each(0.75f));
  EXPECT_THAT(draw(pipeline, {whole(0.5f), whole(0.5f)}), testing::Each(2u));
}

TEST_F(RasterTest, DepthOnlyPipelineAndDepthClamp) {
  RasterPipelineDesc desc = id_desc();
  desc.fragment = {};
  desc.colors = {};
  desc.depth_clamp = true;
  const auto pipeline = value(RasterPipeline::create(device(), desc));
  const Buffer positions = upload({whole(1.5f)});  // nearer than the near plane
  const BindGroup group = bound(positions);
  Commands commands = device().begin();
  commands.begin_rendering({.depth = &depth_, .width = kSize, .height = kSize});
  commands.bind(pipeline, {&group});
  commands.draw(3);
  commands.end_rendering();
  run(std::move(commands));
  EXPECT_THAT(read<float>(depth_, kSize * kSize), testing::Each(1.0f));
}

TEST_F(RasterTest, ViewportIsCountedFromTheTop) {
  const auto pipeline = value(RasterPipeline::create(device(), id_desc()));
  const Buffer positions = upload({whole(0.5f)});
  const BindGroup group = bound(positions);
  const ColorAttachment color{.image = &ids_, .clear_uint = std::array<uint32_t, 4>{9, 9, 9, 9}};
  Commands commands = device().begin();
  commands.begin_rendering({.colors = {&color, 1}, .depth = &depth_, .width = kSize, .height = kSize});
  commands.bind(pipeline, {&group});
  commands.set_viewport(4, 2, 8, 3);
  commands.draw(3);
  commands.end_rendering();
  run(std::move(commands));
  const auto ids = read<uint32_t>(ids_, kSize * kSize);
  for (uint32_t i = 0; i < ids.size(); ++i) {
    const uint32_t x = i % kSize, y = i / kSize;
    EXPECT_EQ(ids[i], x >= 4 && x < 12 && y >= 2 && y < 5 ? 1u : 9u) << x << "," << y;
  }
}

TEST_F(RasterTest, IndirectCountDrawsAsManyAsTheGpuSays) {
  const auto pipeline = value(RasterPipeline::create(device(), id_desc()));
  const Buffer positions = upload({whole(0.25f), whole(0.5f), whole(0.75f)});
  const Buffer indices = filled(std::vector<uint32_t>{0, 1, 2});
  // indices, instances, first index, vertex offset, first instance
  const Buffer draws = filled(std::vector<uint32_t>{3, 1, 0, 0, 10, 3, 1, 0, 3, 11, 3, 1, 0, 6, 12});
  const BindGroup group = bound(positions);
  for (uint32_t count = 0; count <= 3; ++count) {
    const Buffer counts = filled(std::vector<uint32_t>{77, count});
    const ColorAttachment color{.image = &ids_, .clear_uint = std::array<uint32_t, 4>{}};
    const uint64_t before = device().draws_recorded();
    Commands commands = device().begin();
    commands.begin_rendering({.colors = {&color, 1}, .depth = &depth_, .width = kSize, .height = kSize});
    commands.bind(pipeline, {&group});
    commands.bind_indices(indices);
    commands.draw_indexed_indirect_count(draws, 0, counts, 4, 3);
    commands.end_rendering();
    run(std::move(commands));
    EXPECT_EQ(device().draws_recorded() - before, 1u);
    EXPECT_THAT(read<uint32_t>(ids_, kSize * kSize), testing::Each(count == 0 ? 0 : 10 + count));
  }
}

TEST_F(RasterTest, SampleShadingRunsOnceASampleAndResolveAverages) {
  const ImageDesc target{.width = kSize, .height = kSize, .format = Format::rgba32_float};
  ImageDesc multisampled = target;
  multisampled.samples = 4;
  const Image samples = image(multisampled), resolved = image(target);
  const auto pipeline = value(RasterPipeline::create(device(), {.name = "samples",
                                                                .vertex = triangle_vert,
                                                                .fragment = sample_frag,
                                                                .layouts = {&layout_},
                                                                .colors = {Format::rgba32_float},
                                                                .samples = 4,
                                                                .sample_shading = true}));
  const Buffer positions = upload({whole(0.5f)});
  const BindGroup group = bound(positions);
  const ColorAttachment color{.image = &samples, .clear = std::array<float, 4>{}, .resolve = &resolved};
  Commands commands = device().begin();
  commands.begin_rendering({.colors = {&color, 1}, .width = kSize, .height = kSize});
  commands.bind(pipeline, {&group});
  commands.draw(3);
  commands.end_rendering();
  run(std::move(commands));
  EXPECT_THAT(read<float>(resolved, 4 * kSize * kSize), testing::Each(testing::FloatNear(0.5f, 1e-6f)));
}

TEST_F(RasterTest, KeepsContentsUnlessCleared) {
  const Image target = image({.width = kSize, .height = kSize, .format = Format::rgba8_unorm});
  const auto pipeline = value(RasterPipeline::create(device(), {.name = "colour",
                                                                .vertex = triangle_vert,
                                                                .fragment = color_frag,
                                                                .layouts = {&layout_},
                                                                .push_bytes = 16,
                                                                .colors = {Format::rgba8_unorm}}));
  const Buffer positions = upload({upper_left(0.5f)});
  const BindGroup group = bound(positions);
  Commands commands = device().begin();
  commands.clear(target, {0, 1, 0, 1});
  commands.barrier();
  const ColorAttachment color{.image = &target};
  commands.begin_rendering({.colors = {&color, 1}, .width = kSize, .height = kSize});
  commands.bind(pipeline, {&group});
  commands.push(std::array<float, 4>{1, 0, 0, 1});
  commands.draw(3);
  commands.end_rendering();
  run(std::move(commands));
  const auto texels = read<uint32_t>(target, kSize * kSize);
  EXPECT_EQ(texels.front(), 0xff0000ffu);
  EXPECT_EQ(texels.back(), 0xff00ff00u);
}

}  // namespace
}  // namespace tessera::gpu
