#include "scene/gpu_scene.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <set>

#include "scene/texture_arrays.h"
#include "scenes.h"

namespace tessera::scene {
namespace {

Texture texture(uint32_t width, uint32_t height, bool srgb = false, WrapMode wrap = WrapMode::repeat) {
  Texture t{.width = width, .height = height, .rgba = std::vector<uint8_t>(size_t{4} * width * height, 128)};
  t.srgb = srgb;
  t.wrap_u = wrap;
  return t;
}

void expect_complete(const std::vector<TextureArrayPlan>& plan, size_t textures) {
  std::set<uint32_t> seen;
  for (const auto& array : plan) {
    EXPECT_FALSE(array.textures.empty());
    for (const uint32_t t : array.textures) EXPECT_TRUE(seen.insert(t).second) << "texture " << t << " twice";
  }
  EXPECT_EQ(seen.size(), textures);
}

TEST(TextureArrays, GroupBySizeEncodingAndSampler) {
  std::vector<Texture> textures{texture(8, 8), texture(8, 8, true), texture(8, 4), texture(8, 8),
                                texture(8, 8, false, WrapMode::clamp_to_edge)};
  textures.push_back(texture(8, 8));
  textures.back().nearest = true;
  const auto plan = plan_texture_arrays(textures, 16);
  ASSERT_EQ(plan.size(), 5u);
  EXPECT_THAT(plan[0].textures, testing::ElementsAre(0, 3));
  expect_complete(plan, textures.size());
}

TEST(TextureArrays, MergeTheSmallestIntoTheNearestSizeOfTheirKind) {
  std::vector<Texture> textures;
  for (const uint32_t size : {1u, 2u, 4u, 8u, 16u, 32u, 64u, 128u}) textures.push_back(texture(size, size));
  textures.push_back(texture(1, 1, true));
  const auto plan = plan_texture_arrays(textures, 4);
  ASSERT_EQ(plan.size(), 4u);
  expect_complete(plan, textures.size());
  const auto is_alone = [&](uint32_t t) {
    return std::ranges::any_of(
        plan, [&](const TextureArrayPlan& a) { return a.textures == std::vector<uint32_t>{t}; });
  };
  EXPECT_TRUE(is_alone(7) && is_alone(6)) << "the large ones keep their size";
  EXPECT_TRUE(is_alone(8)) << "no other array has its encoding";
}

TEST(TextureArrays, MixSamplersOnlyIfNothingElseIsLeftAndNeverEncodings) {
  std::vector<Texture> textures;
  for (const bool srgb : {false, true}) {
    for (const bool nearest : {false, true}) {
      for (const auto u : {WrapMode::repeat, WrapMode::mirrored_repeat, WrapMode::clamp_to_edge}) {
        for (const auto v : {WrapMode::repeat, WrapMode::mirrored_repeat, WrapMode::clamp_to_edge}) {
          textures.push_back(texture(4, 4, srgb, u));
          textures.back().wrap_v = v;
          textures.back().nearest = nearest;
        }
      }
    }
  }
  for (const uint32_t limit : {2u, 16u, 40u}) {
    const auto plan = plan_texture_arrays(textures, limit);
    EXPECT_EQ(plan.size(), std::min<size_t>(limit, textures.size()));
    expect_complete(plan, textures.size());
    for (const auto& array : plan) {
      for (const uint32_t t : array.textures) EXPECT_EQ(textures[t].srgb, array.kind.srgb);
    }
  }
}

class GpuSceneTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    auto device = gpu::Device::create({.select = "cpu", .validation = true});
    ASSERT_TRUE(device.ok()) << device.status();
    device_ = *device;
  }
  static void TearDownTestSuite() { device_.reset(); }
  void TearDown() override { EXPECT_EQ(device_->validation_messages(), 0u); }

  std::unique_ptr<GpuScene> upload(std::shared_ptr<const Scene> scene) {
    auto made = GpuScene::create(*device_, std::move(scene));
    EXPECT_TRUE(made.ok()) << made.status();
    return std::move(*made);
  }

  std::vector<uint32_t> read(const gpu::Buffer& buffer) {
    auto copy = gpu::Buffer::create(*device_, buffer.size(), gpu::Memory::readback, "copy");
    EXPECT_TRUE(copy.ok());
    gpu::Commands commands = device_->begin();
    commands.copy(buffer, 0, *copy, 0, buffer.size());
    commands.barrier();
    EXPECT_TRUE(device_->run(std::move(commands)).ok());
    const auto words = copy->as<const uint32_t>();
    return {words.begin(), words.end()};
  }

  static std::shared_ptr<gpu::Device> device_;
};
std::shared_ptr<gpu::Device> GpuSceneTest::device_;

