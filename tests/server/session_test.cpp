#include "server/session.h"

#include <gtest/gtest.h>

#include <cstdlib>

#include "codec/atlas_decoder.h"
#include "codec/video_decoder.h"
#include "scene/procedural.h"

namespace tessera::server {
namespace {

// A quad in front of the origin, facing it.
std::shared_ptr<scene::Scene> make_quad() {
  auto s = std::make_shared<scene::Scene>();
  scene::Geometry g;
  for (const vec3 p : {vec3{-1, -1, -3}, vec3{1, -1, -3}, vec3{-1, 1, -3}, vec3{1, 1, -3}}) {
    scene::Vertex v{};
    v.position = p;
    v.normal = {0, 0, 1};
    v.tangent = {1, 0, 0, 1};
    v.color = 0xffffffffu;
    g.vertices.push_back(v);
    g.bounds.add(p);
  }
  g.indices = {0, 1, 2, 3, 2, 1};
  g.patches = {{0, 2}};
  g.meshlets = {{0, 2, 0, 1, {0, 0, -3}, 1.5f}};
  s->geometries.push_back(g);
  s->materials.emplace_back();
  s->nodes.emplace_back();
  s->instances = {{0, 0, 0}};
  return s;
}

SessionSettings small_settings() {
  SessionSettings s;
  s.client_view.width = 320;
  s.client_view.height = 180;
  s.client_view.fov = Fov::symmetric(1.0f, 16.0f / 9.0f);
  s.layout = atlas::layout_settings(atlas::LayoutKind::blocks, 512, 256);
  s.rate.bitrate_bps = 8e6;
  return s;
}

template <class T>
T must(StatusOr<T> value) {
  EXPECT_TRUE(value.ok()) << value.status();
  return *std::move(value);
}

std::shared_ptr<gpu::Device> shared_device;

std::shared_ptr<gpu::Device> device() {
  if (!shared_device) shared_device = must(gpu::Device::create({.select = "cpu", .validation = true}));
  return shared_device;
}

struct Counters {
  uint64_t dispatches = device()->dispatches_recorded(), draws = device()->draws_recorded();
};

FrameInput input(FrameNumber number, std::span<const TimedPose> poses) {
  return {.number = number, .poses = poses, .round_trip_ns = 100 * kNsPerMs};
}

class SessionTest : public testing::Test {
 protected:
  void TearDown() override { EXPECT_EQ(device()->validation_messages(), 0u); }
  // Not at exit: what the validation layer says about leftovers must still fail the run.
  static void TearDownTestSuite() { shared_device.reset(); }
};

TEST_F(SessionTest, FramesDecodeOnTheOtherSide) {
  auto quad = make_quad();
  quad->index_instances();
  auto session = must(Session::create(must(SharedScene::create(device(), quad)), small_settings()));
  auto decoder = must(codec::VideoDecoder::create());
  const std::vector<TimedPose> poses = {{0, Pose{}}};
  for (FrameNumber n = 0; n < 4; ++n) {
    const Frame frame = must(session->render(input(n, poses)));
    EXPECT_EQ(frame.atlas.key_frame, n == 0);
    const auto decoded = must(decoder->decode(frame.atlas.bytes));
    EXPECT_EQ(decoded.frame, n);
    EXPECT_EQ(decoded.picture.width, 512u);
    geometry_compression::MetaFrame meta;
    EXPECT_EQ(geometry_compression::decode(frame.meta, meta), "");
    EXPECT_EQ(meta.frame, n);
    EXPECT_EQ(meta.full_state, n == 0);
    EXPECT_EQ(meta.patches.size(), n == 0 ? 1u : 0u);
    EXPECT_EQ(meta.placements.size(), n == 0 ? 1u : 0u) << "a still view moves nothing";
  }
  EXPECT_EQ(session->placements().size(), 1u);
}

// Raw is the converter's planes to the byte. JPEG need be like them only where samples lie.
TEST_F(SessionTest, PicturesThatStandByThemselvesDecodeInAnyOrder) {
  for (const AtlasCodec codec : {AtlasCodec::jpeg, AtlasCodec::raw}) {
    auto quad = make_quad();
    quad->index_instances();
    SessionSettings settings = small_settings();
    settings.codec = codec;
    auto session = must(Session::create(must(SharedScene::create(device(), quad)), settings));
    auto decoder = must(codec::AtlasDecoder::create(codec));
    const std::vector<TimedPose> poses = {{0, Pose{}}};
    std::vector<Frame> frames;
    for (FrameNumber n = 0; n < 3; ++n) frames.push_back(must(session->render(input(n, poses))));
    ASSERT_EQ(session->placements().size(), 1u);
    const atlas::Placement placed = session->placements()[0];
    const YuvView coded = session->yuv();
    for (const FrameNumber n : {2u, 0u, 1u}) {
      EXPECT_TRUE(frames[n].atlas.key_frame);
      const auto decoded = must(decoder->decode(frames[n].atlas.bytes));
      EXPECT_EQ(decoded.frame, n);
      ASSERT_EQ(decoded.picture.width, 512u);
      int largest = 0;
      for (uint32_t y = placed.y; y < placed.y + placed.height; ++y)
        for (uint32_t x = placed.x; x < placed.x + placed.width; ++x)
          largest = std::max(largest, std::abs(coded.y[size_t{y} * coded.y_stride + x] -
                                               decoded.picture.y[size_t{y} * decoded.picture.y_stride + x]));
      EXPECT_LE(largest, codec == AtlasCodec::raw ? 0 : 4) << name_of(codec);
    }
    if (codec == AtlasCodec::jpeg) {
      EXPECT_LT(frames[0].atlas.bytes.size(), 2500u) << "one block of the atlas is used";
      EXPECT_EQ(frames[0].atlas.bytes.size(), frames[2].atlas.bytes.size())
          << "no frame costs more than another";
    }
  }
}

TEST_F(SessionTest, KeyFrameOnRequest) {
  auto quad = make_quad();
  quad->index_instances();
  auto session = must(Session::create(must(SharedScene::create(device(), quad)), small_settings()));
  const std::vector<TimedPose> poses = {{0, Pose{}}};
  must(session->render(input(0, poses)));
  FrameInput second = input(1, poses);
  second.key_frame = true;
  EXPECT_TRUE(must(session->render(second)).atlas.key_frame);
}

TEST_F(SessionTest, EqualInputsGiveEqualBytes) {
  auto gallery = scene::make_gallery(0);
  auto shared = must(SharedScene::create(device(), gallery));
  const CameraPath path = scene::gallery_path();
  auto run = [&] {
    auto session = must(Session::create(shared, small_settings()));
    std::vector<std::vector<uint8_t>> bytes;
    std::vector<TimedPose> poses;
    for (FrameNumber n = 0; n < 4; ++n) {
      poses.push_back({from_ms(33 * n), path.at(from_ms(33 * n))});
      const Frame frame = must(session->render(input(n, poses)));
      bytes.push_back(frame.meta);
      bytes.push_back(frame.atlas.bytes);
    }
    return bytes;
  };
  EXPECT_EQ(run(), run());
}

// What a frame costs must not grow with how late it is, or a server that falls behind falls ever further.
TEST_F(SessionTest, MoreLatencyMeansWiderSpacedViewsUpToTheHorizon) {
  auto quad = make_quad();
  quad->index_instances();
  auto session = must(Session::create(must(SharedScene::create(device(), quad)), small_settings()));
  const std::vector<TimedPose> poses = {{0, Pose{}}, {from_ms(33), Pose{.position = {0.1, 0, 0}}}};
  size_t before = 0;
  for (FrameNumber n = 0; const double round_trip_ms : {20, 100, 180, 300, 1000}) {
    FrameInput moving = input(n++, poses);
    moving.round_trip_ns = from_ms(round_trip_ms);
    must(session->render(moving));
    EXPECT_LE(session->views().size(), 8u) << round_trip_ms;
    EXPECT_GE(session->views().size(), before) << round_trip_ms;
    before = session->views().size();
    ASSERT_EQ(session->view_times().size(), before);
    EXPECT_EQ(session->view_times().back(), poses.back().time_ns + session->horizon_ns()) << round_trip_ms;
  }
  EXPECT_GT(before, 4u);
}

// The visible set must last until the next frame, whenever that comes.
TEST_F(SessionTest, ALongerIntervalReachesFurther) {
  auto quad = make_quad();
  quad->index_instances();
  auto session = must(Session::create(must(SharedScene::create(device(), quad)), small_settings()));
  const std::vector<TimedPose> poses = {{0, Pose{}}, {from_ms(33), Pose{.position = {0.1, 0, 0}}}};
  must(session->render(input(0, poses)));
  EXPECT_EQ(session->horizon_ns(), from_ms(100) + from_seconds(1.0 / 30));
  FrameInput late = input(1, poses);
  late.interval_ns = from_ms(500);
  must(session->render(late));
  EXPECT_EQ(session->horizon_ns(), from_ms(600));
}

TEST_F(SessionTest, RefusesAFrameWithoutPoses) {
  auto quad = make_quad();
  quad->index_instances();
  auto session = must(Session::create(must(SharedScene::create(device(), quad)), small_settings()));
  EXPECT_EQ(session->render(input(0, {})).status().code(), absl::StatusCode::kInvalidArgument);
}

// What a scene does not need must record nothing and hold no memory (the frame plan's promise).
struct Cost {
  uint64_t dispatches, draws, bytes;
  uint32_t shadow_maps;
};

Cost cost_of(std::shared_ptr<scene::Scene> s) {
  s->index_instances();
  const uint64_t bytes_before = device()->memory_in_use();
  auto shared = must(SharedScene::create(device(), s));
  auto session = must(Session::create(shared, small_settings()));
  const uint64_t bytes = device()->memory_in_use() - bytes_before;
  const Counters before;
  const std::vector<TimedPose> poses = {{0, Pose{}}};
  must(session->render(input(0, poses)));
  const Counters after;
  return {after.dispatches - before.dispatches, after.draws - before.draws, bytes,
          shared->lighting().shadow_maps()};
}

TEST_F(SessionTest, OmittedPassesCostNothing) {
  const Cost plain = cost_of(make_quad());
  EXPECT_EQ(plain.shadow_maps, 0u);

  auto sunny = make_quad();
  sunny->lights.push_back({.type = scene::LightType::directional, .intensity = 3, .node = 0});
  const Cost sun = cost_of(sunny);
  EXPECT_EQ(sun.shadow_maps, 1u);
  EXPECT_GT(sun.draws, plain.draws);
  EXPECT_GT(sun.bytes, plain.bytes);

  auto leaves = make_quad();
  leaves->materials[0].alpha_mode = scene::AlphaMode::mask;
  const Cost masked = cost_of(leaves);
  EXPECT_EQ(masked.shadow_maps, 0u);

  auto point_lit = make_quad();
  point_lit->lights.push_back({.type = scene::LightType::point, .intensity = 3, .node = 0});
  const Cost point = cost_of(point_lit);
  EXPECT_EQ(point.draws, plain.draws) << "a light without shadow adds no pass";
  EXPECT_EQ(point.dispatches, plain.dispatches);
}

}  // namespace
}  // namespace tessera::server
