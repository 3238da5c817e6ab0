// What a session's eyes, gaze and density change of its frames.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <map>
#include <set>

#include "scene/procedural.h"
#include "server/session.h"

namespace tessera::server {
namespace {

template <class T>
T must(StatusOr<T> value) {
  EXPECT_TRUE(value.ok()) << value.status();
  return *std::move(value);
}

SessionSettings gallery_settings() {
  SessionSettings s;
  s.client_view.width = 240;
  s.client_view.height = 180;
  s.client_view.fov = Fov::symmetric(1.3f, 4.0f / 3.0f);
  s.layout = atlas::layout_settings(atlas::LayoutKind::blocks, 512, 512);
  s.rate.bitrate_bps = 8e6;
  return s;
}

// Slightly turned outwards, as in many headsets, and each with its own field of view.
std::vector<Eye> two_eyes(double distance_m) {
  const Fov wide = Fov::symmetric(1.3f, 4.0f / 3.0f);
  std::vector<Eye> eyes{{.fov = wide}, {.fov = wide}};
  eyes[0].fov.left *= 1.2f;
  eyes[1].fov.right *= 1.2f;
  eyes[0].in_head = {{-distance_m / 2, 0, 0}, glm::angleAxis(0.05, dvec3(0, 1, 0))};
  eyes[1].in_head = {{distance_m / 2, 0, 0}, glm::angleAxis(-0.05, dvec3(0, 1, 0))};
  return eyes;
}

class SpatialSessionTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    device_ = must(gpu::Device::create({.select = "cpu", .validation = true}));
    scene_ = must(SharedScene::create(device_, scene::make_gallery(0)));
  }
  static void TearDownTestSuite() {
    scene_.reset();
    device_.reset();
  }
  void TearDown() override { EXPECT_EQ(device_->validation_messages(), 0u); }

  static std::unique_ptr<Session> session(const SessionSettings& settings) {
    return must(Session::create(scene_, settings));
  }

  // The gallery's walk, up to `now`.
  static std::vector<TimedPose> walk(TimeNs now) {
    const CameraPath path = scene::gallery_path();
    std::vector<TimedPose> poses;
    for (TimeNs t = 0; t <= now; t += from_ms(16)) poses.push_back({t, path.at(from_ms(2000) + t)});
    return poses;
  }

  static FrameInput input(FrameNumber number, std::span<const TimedPose> poses) {
    return {.number = number, .poses = poses, .round_trip_ns = from_ms(50), .scene_time_ns = 0};
  }

  static std::set<scene::PatchId> placed(const Session& session) {
    std::set<scene::PatchId> patches;
    for (const atlas::Placement& p : session.placements()) patches.insert(p.patch);
    return patches;
  }

  // Pixels of the eyes' pictures, for a head at `pose`, whose patch is not placed.
  size_t missing_pixels(const Session& session, const SessionSettings& settings, std::span<const Eye> eyes,
                        const Pose& pose) {
    if (!visibility_) {
      visibility_ = must(pvs::Visibility::create(*device_, scene_->gpu_scene(), {}));
      instant_ = must(scene::SceneInstant::create(*device_, scene_->gpu_scene()));
    }
    instant_->set(0, pose.position);
    const pvs::TriangleToPatch patch_of(scene_->scene());
    const std::set<scene::PatchId> known = placed(session);
    size_t missing = 0;
    for (const Eye& eye : eyes) {
      View view = settings.client_view;
      view.fov = eye.fov;
      view.pose = compose(pose, eye.in_head);
      for (const uint32_t id : must(visibility_->render_ids(*instant_, view)).triangle_plus_one)
        missing += id != 0 && !known.contains(patch_of[id - 1]);
    }
    return missing;
  }

  static std::shared_ptr<gpu::Device> device_;
  static std::shared_ptr<SharedScene> scene_;
  std::unique_ptr<pvs::Visibility> visibility_;
  std::unique_ptr<scene::SceneInstant> instant_;
};

