#include "pvs/visibility.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <set>

#include "pvs/buckets.h"
#include "scene/procedural.h"
#include "scenes.h"

namespace tessera::pvs {
namespace {

View view_from(const dvec3& eye, const dvec3& at, float fov_y_rad = 1.0f, uint32_t width = 160,
               uint32_t height = 90) {
  const dvec3 ahead = glm::normalize(at - eye);
  const dvec3 up = std::abs(ahead.y) > 0.99 ? dvec3(0, 0, 1) : dvec3(0, 1, 0);
  return {.pose = {eye, glm::quatLookAt(ahead, up)},
          .fov = Fov::symmetric(fov_y_rad, float(width) / float(height)),
          .width = width,
          .height = height};
}

// A device for the whole suite; every test checks that the validation layer had nothing to say.
class VisibilityTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    auto device = gpu::Device::create({.select = "cpu", .validation = true});
    ASSERT_TRUE(device.ok()) << device.status();
    device_ = *device;
  }
  static void TearDownTestSuite() { device_.reset(); }
  void TearDown() override { EXPECT_EQ(device_->validation_messages(), 0u); }

  void load(std::shared_ptr<const scene::Scene> scene, const dvec3& origin = dvec3(0)) {
    auto uploaded = scene::GpuScene::create(*device_, std::move(scene));
    ASSERT_TRUE(uploaded.ok()) << uploaded.status();
    gpu_scene_ = std::move(*uploaded);
    auto instant = scene::SceneInstant::create(*device_, *gpu_scene_);
    ASSERT_TRUE(instant.ok()) << instant.status();
    instant_ = std::move(*instant);
    instant_->set(0, origin);
  }

  std::unique_ptr<Visibility> make(const VisibilitySettings& settings = {}) {
    auto made = Visibility::create(*device_, *gpu_scene_, settings);
    EXPECT_TRUE(made.ok()) << made.status();
    return std::move(*made);
  }

  IdBuffer ids(Visibility& visibility, const View& view) {
    auto out = visibility.render_ids(*instant_, view);
    EXPECT_TRUE(out.ok()) << out.status();
    return std::move(*out);
  }

  scene::VisiblePatches determine(Visibility& visibility, std::vector<View> views) {
    auto out = visibility.determine(*instant_, views, views.front());
    EXPECT_TRUE(out.ok()) << out.status();
    return std::move(*out);
  }

  const scene::Scene& scene() const { return gpu_scene_->scene(); }

  static std::shared_ptr<gpu::Device> device_;
  std::unique_ptr<scene::GpuScene> gpu_scene_;
  std::unique_ptr<scene::SceneInstant> instant_;
};
std::shared_ptr<gpu::Device> VisibilityTest::device_;

size_t differing_pixels(const IdBuffer& a, const IdBuffer& b) {
  size_t n = 0;
  for (size_t i = 0; i < a.triangle_plus_one.size(); ++i)
    n += a.triangle_plus_one[i] != b.triangle_plus_one[i];
  return n;
}

size_t covered_pixels(const IdBuffer& a) {
  return a.triangle_plus_one.size() -
         static_cast<size_t>(std::count(a.triangle_plus_one.begin(), a.triangle_plus_one.end(), 0u));
}

std::vector<View> views_of_town() {
  std::vector<View> views;
  for (int i = 0; i < 6; ++i) {
    const double a = i * 1.05;
    views.push_back(view_from({12 * std::cos(a), 1.5 + i, 12 * std::sin(a)}, {0, 1, 0}));
  }
  views.push_back(view_from({0.3, 1.2, 0.2}, {5, 1, 3}));      // inside a house or close to it
  views.push_back(view_from({-4, 1.6, -4}, {4, 1, 5}, 1.9f));  // in the streets: walls cross the near plane
  views.push_back(view_from({2, 40, 1}, {2, 0, 1}));           // from above
  views.push_back(view_from({20, 2, 20}, {0, 1, 0}, 0.0174533f));
  views.push_back(view_from({3, 1.7, 9}, {0, 1, 0}, 3.124f));
  View lopsided = view_from({9, 3, -9}, {0, 1, 0});
  lopsided.fov = {-0.2f, 1.4f, -0.9f, 0.1f};
  views.push_back(lopsided);
  View beside = lopsided;  // the view's axis is outside its frustum
  beside.fov = {0.2f, 0.9f, -0.5f, 0.3f};
  views.push_back(beside);
  return views;
}

