#include "client-sdk/scene_store.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <optional>
#include <random>

#include "meta_builder.h"

namespace tessera::client {
namespace {

using namespace test;

const std::vector<TriangleRecord>& group(const SceneState& state, RecordGroup g) {
  return state.records[static_cast<int>(g)];
}

TEST(SceneStore, DequantisesVerticesByTheirMesh) {
  SceneStore store;
  MetaFrame frame = next_frame(1);
  frame.full_state = true;
  frame.meshes = {{{10, 20, 30}, 0.5}, {{-1, 0, 0}, 1.0 / 1024}};
  frame.vertices = {{0, {2, -2, 0}}, {1, {1024, 1, -512}}};
  store.apply(frame);
  EXPECT_EQ(store.state().vertices[0], vec3(11, 19, 30));
  EXPECT_EQ(store.state().vertices[1], vec3(0, 1.0f / 1024, -0.5f));
}

// Winding and corners as scene::Patch defines them.
TEST(SceneStore, TrianglesOfEachPatchSize) {
  const std::vector<std::vector<std::array<uint32_t, 3>>> expected = {
      {{0, 1, 2}}, {{0, 1, 2}, {3, 2, 1}}, {{0, 1, 2}, {3, 0, 2}, {1, 4, 2}}};
  const uint8_t first_kind[3] = {0, 1, 3};
  for (uint8_t triangles = 1; triangles <= 3; ++triangles) {
    SceneStore store;
    MetaFrame frame = first_frame(1, 1, triangles);
    frame.placements.push_back(in_block(0, 4, 8, 8, 4));
    store.apply(frame);
    const auto& records = group(store.state(), RecordGroup::single_sided);
    ASSERT_EQ(records.size(), triangles);
    for (uint8_t t = 0; t < triangles; ++t) {
      const TriangleFields fields = unpack(records[t]);
      EXPECT_EQ(fields.vertices, expected[triangles - 1][t]);
      EXPECT_EQ(fields.corner_kind, first_kind[triangles - 1] + t);
      EXPECT_EQ(fields.x, 4);
      EXPECT_EQ(fields.y, 8);
      EXPECT_EQ(fields.width, 8);
      EXPECT_EQ(fields.height, 4);
    }
  }
}

TEST(SceneStore, ObjectsDecideGroupAndWinding) {
  for (int flags = 0; flags < 8; ++flags) {
    SceneStore store;
    MetaFrame frame = first_frame(1);
    frame.objects[0].mirrored = flags & 1;
    frame.objects[0].double_sided = flags & 2;
    frame.objects[0].masked = flags & 4;
    frame.placements.push_back(in_color(0, 7));
    store.apply(frame);
    for (int g = 0; g < kRecordGroups; ++g) {
      ASSERT_EQ(store.state().records[g].size(), g == flags / 2 ? 2u : 0u) << flags;
    }
    const TriangleFields fields = unpack(store.state().records[flags / 2][1]);
    EXPECT_EQ(fields.reversed, (flags & 1) != 0);
    EXPECT_EQ(fields.masked, (flags & 4) != 0);
    EXPECT_TRUE(fields.single_color);
    EXPECT_EQ(fields.rgb, 7u);
  }
}

TEST(SceneStore, MovesObjects) {
  SceneStore store;
  store.apply(first_frame(1));
  MetaFrame frame = next_frame(2);
  frame.moved.push_back({0, {.translation = {1, 2, 3}}});
  store.apply(frame);
  EXPECT_EQ(store.state().objects[0].transform, frame.moved[0].transform);
  EXPECT_EQ(store.state().frame, 2u);
}

// What apply() must amount to: for every placed patch the records of its triangles, nothing else.
class NaiveModel {
 public:
  explicit NaiveModel(const MetaFrame& first) : patches_(first.patches), objects_(first.objects) {}

  void apply(const MetaFrame& frame) {
    for (const auto& p : frame.placements) {
      // What is for a whole patch takes the place of all that its triangles had.
      if (p.part == 0)
        std::erase_if(placed_, [&](const auto& entry) { return entry.first.first == p.patch; });
      if (p.kind != PlacementKind::none) placed_[{p.patch, p.part}] = p;
    }
  }

