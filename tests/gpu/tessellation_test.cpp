#include <cmath>
#include <set>

#include "gpu_test.h"
#include "shaders/patch.vert.spv.h"
#include "shaders/points.tesc.spv.h"
#include "shaders/points.tese.spv.h"
#include "shaders/scale.comp.spv.h"

namespace tessera::gpu {
namespace {

// Points in shaders/points.tese.
struct Point {
  float lambda[3];
  float owner;
};
struct Pass {
  uint32_t outer, inner, capacity;
};

constexpr uint32_t kSide = 128;         // of the image: a texel a patch
constexpr uint64_t kPointsOffset = 16;  // after the counter

class TessellationTest : public GpuTest {
 protected:
  void SetUp() override {
    ASSERT_TRUE(device().info().tessellation_stores) << "the software device can";
    constexpr Binding kBindings[] = {{0, BindingKind::storage_buffer}, {1, BindingKind::storage_image}};
    layout_ = value(BindLayout::create(device(), kBindings));
    marked_ = image({.width = kSide, .height = kSide, .format = Format::r32_uint, .storage = true});
    pipeline_ = value(TessellationPipeline::create(device(), {.name = "points",
                                                              .vertex = patch_vert,
                                                              .control = points_tesc,
                                                              .evaluation = points_tese,
                                                              .layouts = {&layout_},
                                                              .push_bytes = sizeof(Pass)}));
  }
  void TearDown() override {
    marked_ = {};
    GpuTest::TearDown();
  }

  // The points of patches first .. first + patches - 1.
  std::vector<Point> points(uint32_t outer, uint32_t inner, uint32_t patches, uint32_t first = 0) {
    constexpr uint32_t kCapacity = 1 << 17;
    const Buffer out = buffer(kPointsOffset + kCapacity * sizeof(Point), Memory::readback);
    BindGroup group = value(BindGroup::create(device(), layout_));
    group.set(0, out);
    group.set(1, marked_);
    Commands commands = device().begin();
    commands.fill(out, 0, 0, kPointsOffset);
    commands.clear(marked_, {0, 0, 0, 0});
    commands.barrier();
    commands.begin_rendering({.width = 1, .height = 1});
    commands.bind(pipeline_, {&group});
    commands.push(Pass{outer, inner, kCapacity});
    commands.draw(patches, 1, first);
    commands.end_rendering();
    run(std::move(commands));
    const uint32_t count = out.as<uint32_t>()[0];
    EXPECT_LE(count, kCapacity);
    const auto* begin = reinterpret_cast<const Point*>(out.mapped() + kPointsOffset);
    return {begin, begin + std::min(count, kCapacity)};
  }

  BindLayout layout_;
  Image marked_;
  TessellationPipeline pipeline_;
};

TEST_F(TessellationTest, EvaluatesEveryPointOfAPatchOnce) {
  for (const uint32_t level : {1u, 2u, 3u, 7u, 64u}) {
    const auto found = points(level, level, 1);
    std::set<std::array<int, 3>> places;
    size_t corners = 0;
    for (const Point& p : found) {
      EXPECT_NEAR(p.lambda[0] + p.lambda[1] + p.lambda[2], 1, 1e-4f);
      std::array<int, 3> place{};
      for (int i = 0; i < 3; ++i) {
        EXPECT_TRUE(p.lambda[i] >= 0 && p.lambda[i] <= 1);
        place[i] = static_cast<int>(std::lround(p.lambda[i] * 6 * static_cast<float>(level)));
        corners += p.lambda[i] == 1;
      }
      places.insert(place);
    }
    // 3/4 (level + 1)^2, rounded up.
    EXPECT_EQ(found.size(), (3 * (level + 1) * (level + 1) + 3) / 4) << level;
    EXPECT_EQ(places.size(), found.size()) << level;
    EXPECT_EQ(corners, 3u) << level;
  }
}

TEST_F(TessellationTest, OuterAndInnerLevelsAreApart) {
  EXPECT_EQ(points(5, 2, 1).size(), 3u * 5 + 1);
  EXPECT_EQ(points(1, 4, 1).size(), 3u + 3 * 2 + 1);
}

TEST_F(TessellationTest, PatchesKnowTheirVertexAndStoreIntoImages) {
  constexpr uint32_t kFirst = 3, kPatches = 10'000;  // old lavapipe counts gl_PrimitiveID to 4096 only
  const auto found = points(1, 1, kPatches, kFirst);
  EXPECT_EQ(found.size(), 3u * kPatches);
  std::vector<uint32_t> of(kFirst + kPatches);
  for (const Point& p : found) ++of.at(static_cast<size_t>(p.owner));
  for (uint32_t i = 0; i < of.size(); ++i) ASSERT_EQ(of[i], i < kFirst ? 0u : 3u) << i;
  const auto marks = read<uint32_t>(marked_, kSide * kSide);
  for (uint32_t i = 0; i < marks.size(); ++i)
    ASSERT_EQ(marks[i], i >= kFirst && i < kFirst + kPatches ? i + 1 : 0) << i;
}

// One dispatch in the interval, and nothing that would wait for it: the shortest of several runs.
TEST_F(TessellationTest, AnIntervalAfterwardsHoldsItsDispatch) {
  constexpr uint32_t kGroups = 1 << 15;
  const Binding binding{0, BindingKind::storage_buffer};
  const BindLayout layout = value(BindLayout::create(device(), {&binding, 1}));
  const auto scale = value(ComputePipeline::create(
      device(), {.name = "scale", .shader = scale_comp, .layouts = {&layout}, .push_bytes = 4}));
  const Buffer values = buffer(uint64_t{64} * kGroups * sizeof(uint32_t));
  BindGroup group = value(BindGroup::create(device(), layout));
  group.set(0, values);
  points(4, 4, 1);
  const auto shortest = [&](uint32_t groups) {
    double ms = 1e9;
    for (int i = 0; i < 10; ++i) {
      Commands commands = device().begin();
      commands.begin_interval("dispatch");
      commands.bind(scale, {&group});
      commands.push(3u);
      commands.dispatch(groups);
      commands.end_interval();
      run(std::move(commands));
      ms = std::min(ms, device().intervals().front().ms);
    }
    return ms;
  };
  EXPECT_GT(shortest(kGroups), 10 * shortest(1));
}

TEST_F(TessellationTest, DrawsOnlyWithinRendering) {
  Commands commands = device().begin();
  commands.draw(1);
  EXPECT_EQ(device().run(std::move(commands)).code(), absl::StatusCode::kFailedPrecondition);
}

}  // namespace
}  // namespace tessera::gpu