TEST_F(VisibilityTest, CullingDoesNotChangeAPixel) {
  load(make_town(6, true));
  const auto everything = make({.frustum_culling = false, .occlusion_culling = false});
  const auto frustum = make({.frustum_culling = true, .occlusion_culling = false});
  const auto occlusion = make({.frustum_culling = false, .occlusion_culling = true});
  const auto both = make();
  size_t v = 0;
  for (const View& view : views_of_town()) {
    const IdBuffer want = ids(*everything, view);
    EXPECT_EQ(differing_pixels(want, ids(*frustum, view)), 0u) << "view " << v;
    EXPECT_EQ(differing_pixels(want, ids(*occlusion, view)), 0u) << "view " << v;
    EXPECT_EQ(differing_pixels(want, ids(*both, view)), 0u) << "view " << v;
    // Again, with what the last view saw right.
    EXPECT_EQ(differing_pixels(want, ids(*both, view)), 0u) << "view " << v;
    EXPECT_LE(both->stats().triangles_drawn, everything->stats().triangles_drawn);
    ++v;
  }
}

TEST_F(VisibilityTest, CullingDoesNotChangeWhatIsSeenOfACity) {
  load(scene::make_city(100'000));
  const auto everything = make({.frustum_culling = false, .occlusion_culling = false});
  const auto both = make();
  const CameraPath path = scene::city_path();
  uint64_t drawn = 0, all = 0;
  for (int i = 0; i < 6; ++i) {
    View view = view_from({0, 0, 0}, {0, 0, -1}, 1.0f, 320, 180);
    view.pose = path.at(path.poses().front().time_ns + i * path.duration_ns() / 6);
    instant_->set(0, view.pose.position);
    EXPECT_EQ(differing_pixels(ids(*everything, view), ids(*both, view)), 0u) << "view " << i;
    drawn += both->stats().triangles_drawn;
    all += everything->stats().triangles_drawn;
  }
  EXPECT_LT(drawn, all / 2);
}

TEST_F(VisibilityTest, TheUnionIsWhatTheViewsShow) {
  load(make_town(5, true));
  const auto culled = make();
  const auto everything = make({.frustum_culling = false, .occlusion_culling = false});
  const TriangleToPatch patch_of(scene());
  const std::vector<View> views = views_of_town();
  std::set<scene::PatchId> want;
  for (const View& view : views) {
    for (const uint32_t id : ids(*everything, view).triangle_plus_one) {
      if (id != 0) want.insert(patch_of[id - 1]);
    }
  }
  const scene::VisiblePatches got = determine(*culled, views);
  std::set<scene::PatchId> got_ids;
  for (size_t i = 0; i < got.size(); ++i) {
    got_ids.insert(got[i].patch);
    EXPECT_TRUE(i == 0 || got[i - 1].patch < got[i].patch);
    EXPECT_TRUE(std::isfinite(got[i].footprint.area_px2));
  }
  EXPECT_EQ(got_ids, want);
  EXPECT_EQ(culled->stats().views, views.size());
}

TEST_F(VisibilityTest, RunsRepeatExactly) {
  load(make_town(5, true));
  const std::vector<View> views = views_of_town();
  const auto a = make(), b = make();
  const auto first = determine(*a, views), second = determine(*b, views), again = determine(*a, views);
  for (const auto* other : {&second, &again}) {
    ASSERT_EQ(first.size(), other->size());
    for (size_t i = 0; i < first.size(); ++i) {
      EXPECT_EQ(first[i].patch, (*other)[i].patch);
      EXPECT_EQ(first[i].footprint.area_px2, (*other)[i].footprint.area_px2);
    }
  }
}

TEST_F(VisibilityTest, FootprintsAreTheLargestOverTheEyes) {
  SceneBuilder b;
  b.place(b.quad(), b.material({}), dmat4(1));
  load(b.finish());
  const auto visibility = make();
  const View far = view_from({0, 0, 20}, {0, 0, 0}), near = view_from({0, 0, 10}, {0, 0, 0});
  const auto want = footprint(scene().geometries[0], scene().geometries[0].patches[0], dmat4(1), {0, 0, 10},
                              far.pixels_per_radian());
  for (const std::vector<View>& views : {std::vector<View>{far, near}, {near, far}, {far, far, near}}) {
    const auto seen = determine(*visibility, views);
    ASSERT_EQ(seen.size(), 1u);
    EXPECT_EQ(seen[0].footprint.area_px2, want.area_px2);
    EXPECT_EQ(seen[0].footprint.u_px, want.u_px);
  }
}

TEST_F(VisibilityTest, OcclusionCullingDrawsLess) {
  SceneBuilder b;
  const uint32_t stone = b.material({}), box = b.box(8);
  b.place(b.quad(), stone, transform({0, 0, 5}, {20, 20, 1}));  // hides all that follows
  for (int i = 0; i < 50; ++i) b.place(box, stone, transform({-10 + 0.4 * i, 0, -4.0 - i}, dvec3(0.8)));
  load(b.finish());
  const View view = view_from({0, 0, 12}, {0, 0, 0});
  const auto culled = make();
  const auto frustum = make({.frustum_culling = true, .occlusion_culling = false});
  ids(*frustum, view);
  const IdBuffer first = ids(*culled, view);  // nothing is known yet: all is drawn
  ids(*culled, view);                         // all was visible, and turns out not to be
  EXPECT_EQ(differing_pixels(first, ids(*culled, view)), 0u);
  EXPECT_GT(frustum->stats().triangles_drawn, 20'000u);
  EXPECT_EQ(culled->stats().triangles_drawn, 2u);
  EXPECT_EQ(culled->stats().meshlets_drawn, 1u);
}

TEST_F(VisibilityTest, FrustumCullingDrawsLess) {
  SceneBuilder b;
  const uint32_t stone = b.material({}), box = b.box(8);
  for (int i = 0; i < 32; ++i)
    b.place(box, stone,
            transform({10 * std::cos(i * 0.19634954), 0, 10 * std::sin(i * 0.19634954)}, dvec3(0.5)));
  load(b.finish());
  const auto frustum = make({.frustum_culling = true, .occlusion_culling = false});
  ids(*frustum, view_from({0, 0, 0}, {1, 0, 0}, 0.8f, 90, 90));
  EXPECT_LT(frustum->stats().triangles_drawn, scene().triangle_count / 4);
  EXPECT_GT(frustum->stats().triangles_drawn, 0u);
}

// A hidden thing that comes into view must be drawn in that very view, not one later.
TEST_F(VisibilityTest, NewlyVisibleThingsAppearAtOnce) {
  load(make_town(6, false));
  const auto both = make();
  const auto everything = make({.frustum_culling = false, .occlusion_culling = false});
  for (int i = 0; i < 12; ++i) {  // jumps from view to view
    const double a = i * 2.4;
    const View view = view_from({9 * std::cos(a), 1.6, 9 * std::sin(a)}, {-3 * std::cos(a), 1, 0}, 1.2f);
    EXPECT_EQ(differing_pixels(ids(*both, view), ids(*everything, view)), 0u) << i;
  }
}

TEST_F(VisibilityTest, FarFromTheOriginNothingIsLost) {
  SceneBuilder b;
  const uint32_t stone = b.material({});
  const dvec3 far(1e7, -2e6, 5e6);
  const uint32_t box = b.box(4);
  for (int i = 0; i < 8; ++i)
    b.place(box, stone, transform(far + dvec3(3 * i - 12, 0, -6), {1, 1.5, 0.7}, i));
  load(b.finish(), far);
  const View view = view_from(far, far + dvec3(0, 0, -1), 1.2f);
  const auto both = make();
  const auto everything = make({.frustum_culling = false, .occlusion_culling = false});
  const IdBuffer want = ids(*everything, view);
  EXPECT_GT(covered_pixels(want), 1000u);
  EXPECT_EQ(differing_pixels(want, ids(*both, view)), 0u);
}

// Pixel centres against rays through them.
TEST_F(VisibilityTest, IdsAreThoseOfTheTrianglesThatRaysHit) {
  load(make_town(2, false));
  const View view = view_from({5, 3, 6}, {0, 0.5, 0}, 1.0f, 64, 48);
  const IdBuffer got = ids(*make(), view);
  const auto world = scene().node_transforms(0);
  size_t wrong = 0;
  for (uint32_t y = 0; y < view.height; ++y) {
    for (uint32_t x = 0; x < view.width; ++x) {
      const dvec3 in_camera(view.fov.left + (x + 0.5) / view.width * (view.fov.right - view.fov.left),
                            view.fov.up - (y + 0.5) / view.height * (view.fov.up - view.fov.down), -1);
      const dvec3 ray = view.pose.orientation * in_camera;
      double nearest = std::numeric_limits<double>::infinity();
      uint32_t want = 0;
      for (const scene::Instance& instance : scene().instances) {
        const scene::Geometry& g = scene().geometries[instance.geometry];
        const bool double_sided = scene().materials[instance.material].double_sided;
        const double winding = glm::determinant(glm::dmat3(world[instance.node])) < 0 ? -1 : 1;
        for (uint32_t t = 0; t < g.triangle_count(); ++t) {
          dvec3 p[3];
          for (int c = 0; c < 3; ++c) {
            p[c] = dvec3(world[instance.node] *
                         glm::dvec4(dvec3(g.vertices[g.indices[3 * t + c]].position), 1)) -
                   view.pose.position;
          }
          const dvec3 n = winding * glm::cross(p[1] - p[0], p[2] - p[0]);
          if (!double_sided && glm::dot(n, ray) >= 0) continue;
          const double distance = glm::dot(n, p[0]) / glm::dot(n, ray);
          if (!(distance > view.near_m && distance < nearest)) continue;
          const double side = double_sided && glm::dot(n, ray) > 0 ? -winding : winding;
          bool inside = true;
          for (int c = 0; c < 3; ++c) inside &= side * glm::dot(glm::cross(p[c], p[(c + 1) % 3]), ray) <= 0;
          if (!inside) continue;
          nearest = distance;
          want = instance.first_triangle + t + 1;
        }
      }
      wrong += got.triangle_plus_one[y * view.width + x] != want;
    }
  }
  // Pixel centres on an edge may go either way.
  EXPECT_LT(wrong, view.width * view.height / 100);
}

TEST_F(VisibilityTest, BackFacesOfSingleSidedMaterialsAreNotSeen) {
  for (const bool mirrored : {false, true}) {
    for (const bool double_sided : {false, true}) {
      SceneBuilder b;
      b.place(b.quad(), b.material({.double_sided = double_sided}),
              transform({0, 0, 0}, {mirrored ? -1.0 : 1.0, 1, 1}));
      load(b.finish());
      const auto visibility = make();
      EXPECT_EQ(covered_pixels(ids(*visibility, view_from({0, 0, 3}, {0, 0, 0}))) > 0, true);
      EXPECT_EQ(covered_pixels(ids(*visibility, view_from({0, 0, -3}, {0, 0, 0}))) > 0, double_sided);
    }
  }
}

TEST_F(VisibilityTest, MaskedTexelsShowWhatIsBehindThem) {
  SceneBuilder b;
  scene::Material leaf{.alpha_mode = scene::AlphaMode::mask, .double_sided = true};
  leaf.base_color_texture.texture = b.texture(half_mask(64));
  b.place(b.quad(), b.material(leaf), dmat4(1));
  b.place(b.quad(), b.material({}), transform({0, 0, -1}, {4, 4, 1}));
  load(b.finish());
  const View view = view_from({0, 0, 3}, {0, 0, 0}, 0.5f, 100, 100);  // the leaf fills the view
  const IdBuffer got = ids(*make(), view);
  for (const uint32_t y : {10u, 50u, 90u}) {
    EXPECT_LE(got.triangle_plus_one[y * 100 + 20], 2u) << "the opaque half is the leaf";
    EXPECT_GT(got.triangle_plus_one[y * 100 + 80], 2u) << "the other half is the wall";
  }
}

TEST_F(VisibilityTest, TheAlphaFactorsMultiply) {
  for (const float factor : {1.0f, 0.6f, 0.4f}) {
    for (const uint32_t vertex_alpha : {255u, 200u, 60u}) {
      SceneBuilder b;
      const uint32_t quad = b.quad();
      for (auto& v : b.scene().geometries[quad].vertices) v.color = 0x00ffffffu | vertex_alpha << 24;
      b.place(quad, b.material({.base_color = vec4(1, 1, 1, factor), .alpha_mode = scene::AlphaMode::mask}),
              dmat4(1));
      load(b.finish());
      const bool visible = factor * float(vertex_alpha) / 255 >= 0.5f;
      EXPECT_EQ(covered_pixels(ids(*make(), view_from({0, 0, 3}, {0, 0, 0}))) > 0, visible);
    }
  }
}

TEST_F(VisibilityTest, ASceneWithoutMasksRecordsNoMaskedDraws) {
  const View view = view_from({9, 2, 9}, {0, 1, 0});
  const auto draws_a_view = [&](bool with_masks) {
    load(make_town(4, with_masks));
    const auto frustum = make({.frustum_culling = true, .occlusion_culling = false});
    const uint64_t before = device_->draws_recorded();
    ids(*frustum, view);
    return device_->draws_recorded() - before;
  };
  // Opaque: single-sided, mirrored, double-sided. Masked leaves here are all double-sided.
  EXPECT_EQ(draws_a_view(false), 3u);
  EXPECT_EQ(draws_a_view(true), 4u);
}

TEST_F(VisibilityTest, AnOmittedOcclusionPassRecordsNoDispatches) {
  load(make_town(3, false));
  const View view = view_from({9, 2, 9}, {0, 1, 0});
  const auto dispatches = [&](const VisibilitySettings& settings) {
    const auto visibility = make(settings);
    const uint64_t before = device_->dispatches_recorded();
    ids(*visibility, view);
    return device_->dispatches_recorded() - before;
  };
  EXPECT_EQ(dispatches({.frustum_culling = false, .occlusion_culling = false}), 0u);
  EXPECT_EQ(dispatches({.frustum_culling = true, .occlusion_culling = false}), 2u);
  EXPECT_GT(dispatches({.frustum_culling = true, .occlusion_culling = true}), 4u);
}

TEST_F(VisibilityTest, AHigherResolutionFindsSmallTriangles) {
  SceneBuilder b;
  const uint32_t stone = b.material({}), box = b.box(12);
  for (int i = 0; i < 10; ++i) b.place(box, stone, transform({3.0 * i - 15, 0, 0}, dvec3(1), i));
  load(b.finish());
  const View view = view_from({0, 2, 60}, {0, 0, 0});
  const auto coarse = make(), fine = make({.resolution_scale = 3});
  EXPECT_GT(determine(*fine, {view}).size(), 1.5 * double(determine(*coarse, {view}).size()));
}

TEST_F(VisibilityTest, ViewsOfDifferentSizesDoNotDisturbEachOther) {
  load(make_town(4, true));
  const auto visibility = make();
  const auto everything = make({.frustum_culling = false, .occlusion_culling = false});
  for (const auto& [width, height] : {std::pair(33u, 17u), {640u, 90u}, {1u, 1u}, {64u, 300u}, {33u, 17u}}) {
    const View view = view_from({9, 2, 9}, {0, 1, 0}, 1, width, height);
    EXPECT_EQ(differing_pixels(ids(*visibility, view), ids(*everything, view)), 0u) << width << "x" << height;
  }
}

TEST_F(VisibilityTest, AnEmptySceneIsEmpty) {
  load(SceneBuilder().finish());
  const auto visibility = make();
  const View view = view_from({0, 0, 3}, {0, 0, 0});
  EXPECT_TRUE(determine(*visibility, {view}).empty());
  EXPECT_EQ(covered_pixels(ids(*visibility, view)), 0u);
}

TEST_F(VisibilityTest, ImpossibleViewsAreErrors) {
  load(make_town(1, false));
  const auto visibility = make();
  const View good = view_from({0, 0, 3}, {0, 0, 0});
  const auto fails = [&](auto change) {
    View view = good;
    change(view);
    return visibility->render_ids(*instant_, view).status().code() == absl::StatusCode::kInvalidArgument;
  };
  EXPECT_TRUE(fails([](View& v) { v.width = 0; }));
  EXPECT_TRUE(fails([](View& v) { v.height = 100'000; }));
  EXPECT_TRUE(fails([](View& v) { v.fov.left = v.fov.right; }));
  EXPECT_TRUE(fails([](View& v) { v.fov.up = std::nanf(""); }));
  EXPECT_TRUE(fails([](View& v) { v.near_m = 0; }));
  EXPECT_FALSE(Visibility::create(*device_, *gpu_scene_, {.resolution_scale = 100}).ok());
  // A pose that is not a pose is brought to one.
  View odd = good;
  odd.pose.orientation = dquat(0, 0, 0, 0);
  odd.pose.position.x = std::nan("");
  EXPECT_TRUE(visibility->render_ids(*instant_, odd).ok());
}

TEST_F(VisibilityTest, SliversAndDegenerateTrianglesDoNoHarm) {
  SceneBuilder b;
  const uint32_t stone = b.material({.double_sided = true});
  const std::vector<vec3> points{{-1, 0, 0}, {1, 0, 0},   {0, 1e-7f, 0}, {0, 0, 0},
                                 {0, 0, 0},  {-1, -1, 0}, {1, -1, 0},    {0, 1, 0}};
  b.place(b.geometry(points, {0, 1, 2, 3, 4, 3, 0, 0, 1, 5, 6, 7}), stone, dmat4(1));
  b.place(0, stone, transform({0, 0, -1}, {1, 0, 1}));  // flat
  b.place(0, stone, transform({0, 0, -1}, dvec3(0)));   // a point
  load(b.finish());
  const auto both = make();
  const auto everything = make({.frustum_culling = false, .occlusion_culling = false});
  const View view = view_from({0.2, 0, 2}, {0, 0, 0});
  const IdBuffer want = ids(*everything, view);
  EXPECT_GT(covered_pixels(want), 100u);
  EXPECT_EQ(differing_pixels(want, ids(*both, view)), 0u);
}

TEST_F(VisibilityTest, AMovingInstanceIsSeenWhereItIs) {
  SceneBuilder b;
  b.place(b.quad(), b.material({}), dmat4(1), true);
  scene::Scene& s = b.scene();
  s.nodes[0].matrix.reset();
  s.animations.push_back({0,
                          scene::AnimationPath::translation,
                          scene::Interpolation::linear,
                          {0, 1},
                          {vec4(0), vec4(100, 0, 0, 0)}});
  s.animation_length_s = 1;
  load(b.finish());
  const auto both = make();
  const View view = view_from({0, 0, 3}, {0, 0, 0});
  EXPECT_GT(covered_pixels(ids(*both, view)), 0u);
  instant_->set(kNsPerSecond / 2, dvec3(0));
  EXPECT_EQ(covered_pixels(ids(*both, view)), 0u);
  EXPECT_GT(covered_pixels(ids(*both, view_from({50, 0, 3}, {50, 0, 0}))), 0u);
  instant_->set(0, dvec3(0, 0, 1));
  EXPECT_GT(covered_pixels(ids(*both, view)), 0u);
}

TEST(Buckets, SeparateWhatNeedsItsOwnState) {
  SceneBuilder b;
  const uint32_t quad = b.quad(), box = b.box(4);
  for (const auto alpha : {scene::AlphaMode::opaque, scene::AlphaMode::mask, scene::AlphaMode::blend}) {
    for (const bool double_sided : {false, true}) {
      const uint32_t m = b.material({.alpha_mode = alpha, .double_sided = double_sided});
      b.place(quad, m, dmat4(1));
      b.place(box, m, transform(dvec3(0), {1, 1, -1}));
    }
  }
  const auto s = b.finish();
  const auto nodes = s->node_transforms(0);
  const BucketTable t = make_buckets(*s, nodes);
  EXPECT_THAT(t.of_instance, testing::ElementsAre(0, 1, 2, 2, 3, 4, 5, 5, 0, 1, 2, 2));
  uint32_t next = 0;
  for (uint32_t k = 0; k < kBuckets; ++k) {
    EXPECT_EQ(t.first_draw[k], next);
    next += t.meshlets[k];
  }
  EXPECT_EQ(next, 6 * (s->geometries[0].meshlets.size() + s->geometries[1].meshlets.size()));
}

}  // namespace
}  // namespace tessera::pvs
