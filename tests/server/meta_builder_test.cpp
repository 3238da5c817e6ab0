#include "server/meta_builder.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>

namespace tessera::server {
namespace {

namespace gc = geometry_compression;

// Two instances of one quad whose two triangles have their own copies of the shared vertices (a seam).
scene::Scene make_scene() {
  scene::Scene s;
  scene::Geometry g;
  const vec3 corners[6] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}, {0, 1, 0}, {1, 0, 0}};
  for (const vec3& p : corners) {
    scene::Vertex v{};
    v.position = p;
    v.normal = {0, 0, 1};
    g.vertices.push_back(v);
    g.bounds.add(p);
  }
  g.indices = {0, 1, 2, 3, 4, 5};
  g.patches = {{0, 2}};
  g.meshlets = {{0, 2, 0, 1, {0.5f, 0.5f, 0}, 1.0f}};
  s.geometries.push_back(g);
  s.materials.emplace_back();
  s.nodes.resize(2);
  s.nodes[1].translation = {5, 0, 0};
  s.nodes[1].scale = {-2, 2, 2};
  s.instances = {{0, 0, 0}, {0, 0, 1}};
  s.index_instances();
  return s;
}

atlas::Placement block(scene::PatchId patch, uint16_t x) {
  return {.patch = patch, .kind = atlas::PlacementKind::block, .x = x, .y = 8, .width = 8, .height = 4};
}
atlas::Placement color(scene::PatchId patch) {
  return {.patch = patch, .kind = atlas::PlacementKind::color};
}

struct Fixture : testing::Test {
  scene::Scene scene = make_scene();
  MetaBuilder builder{scene, {}};
  std::vector<dmat4> transforms = [&] {
    std::vector<dmat4> t;
    const auto nodes = scene.node_transforms(0);
    for (const auto& i : scene.instances) t.push_back(nodes[i.node]);
    return t;
  }();

  gc::MetaFrame build(FrameNumber frame, const atlas::LayoutDelta& delta,
                      const std::vector<atlas::Placement>& all, const std::vector<uint32_t>& colors = {}) {
    return builder.build(frame, delta, {all, colors}, transforms);
  }
};

TEST_F(Fixture, SendsThingsOnceAndSharesVertices) {
  const auto first = build(7, {.changed = {block(0, 0), block(1, 16)}}, {block(0, 0), block(1, 16)});
  EXPECT_TRUE(first.full_state);
  EXPECT_EQ(first.meshes.size(), 1u);
  EXPECT_EQ(first.vertices.size(), 4u) << "seam copies and instances share wire vertices";
  EXPECT_EQ(first.objects.size(), 2u);
  EXPECT_FALSE(first.objects[0].mirrored);
  EXPECT_TRUE(first.objects[1].mirrored);
  ASSERT_EQ(first.patches.size(), 2u);
  EXPECT_EQ(first.patches[0].triangles, 2);
  EXPECT_EQ(first.placements.size(), 2u);

  const auto second = build(8, {.changed = {block(1, 32)}}, {block(0, 0), block(1, 32)});
  EXPECT_FALSE(second.full_state);
  EXPECT_TRUE(second.vertices.empty() && second.patches.empty() && second.objects.empty() &&
              second.meshes.empty());
  ASSERT_EQ(second.placements.size(), 1u);
  EXPECT_EQ(second.placements[0].x, 32);
}

TEST_F(Fixture, TrianglesArePlacedAndColouredOneByOne) {
  atlas::Placement l{.patch = 0, .part = atlas::part_of(0), .kind = atlas::PlacementKind::l, .x = 6, .y = 8};
  l.l = {.level = 9, .splits = 2, .turned = true, .next_y = 20};
  atlas::Placement halves{.patch = 1, .part = atlas::part_of(0), .kind = atlas::PlacementKind::halves};
  halves.halves = {1, 30, 4, {{{3, 2, 12, false}, {9, 2, 7, true}}}};
  atlas::Placement second = color(0), fourth = color(1);
  second.part = fourth.part = atlas::part_of(1);
  const std::vector<atlas::Placement> all{l, second, halves, fourth};
  const auto first = build(1, {.changed = all}, all, {0x102030, 0x405060});
  ASSERT_EQ(first.placements.size(), 4u);
  EXPECT_EQ(first.patches.size(), 2u);
  EXPECT_EQ(first.placements[0].part, 1);
  EXPECT_EQ(first.placements[0].l, (gc::LPlacement{9, 2, true, 20}));
  EXPECT_EQ(first.placements[1].part, 2);
  EXPECT_EQ(first.placements[1].rgb, 0x102030u);
  EXPECT_EQ(first.placements[2].halves,
            (gc::HalvesPlacement{1, 30, 4, {{{3, 2, 12, false}, {9, 2, 7, true}}}}));
  EXPECT_EQ(first.placements[3].rgb, 0x405060u);

  const auto recolored = build(2, {}, all, {0x102030, 0x40ff60});
  ASSERT_EQ(recolored.placements.size(), 1u);
  EXPECT_EQ(recolored.placements[0].patch, 1u);
  EXPECT_EQ(recolored.placements[0].part, 2);
  const auto gone = build(3, {.removed = {0}}, {halves, fourth}, {0x40ff60});
  ASSERT_EQ(gone.placements.size(), 1u);
  EXPECT_EQ(gone.placements[0].kind, gc::PlacementKind::none);
  EXPECT_EQ(gone.placements[0].part, 0);
}