  std::array<std::vector<TriangleRecord>, kRecordGroups> records() const {
    // A fresh store that has never removed anything.
    SceneStore store;
    MetaFrame all = first_frame(1, 0);
    all.objects = objects_;
    all.patches = patches_;
    for (const auto& [key, placement] : placed_) all.placements.push_back(placement);
    store.apply(all);
    return store.state().records;
  }

 private:
  std::vector<geometry_compression::NewPatch> patches_;
  std::vector<geometry_compression::NewObject> objects_;
  std::map<std::pair<uint32_t, uint8_t>, PatchPlacement> placed_;
};

std::vector<std::pair<std::array<uint32_t, 4>, std::array<uint32_t, 4>>> sorted(
    const std::vector<TriangleRecord>& records) {
  std::vector<std::pair<std::array<uint32_t, 4>, std::array<uint32_t, 4>>> out;
  for (const auto& r : records) out.emplace_back(r.vertices, r.shape);
  std::sort(out.begin(), out.end());
  return out;
}

PatchPlacement random_placement(uint32_t patch, uint32_t triangles, std::mt19937& random) {
  const auto part = static_cast<uint8_t>(1 + random() % triangles);
  switch (random() % 5) {
    case 3:
      return in_l(patch, part, static_cast<uint16_t>(patch % 64 * 2), 4,
                  static_cast<uint8_t>(1 + patch % 64));
    case 4:
      return in_halves(patch, part, static_cast<uint8_t>(patch % 3), 5, static_cast<uint16_t>(1 + patch), 0,
                       2);
    case 0:
      return gone(patch);
    case 1:
      return in_color(patch, patch * 7919u & 0xffffffu);
    default:
      return in_block(patch, static_cast<uint16_t>(patch % 64 * 2), static_cast<uint16_t>(patch / 64 * 2), 2,
                      2);
  }
}

TEST(SceneStore, RandomChangesLeaveExactlyWhatANaiveModelHolds) {
  std::mt19937 random(7);
  constexpr uint32_t kPatches = 300;
  MetaFrame first = first_frame(1, 0);
  first.objects.resize(8);
  for (uint32_t i = 0; i < 8; ++i) first.objects[i] = {{}, (i & 1) != 0, (i & 2) != 0, (i & 4) != 0};
  for (uint32_t i = 0; i < kPatches; ++i) {
    first.patches.push_back(
        {.object = i % 8, .triangles = static_cast<uint8_t>(1 + random() % 3), .vertices = {0, 1, 2, 3, 4}});
  }
  SceneStore store;
  NaiveModel model(first);
  store.apply(first);
  SceneState incremental_copy;
  for (uint32_t frame = 2; frame < 200; ++frame) {
    MetaFrame meta = next_frame(frame);
    const uint32_t stride = 1 + random() % 40;
    for (uint32_t p = random() % stride; p < kPatches; p += stride)
      meta.placements.push_back(random_placement(p, first.patches[p].triangles, random));
    store.apply(meta);
    model.apply(meta);
    const auto expected = model.records();
    for (int g = 0; g < kRecordGroups; ++g) {
      ASSERT_EQ(sorted(store.state().records[g]), sorted(expected[g])) << "frame " << frame << " group " << g;
    }
    if (frame % 3 == 0) {
      store.copy_to(incremental_copy);
      ASSERT_EQ(incremental_copy.records, store.state().records);
    }
  }
}

TEST(SceneStore, CopiesCatchUpAcrossEpochs) {
  SceneStore store;
  SceneState copy;
  const auto same = [&] {
    store.copy_to(copy);
    return copy.vertices == store.state().vertices && copy.records == store.state().records &&
           copy.epoch == store.state().epoch && copy.frame == store.state().frame &&
           copy.objects.size() == store.state().objects.size();
  };
  store.apply(first_frame(1));
  EXPECT_TRUE(same());
  MetaFrame more = next_frame(2);
  more.vertices.push_back({0, {9, 9, 9}});
  more.placements.push_back(in_color(0, 3));
  store.apply(more);
  EXPECT_TRUE(same());
  // As many vertices as before, but others.
  MetaFrame anew = first_frame(3);
  anew.meshes[0].step = 2;
  anew.vertices.push_back({0, {8, 8, 8}});
  store.apply(anew);
  EXPECT_TRUE(same());
  EXPECT_TRUE(group(copy, RecordGroup::single_sided).empty());
}

}  // namespace
}  // namespace tessera::client