std::shared_ptr<gpu::Device> SpatialSessionTest::device_;
std::shared_ptr<SharedScene> SpatialSessionTest::scene_;

TEST_F(SpatialSessionTest, WhatEitherEyeSeesIsPlaced) {
  SessionSettings settings = gallery_settings();
  settings.eyes = two_eyes(0.3);  // far apart, so that much is hidden from one of them
  const auto stereo = session(settings);
  const SessionSettings alone = gallery_settings();
  const auto mono = session(alone);
  size_t missing_from_mono = 0;
  FrameNumber n = 0;
  for (const TimeNs now : {from_ms(100), from_ms(900), from_ms(2000)}) {
    const std::vector<TimedPose> poses = walk(now);
    must(stereo->render(input(n, poses)));
    must(mono->render(input(n, poses)));
    ++n;
    EXPECT_EQ(missing_pixels(*stereo, settings, settings.eyes, poses.back().pose), 0u) << now;
    missing_from_mono += missing_pixels(*mono, settings, settings.eyes, poses.back().pose);
    EXPECT_EQ(missing_pixels(*mono, alone, {{{.fov = alone.client_view.fov}}}, poses.back().pose), 0u);
  }
  EXPECT_GT(missing_from_mono, 100u) << "else this test could not fail";
}

// The views ahead find slivers in other pixels than the client's, so a few may be missing.
TEST_F(SpatialSessionTest, WhatEitherEyeWillSeeIsPlacedToo) {
  SessionSettings settings = gallery_settings();
  settings.eyes = two_eyes(0.064);
  const auto stereo = session(settings);
  std::vector<TimedPose> poses;
  const auto head = [](TimeNs t) {  // a step to the side and a turn, both steady
    return Pose{.position = {0.8 * to_seconds(t), 1.6, 2},
                .orientation = glm::angleAxis(0.9 * to_seconds(t), dvec3(0, 1, 0))};
  };
  for (TimeNs t = 0; t <= from_ms(160); t += from_ms(16)) poses.push_back({t, head(t)});
  must(stereo->render(input(0, poses)));
  EXPECT_GT(stereo->views().size(), 4u);
  ASSERT_EQ(stereo->view_times().size(), stereo->views().size());
  const size_t pixels = size_t{2} * settings.client_view.width * settings.client_view.height;
  for (const TimeNs t : stereo->view_times())
    EXPECT_LE(missing_pixels(*stereo, settings, settings.eyes, head(t)), pixels / 1000) << t;
}

TEST_F(SpatialSessionTest, EyesShareTheViewsOfOneFrame) {
  SessionSettings settings = gallery_settings();
  settings.eyes = two_eyes(0.064);
  const auto stereo = session(settings);
  std::vector<TimedPose> poses = walk(from_ms(500));
  FrameInput late = input(0, poses);
  late.round_trip_ns = from_ms(400);
  must(stereo->render(late));
  EXPECT_EQ(stereo->views().size(), settings.prediction.max_views);
  const auto [left, right] = std::pair(stereo->views().front(), stereo->views()[stereo->views().size() / 2]);
  EXPECT_NEAR(glm::distance(left.pose.position, right.pose.position), 0.064, 1e-9);
}

// The frames of a few moments on the walk, as bytes.
std::vector<std::vector<uint8_t>> bytes_of(Session& session, std::span<const TimedPose> poses,
                                           const std::optional<vec3>& gaze = {}) {
  std::vector<std::vector<uint8_t>> bytes;
  for (FrameNumber n = 0; n < 3; ++n) {
    FrameInput input{.number = n, .poses = poses.first(poses.size() - 2 + n), .round_trip_ns = from_ms(50)};
    input.gaze = gaze;
    const Frame frame = must(session.render(input));
    bytes.push_back(frame.meta);
    bytes.push_back(frame.atlas.bytes);
  }
  return bytes;
}