TEST_F(GpuSceneTest, IndicesAreGlobalAndGeometriesFollowEachOther) {
  pvs::SceneBuilder b;
  const uint32_t box = b.box(3), quad = b.quad(2), m = b.material({});
  b.place(box, m, dmat4(1));
  b.place(quad, m, dmat4(1));
  b.place(box, m, dmat4(1));
  const auto scene = b.finish();
  const auto gpu_scene = upload(scene);
  const Geometry &first = scene->geometries[0], &second = scene->geometries[1];
  EXPECT_EQ(gpu_scene->first_index(0), 0u);
  EXPECT_EQ(gpu_scene->first_index(1), first.indices.size());
  const auto indices = read(gpu_scene->indices());
  for (size_t i = 0; i < first.indices.size(); ++i) EXPECT_EQ(indices[i], first.indices[i]);
  for (size_t i = 0; i < second.indices.size(); ++i) {
    EXPECT_EQ(indices[first.indices.size() + i], second.indices[i] + first.vertices.size());
  }
  EXPECT_EQ(gpu_scene->instanced_meshlet_count(), 2 * first.meshlets.size() + second.meshlets.size());
  EXPECT_GT(gpu_scene->device_bytes(), 64 * (first.vertices.size() + second.vertices.size()));
}

TEST_F(GpuSceneTest, MemoryIsGivenBack) {
  const uint64_t before = device_->memory_in_use();
  upload(pvs::make_town(3, true));
  EXPECT_EQ(device_->memory_in_use(), before);
}

TEST_F(GpuSceneTest, EveryTextureKindUploads) {
  pvs::SceneBuilder b;
  for (const uint32_t size : {1u, 3u, 16u, 37u}) {
    for (const bool srgb : {false, true}) b.texture(texture(size, 2 * size, srgb));
  }
  for (uint32_t i = 1; i <= 20; ++i) b.texture(texture(i, 1, true));
  b.place(b.quad(), b.material({}), dmat4(1));
  const auto gpu_scene = upload(b.finish());
  ASSERT_EQ(gpu_scene->constants().size(), 1u);
  EXPECT_LE(gpu_scene->constants()[0].value, kMaxTextureArrays);
}

TEST_F(GpuSceneTest, ATextureOfTheWrongSizeIsAnError) {
  pvs::SceneBuilder b;
  Texture bad = texture(4, 4);
  bad.rgba.pop_back();
  b.texture(bad);
  EXPECT_EQ(GpuScene::create(*device_, b.finish()).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST_F(GpuSceneTest, ASceneLargerThanABufferIsRefusedWithoutUpload) {
  const uint64_t limit = device_->info().max_storage_buffer_range;
  if (limit > uint64_t{1} << 30) GTEST_SKIP() << "this device allows buffers of " << (limit >> 20) << " MiB";
  pvs::SceneBuilder b;
  const uint32_t quad = b.quad();
  b.scene().geometries[quad].vertices.resize(limit / sizeof(Vertex) + 1);
  const Status status = GpuScene::create(*device_, b.finish()).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_THAT(std::string(status.message()), testing::HasSubstr("vertices"));
}

TEST_F(GpuSceneTest, AnInstantHoldsTheWorldMatricesOfItsTime) {
  pvs::SceneBuilder b;
  const uint32_t quad = b.quad(), m = b.material({});
  b.place(quad, m, pvs::transform({1, 2, 3}, {1, -2, 1}, 0.5));
  b.place(quad, m, dmat4(1), true);
  Scene& s = b.scene();
  s.nodes[1].matrix.reset();
  s.animations.push_back(
      {1, AnimationPath::translation, Interpolation::linear, {0, 1}, {vec4(0), vec4(10, 0, 0, 0)}});
  s.animation_length_s = 1;
  const auto gpu_scene = upload(b.finish());
  auto instant = SceneInstant::create(*device_, *gpu_scene);
  ASSERT_TRUE(instant.ok());
  (*instant)->set(kNsPerSecond / 4, dvec3(5));
  EXPECT_EQ((*instant)->origin(), dvec3(5));
  EXPECT_EQ((*instant)->time_ns(), kNsPerSecond / 4);
  EXPECT_EQ((*instant)->instance_transforms()[0], *s.nodes[0].matrix);
  EXPECT_NEAR((*instant)->instance_transforms()[1][3].x, 2.5, 1e-9);
  (*instant)->set(kNsPerSecond / 2, dvec3(5));
  EXPECT_NEAR((*instant)->instance_transforms()[1][3].x, 5, 1e-9);
  EXPECT_EQ((*instant)->instance_transforms()[0], *s.nodes[0].matrix);
}

}  // namespace
}  // namespace tessera::scene
