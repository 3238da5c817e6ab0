#include "gpu/image.h"

#include <cmath>
#include <numeric>
#include <random>

#include "gpu_test.h"
#include "shaders/encode.frag.spv.h"
#include "shaders/mean.comp.spv.h"
#include "shaders/store.comp.spv.h"
#include "shaders/triangle.vert.spv.h"

namespace tessera::gpu {
namespace {

using ImageTest = GpuTest;

double mean(const std::vector<float>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

TEST_F(ImageTest, CopiesEveryFormatInAndOut) {
  const std::pair<Format, uint32_t> formats[] = {
      {Format::rgba8_unorm, 4},   {Format::rgba8_srgb, 4}, {Format::rgba16_float, 8},
      {Format::rgba32_float, 16}, {Format::r32_uint, 4},   {Format::r32_float, 4},
      {Format::r8_unorm, 1},      {Format::rg32_uint, 8},  {Format::depth32_float, 4},
  };
  for (const auto& [format, bytes] : formats) {
    const Image target = image({.width = 5, .height = 3, .format = format, .layers = 2});
    std::vector<uint8_t> texels(5 * 3 * bytes);
    // 0x3c in every byte is a number, in range, in each of these formats.
    std::fill(texels.begin(), texels.end(), uint8_t{0x3c});
    texels[bytes] = 0x3b;
    write(target, texels, 1);
    EXPECT_EQ(read<uint8_t>(target, texels.size(), 0, 1), texels) << static_cast<int>(format);
  }
}

TEST_F(ImageTest, MipsPreserveTheMeanOfEveryLayer) {
  const Image target = image({.width = 64,
                              .height = 32,
                              .format = Format::r32_float,
                              .layers = 2,
                              .mip_levels = 0,
                              .storage = true});
  ASSERT_EQ(target.mip_levels(), 7u);
  std::mt19937 random(3);
  for (uint32_t layer = 0; layer < 2; ++layer) {
    std::vector<float> texels(64 * 32);
    for (float& texel : texels)
      texel = static_cast<float>(random() % 1000) / 1000 + static_cast<float>(layer);
    write(target, texels, layer);
  }
  Commands commands = device().begin();
  commands.generate_mips(target);
  run(std::move(commands));
  for (uint32_t layer = 0; layer < 2; ++layer) {
    const double expected = mean(read<float>(target, 64 * 32, 0, layer));
    // Down to 2x1, each texel averages four.
    for (uint32_t mip = 1; mip <= 5; ++mip) {
      const size_t count = (64u >> mip) * (32u >> mip);
      EXPECT_NEAR(mean(read<float>(target, count, mip, layer)), expected, 1e-4) << mip;
    }
  }
}

TEST_F(ImageTest, SrgbMipsAverageLight) {
  const Image target = image({.width = 2, .height = 2, .format = Format::rgba8_srgb, .mip_levels = 2});
  write(target, std::vector<uint32_t>{0xff000000u, 0xffffffffu, 0xff000000u, 0xffffffffu});
  Commands commands = device().begin();
  commands.generate_mips(target);
  run(std::move(commands));
  // Half the light is code 188, not 128.
  EXPECT_NEAR(read<uint8_t>(target, 4, 1)[0], 188, 1);
}

TEST_F(ImageTest, SrgbBytesAreTheSameThroughStorageAndAttachment) {
  const Image target = image({.width = 256, .height = 1, .format = Format::rgba8_srgb, .storage = true});
  std::vector<uint8_t> expected;
  for (int x = 0; x < 256; ++x) expected.insert(expected.end(), {uint8_t(x), uint8_t(x), uint8_t(x), 255});

  const Binding storage{0, BindingKind::storage_image};
  const BindLayout store_layout = value(BindLayout::create(device(), {&storage, 1}));
  const auto store = value(
      ComputePipeline::create(device(), {.name = "store", .shader = store_comp, .layouts = {&store_layout}}));
  BindGroup stored = value(BindGroup::create(device(), store_layout));
  stored.set(0, target);
  Commands compute = device().begin();
  compute.bind(store, {&stored});
  compute.dispatch(4);
  run(std::move(compute));
  EXPECT_EQ(read<uint8_t>(target, 1024), expected);

  const Binding positions{0, BindingKind::storage_buffer};
  const BindLayout layout = value(BindLayout::create(device(), {&positions, 1}));
  const auto encode = value(RasterPipeline::create(device(), {.name = "encode",
                                                              .vertex = triangle_vert,
                                                              .fragment = encode_frag,
                                                              .layouts = {&layout},
                                                              .colors = {Format::rgba8_srgb}}));
  const Buffer triangle = filled(std::vector<float>{-1, -1, 0, 1, 3, -1, 0, 1, -1, 3, 0, 1});
  BindGroup bound = value(BindGroup::create(device(), layout));
  bound.set(0, triangle);
  const ColorAttachment color{.image = &target, .clear = std::array<float, 4>{}};
  Commands raster = device().begin();
  raster.begin_rendering({.colors = {&color, 1}, .width = 256, .height = 1});
  raster.bind(encode, {&bound});
  raster.draw(3);
  raster.end_rendering();
  run(std::move(raster));
  const auto attached = read<uint8_t>(target, 1024);
  for (int i = 0; i < 1024; ++i) EXPECT_EQ(attached[i], expected[i]) << i;
}

TEST_F(ImageTest, ArrayViewsAndSingleMipStorageViews) {
  const Image source = image({.width = 2, .height = 2, .format = Format::r32_float, .array_view = true});
  const Image pyramid =
      image({.width = 4, .height = 4, .format = Format::r32_float, .mip_levels = 3, .storage = true});
  const Binding bindings[] = {{0, BindingKind::sampled_image}, {1, BindingKind::storage_image}};
  const BindLayout layout = value(BindLayout::create(device(), bindings));
  const auto pipeline = value(ComputePipeline::create(
      device(), {.name = "mean", .shader = mean_comp, .layouts = {&layout}, .push_bytes = 8}));
  const Sampler sampler = value(Sampler::create(device(), {.wrap_u = Wrap::clamp_to_edge}));
  BindGroup group = value(BindGroup::create(device(), layout));
  group.set(0, source, sampler);
  group.set_mip(1, pyramid, 2);
  write(source, std::vector<float>{1, 2, 3, 6});
  Commands commands = device().begin();
  commands.clear(pyramid, {});
  commands.barrier();
  commands.bind(pipeline, {&group});
  commands.push(std::array<float, 2>{0, 0});
  commands.dispatch(1);
  run(std::move(commands));
  EXPECT_FLOAT_EQ(read<float>(pyramid, 1, 2)[0], 6) << "twice the mean";
  EXPECT_THAT(read<float>(pyramid, 4, 1), testing::Each(0.0f));
  EXPECT_THAT(read<float>(pyramid, 16, 0), testing::Each(0.0f));
}

TEST_F(ImageTest, RefusesWhatCannotBe) {
  const ImageDesc wrong[] = {{.width = 0},
                             {.width = 1u << 20},
                             {.samples = 3},
                             {.samples = 4, .storage = true},
                             {.format = Format::depth32_float, .storage = true}};
  for (const ImageDesc& desc : wrong) {
    const auto image = Image::create(device(), desc, "impossible");
    EXPECT_EQ(image.status().code(), absl::StatusCode::kInvalidArgument);
    EXPECT_THAT(std::string(image.status().message()), testing::HasSubstr("impossible"));
  }
}

TEST_F(ImageTest, AnImageMayGoBeforeItsFirstSubmission) {
  { const Image unused = image({.width = 8, .height = 8}); }
  run(device().begin());
}

}  // namespace
}  // namespace tessera::gpu