TEST_F(SpatialSessionTest, OneEyeWhereTheHeadIsChangesNothing) {
  const std::vector<TimedPose> poses = walk(from_ms(300));
  SessionSettings one = gallery_settings();
  one.eyes = {{.fov = one.client_view.fov}};
  EXPECT_EQ(bytes_of(*session(one), poses), bytes_of(*session(gallery_settings()), poses));
}

TEST_F(SpatialSessionTest, NothingScalesByDefault) {
  const auto plain = session(gallery_settings());
  EXPECT_FALSE(plain->plan().includes("density"));
  SessionSettings neutral = gallery_settings();
  neutral.density.priorities = {{"root", 1}};
  const auto scaled = session(neutral);
  EXPECT_TRUE(scaled->plan().includes("density"));
  const std::vector<TimedPose> poses = walk(from_ms(300));
  const auto expected = bytes_of(*plain, poses);
  EXPECT_EQ(bytes_of(*scaled, poses), expected);
  EXPECT_EQ(bytes_of(*session(gallery_settings()), poses, vec3(0.6f, 0, -0.8f)), expected)
      << "a gaze counts only with foveation";
}

// Texels of each placed patch.
std::map<scene::PatchId, uint32_t> texels_of(const Session& session) {
  std::map<scene::PatchId, uint32_t> texels;
  for (const atlas::Placement& p : session.placements())
    texels[p.patch] += p.kind == atlas::PlacementKind::color ? 1 : static_cast<uint32_t>(p.texels());
  return texels;
}

uint64_t sum(const std::map<scene::PatchId, uint32_t>& texels) {
  uint64_t sum = 0;
  for (const auto& [patch, count] : texels) sum += count;
  return sum;
}

SessionSettings without_bias() {
  SessionSettings settings = gallery_settings();
  // So large that no block is cut to the side of a superblock.
  settings.layout = atlas::layout_settings(atlas::LayoutKind::blocks, 4096, 2048);
  settings.layout.levels.min_bias = settings.layout.levels.max_bias = 0;
  return settings;
}

TEST_F(SpatialSessionTest, FoveationSavesSamplesAndTheGazeSaysWhere) {
  const std::vector<TimedPose> poses = walk(from_ms(300));
  const auto samples = [&](bool foveated, const std::optional<vec3>& gaze) {
    SessionSettings settings = without_bias();
    // A display that shows more than the eye sees but for the middle 12 degrees.
    settings.client_view.width = 960;
    settings.client_view.height = 720;
    settings.density.foveation = foveated ? 1 : 0;
    const auto rendered = session(settings);
    FrameInput one = input(0, poses);
    one.gaze = gaze;
    must(rendered->render(one));
    return texels_of(*rendered);
  };
  const auto all = samples(false, {});
  const auto ahead = samples(true, {}), same = samples(true, vec3(0, 0, -1));
  const auto left = samples(true, vec3(-0.6f, 0, -0.8f)), right = samples(true, vec3(0.6f, 0, -0.8f));
  EXPECT_EQ(ahead, same) << "nobody's gaze is straight ahead";
  EXPECT_NE(left, right);
  for (const auto* foveated : {&ahead, &left, &right}) {
    EXPECT_LT(3 * sum(*foveated), 2 * sum(all));  // the hall has large patches, near as a whole to any gaze
    size_t kept = 0;
    for (const auto& [patch, count] : *foveated) {
      EXPECT_LE(count, all.at(patch)) << patch;
      kept += count == all.at(patch);
    }
    EXPECT_GT(kept, 0u) << "what is looked at";
  }
}

TEST_F(SpatialSessionTest, ABiasOfTwoQuartersTheSamples) {
  const std::vector<TimedPose> poses = walk(from_ms(300));
  SessionSettings full = without_bias(), quarter = without_bias();
  quarter.layout.levels.min_bias = quarter.layout.levels.max_bias = 2;
  const auto of = [&](const SessionSettings& settings) {
    const auto rendered = session(settings);
    must(rendered->render(input(0, poses)));
    return static_cast<double>(sum(texels_of(*rendered)));
  };
  EXPECT_NEAR(of(quarter) / of(full), 0.25, 0.05);
}

