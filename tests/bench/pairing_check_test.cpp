#include "bench/pairing_check.h"

#include <gtest/gtest.h>

namespace tessera::bench {
namespace {

// One instance with a lone triangle (patch 0) and a pair (patch 1).
scene::Scene make_scene() {
  scene::Scene s;
  scene::Geometry g;
  g.vertices.resize(4);
  g.indices = {0, 1, 2, 0, 1, 2, 3, 2, 1};
  g.patches = {{0, 1}, {1, 2}};
  s.geometries.push_back(g);
  s.materials.emplace_back();
  s.nodes.emplace_back();
  s.instances = {{0, 0, 0}};
  s.index_instances();
  return s;
}

struct Fixture : testing::Test {
  scene::Scene scene = make_scene();
  std::vector<atlas::Placement> placements = {{.patch = 0, .kind = atlas::PlacementKind::color},
                                              {.patch = 1,
                                               .kind = atlas::PlacementKind::block,
                                               .x = 32,
                                               .y = 64,
                                               .width = 16,
                                               .height = 8,
                                               .transposed = true}};
  client::SceneState state = [] {
    client::SceneState s;
    client::TriangleFields color;
    color.single_color = true;
    color.rgb = 0x123456;
    client::TriangleFields block;
    block.corner_kind = 1;
    block.x = 32;
    block.y = 64;
    block.width = 16;
    block.height = 8;
    block.transposed = true;
    s.records[0] = {client::pack(block), client::pack(color)};
    block.corner_kind = 2;
    s.records[1] = {client::pack(block)};
    return s;
  }();
};

TEST_F(Fixture, EqualSetsMatch) {
  EXPECT_TRUE(matches(state, placements, scene));
}

TEST_F(Fixture, EveryDifferenceIsSeen) {
  for (int what = 0; what < 6; ++what) {
    std::vector<atlas::Placement> other = placements;
    if (what == 0) other[1].x += 2;
    if (what == 1) other[1].y += 2;
    if (what == 2) other[1].width = 32;
    if (what == 3) other[1].transposed = false;
    if (what == 4) other.pop_back();
    if (what == 5) other[0] = {.patch = 0, .kind = atlas::PlacementKind::block, .width = 2, .height = 2};
    EXPECT_FALSE(matches(state, other, scene)) << what;
  }
}

TEST_F(Fixture, TrianglesArePlacedOneByOne) {
  client::TriangleFields l, halves;
  l.corner_kind = client::kCornerL;
  l.x = 6;
  l.l = {5, 2, true, 40};
  halves.corner_kind = client::kCornerHalves;
  halves.halves = {1, 9, 3, {{{5, 8, 20, false}, {30, 8, 11, true}}}};
  state.records[0] = {client::pack(l)};
  state.records[1] = {client::pack(halves)};
  atlas::Placement first{.patch = 1, .part = atlas::part_of(0), .kind = atlas::PlacementKind::l, .x = 6};
  first.l = {5, 2, true, 40};
  atlas::Placement second{.patch = 1, .part = atlas::part_of(1), .kind = atlas::PlacementKind::halves};
  second.halves = {1, 9, 3, {{{5, 8, 20, false}, {30, 8, 11, true}}}};
  const std::vector<atlas::Placement> both{first, second};
  EXPECT_TRUE(matches(state, both, scene));
  for (int what = 0; what < 5; ++what) {
    std::vector<atlas::Placement> other = both;
    if (what == 0) other[0].l.level = 6;
    if (what == 1) other[0].l.turned = false;
    if (what == 2) other[0].l.next_y = 42;
    if (what == 3) other[1].halves.foot = 8;
    if (what == 4) other[1].halves.half[1].x = 31;
    EXPECT_FALSE(matches(state, other, scene)) << what;
  }
}

TEST_F(Fixture, AMissingTriangleIsSeen) {
  state.records[1].clear();
  EXPECT_FALSE(matches(state, placements, scene));
}

}  // namespace
}  // namespace tessera::bench
