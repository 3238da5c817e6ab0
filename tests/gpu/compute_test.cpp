#include <chrono>

#include "gpu_test.h"
#include "shaders/pick.comp.spv.h"
#include "shaders/scale.comp.spv.h"

namespace tessera::gpu {
namespace {

class ComputeTest : public GpuTest {
 protected:
  void SetUp() override {
    const Binding binding{0, BindingKind::storage_buffer};
    layout_ = value(BindLayout::create(device(), {&binding, 1}));
    scale_ = value(ComputePipeline::create(
        device(), {.name = "scale", .shader = scale_comp, .layouts = {&layout_}, .push_bytes = 4}));
  }
  BindGroup group(const Buffer& values) {
    BindGroup result = value(BindGroup::create(device(), layout_));
    result.set(0, values);
    return result;
  }

  BindLayout layout_;
  ComputePipeline scale_;
};

// The software device once timed a dispatch after drawing to another target at next to nothing.
TEST_F(ComputeTest, AnIntervalAfterARenderHoldsItsDispatches) {
  const Image target = image({.width = 256, .height = 256});
  const ColorAttachment color{.image = &target, .clear = std::array<float, 4>{}};
  Commands drawing = device().begin();
  drawing.begin_rendering({.colors = {&color, 1}, .width = 256, .height = 256});
  drawing.end_rendering();
  run(std::move(drawing));

  constexpr uint32_t kValues = 1 << 20;
  const Buffer values = buffer(4 * kValues);
  const BindGroup bound = group(values);
  Commands commands = device().begin();
  commands.begin_interval("dispatches");
  for (int i = 0; i < 20; ++i) {
    commands.bind(scale_, {&bound});
    commands.push(3u);
    commands.dispatch(kValues / 64);
    commands.barrier();
  }
  commands.end_interval();
  const auto begin = std::chrono::steady_clock::now();
  run(std::move(commands));
  const std::chrono::duration<double, std::milli> wall = std::chrono::steady_clock::now() - begin;
  ASSERT_EQ(device().intervals().size(), 1u);
  EXPECT_GT(device().intervals()[0].ms, wall.count() / 10);
}

TEST_F(ComputeTest, RoundTrip) {
  const Buffer values = filled(std::vector<uint32_t>{1, 2, 3, 4, 5});
  const BindGroup bound = group(values);
  const uint64_t before = device().dispatches_recorded();
  Commands commands = device().begin();
  commands.bind(scale_, {&bound});
  for (const uint32_t factor : {3u, 7u}) {
    commands.push(factor);
    commands.dispatch(1);
    commands.barrier();
  }
  run(std::move(commands));
  EXPECT_THAT(values.as<uint32_t>(), testing::ElementsAre(21, 42, 63, 84, 105));
  EXPECT_EQ(device().dispatches_recorded() - before, 2u);
  EXPECT_EQ(device().draws_recorded(), 0u);
}

TEST_F(ComputeTest, AnUnsetBindingIsAnErrorNotACrash) {
  const BindGroup unset = value(BindGroup::create(device(), layout_));
  Commands commands = device().begin();
  commands.bind(scale_, {&unset});
  commands.push(1u);
  commands.dispatch(1);
  const Status status = device().run(std::move(commands));
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(status.message()), testing::HasSubstr("`scale`"));
}

TEST_F(ComputeTest, AWrongBindingOrPushIsAnError) {
  const Buffer values = filled(std::vector<uint32_t>{1});
  BindGroup wrong = group(values);
  wrong.set(1, values);
  Commands misbound = device().begin();
  misbound.bind(scale_, {&wrong});
  EXPECT_EQ(device().run(std::move(misbound)).code(), absl::StatusCode::kInvalidArgument);

  const BindGroup right = group(values);
  Commands pushed = device().begin();
  pushed.bind(scale_, {&right});
  pushed.push(std::array<uint32_t, 2>{1, 2});
  EXPECT_EQ(device().run(std::move(pushed)).code(), absl::StatusCode::kInvalidArgument);
}

TEST_F(ComputeTest, ABufferBeyondTheBindableRangeIsAnError) {
  const uint64_t limit = device().info().max_storage_buffer_range;
  if (limit > 1ull << 30) GTEST_SKIP() << "this device binds more than a test should allocate";
  const Buffer large = buffer(limit + 4);
  const BindGroup bound = group(large);
  Commands commands = device().begin();
  commands.bind(scale_, {&bound});
  EXPECT_EQ(device().run(std::move(commands)).code(), absl::StatusCode::kResourceExhausted);
}

TEST_F(ComputeTest, TextureArraySizedByAConstantAndIndexedAtRunTime) {
  constexpr uint32_t kTextures = 6;
  const Binding bindings[] = {{0, BindingKind::sampled_image, kTextures}, {1, BindingKind::storage_buffer}};
  const BindLayout layout = value(BindLayout::create(device(), bindings));
  const ComputePipeline pick = value(ComputePipeline::create(device(), {.name = "pick",
                                                                        .shader = pick_comp,
                                                                        .layouts = {&layout},
                                                                        .push_bytes = 4,
                                                                        .constants = {{0, kTextures}}}));
  const Sampler sampler = value(Sampler::create(device(), {}));
  const Buffer results = buffer(kTextures * 16);
  BindGroup bound = value(BindGroup::create(device(), layout));
  bound.set(1, results);
  std::vector<Image> textures;
  Commands commands = device().begin();
  for (uint32_t i = 0; i < kTextures; ++i) {
    textures.push_back(image({.width = 4, .height = 4, .format = Format::rgba32_float}));
    commands.clear(textures[i], {static_cast<float>(i), 0.5f, 0, 1});
    bound.set(0, textures[i], sampler, i);
  }
  commands.barrier();
  commands.bind(pick, {&bound});
  for (uint32_t i = 0; i < kTextures; ++i) {
    commands.push(i);
    commands.dispatch(1);
    commands.barrier();
  }
  run(std::move(commands));
  for (uint32_t i = 0; i < kTextures; ++i) {
    EXPECT_EQ(results.as<float>()[4 * i], static_cast<float>(i));
    EXPECT_EQ(results.as<float>()[4 * i + 1], 0.5f);
  }
}

}  // namespace
}  // namespace tessera::gpu