// Density is samples an area, so four times the density is four times the samples, in every layout.
TEST_F(SpatialSessionTest, APriorityOfFourQuadruplesAnObjectsSamples) {
  const std::shared_ptr<scene::Scene> gallery = scene::make_gallery(0);
  const auto node_of = [&](scene::PatchId patch) {
    return gallery->instances[gallery->instance_of(patch)].node;
  };
  // The node that has most samples, as those of small patches are rounded; and none below it.
  const std::vector<TimedPose> poses = walk(from_ms(300));
  const auto looking = session(without_bias());
  must(looking->render(input(0, poses)));
  std::vector<uint32_t> samples_of(gallery->nodes.size());
  for (const auto& [patch, texels] : texels_of(*looking)) samples_of[node_of(patch)] += texels;
  for (const scene::Node& node : gallery->nodes)
    if (node.parent != scene::kNone) samples_of[node.parent] = 0;
  const auto chosen = static_cast<uint32_t>(std::ranges::max_element(samples_of) - samples_of.begin());
  gallery->nodes[chosen].name = "chosen";
  const std::shared_ptr<SharedScene> named = must(SharedScene::create(device_, gallery));

  for (const atlas::LayoutKind kind :
       {atlas::LayoutKind::blocks, atlas::LayoutKind::coherent, atlas::LayoutKind::tessellated}) {
    const auto samples = [&](std::vector<atlas::ObjectPriority> priorities) {
      SessionSettings settings = without_bias();
      settings.layout.kind = kind;
      settings.density.priorities = std::move(priorities);
      const auto rendered = must(Session::create(named, settings));
      must(rendered->render(input(0, poses)));
      std::array<double, 2> sums{};  // of the others, of the chosen one
      for (const auto& [patch, texels] : texels_of(*rendered))
        sums[node_of(patch) == chosen ? 1 : 0] += texels;
      return sums;
    };
    const auto plain = samples({}), preferred = samples({{"chosen", 4}});
    EXPECT_EQ(preferred[0], plain[0]) << atlas::kLayoutNames[static_cast<size_t>(kind)];
    EXPECT_NEAR(preferred[1] / plain[1], 4, 0.8) << atlas::kLayoutNames[static_cast<size_t>(kind)];
  }
}

TEST_F(SpatialSessionTest, AnUnknownObjectIsRefused) {
  SessionSettings settings = gallery_settings();
  settings.density.priorities = {{"no such thing", 2}};
  const auto refused = Session::create(scene_, settings);
  EXPECT_EQ(refused.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(refused.status().message()), testing::HasSubstr("no such thing"));
}

// TSS sends 4 bytes an L and 16 two halves, and a byte for each of the two w ratios. A first frame places
// all.
TEST_F(SpatialSessionTest, PlacedTrianglesTakeNoMoreBitsThanInThePaper) {
  SessionSettings settings = gallery_settings();
  settings.layout = atlas::layout_settings(atlas::LayoutKind::tessellated, 1024, 512);
  const auto rendered = session(settings);
  const std::vector<TimedPose> poses = walk(from_ms(300));
  const Frame frame = must(rendered->render(input(0, poses)));
  const atlas::LayoutStats& placed = frame.stats.layout;
  const uint32_t ls = placed.blocks - placed.halves;
  EXPECT_GT(ls, 100u);
  EXPECT_GT(placed.halves, 100u);
  // Colours count for nothing: the paper has none.
  const double paper_bits = 8.0 * (6 * ls + 18 * placed.halves);
  const auto bits = static_cast<double>(frame.stats.meta_bits.placements);
  EXPECT_LT(bits, 0.5 * paper_bits);
  std::printf("%.2f of the paper's bits: %u Ls, %u pairs of halves\n", bits / paper_bits, ls, placed.halves);
}

}  // namespace
}  // namespace tessera::server