TEST_F(Fixture, DequantisedPositionsStayWithinHalfAStep) {
  const auto frame = build(0, {.changed = {block(0, 0)}}, {block(0, 0)});
  const gc::NewMesh& mesh = frame.meshes[0];
  // The larger instance has scale 2: the step in the world must hold for it.
  EXPECT_LE(mesh.step * 2, 1.0 / 8192);
  const vec3 expected[4] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}};
  for (int i = 0; i < 4; ++i) {
    const gc::NewVertex& v = frame.vertices[frame.patches[0].vertices[i]];
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_NEAR(mesh.offset[axis] + mesh.step * v.q[axis], expected[i][axis], 0.5 * mesh.step);
    }
  }
}

TEST_F(Fixture, RemovedPatchesGoAndComeBackWithoutResending) {
  build(0, {.changed = {block(0, 0)}}, {block(0, 0)});
  const auto gone = build(1, {.removed = {0}}, {});
  ASSERT_EQ(gone.placements.size(), 1u);
  EXPECT_EQ(gone.placements[0].kind, gc::PlacementKind::none);
  const auto back = build(2, {.changed = {block(0, 64)}}, {block(0, 64)});
  EXPECT_TRUE(back.patches.empty());
  EXPECT_EQ(back.placements.size(), 1u);
}

TEST_F(Fixture, ColoursAreRepeatedOnlyWhenTheyMove) {
  const std::vector<atlas::Placement> all = {color(0)};
  const auto first = build(0, {.changed = all}, all, {0x808080});
  ASSERT_EQ(first.placements.size(), 1u);
  EXPECT_EQ(first.placements[0].rgb, 0x808080u);
  EXPECT_TRUE(build(1, {}, all, {0x848480}).placements.empty()) << "within the threshold";
  const auto moved = build(2, {}, all, {0x858080});
  ASSERT_EQ(moved.placements.size(), 1u);
  EXPECT_EQ(moved.placements[0].rgb, 0x858080u);
  EXPECT_TRUE(build(3, {}, all, {0x858080}).placements.empty());
}

TEST_F(Fixture, MovingObjectsAreSentWhenTheyMoved) {
  scene.nodes[1].moves = true;
  build(0, {.changed = {block(0, 0), block(1, 16)}}, {block(0, 0), block(1, 16)});
  EXPECT_TRUE(build(1, {}, {block(0, 0), block(1, 16)}).moved.empty());
  transforms[1][3] = glm::dvec4(6, 0, 0, 1);
  transforms[0][3] = glm::dvec4(9, 9, 9, 1);  // a node that is not animated is never re-sent
  const auto frame = build(2, {}, {block(0, 0), block(1, 16)});
  ASSERT_EQ(frame.moved.size(), 1u);
  EXPECT_EQ(frame.moved[0].object, 1u);
  EXPECT_EQ(frame.moved[0].transform.translation[0], 6.0);
}

TEST_F(Fixture, EveryPacketDecodesToItself) {
  const auto first = build(7, {.changed = {block(0, 0), color(1)}}, {block(0, 0), color(1)}, {0x123456});
  ASSERT_EQ(first.placements.size(), 2u);
  EXPECT_EQ(first.placements[1].rgb, 0x123456u) << "colours count the single-colour placements only";
  gc::MetaFrame decoded;
  EXPECT_EQ(gc::decode(gc::encode(first), decoded), "");
  EXPECT_EQ(decoded, first);
}

}  // namespace
}  // namespace tessera::server
