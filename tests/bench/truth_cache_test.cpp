#include "bench/truth_cache.h"

#include <gtest/gtest.h>
#include <stdlib.h>

#include <chrono>
#include <limits>

#include "bench/file_io.h"
#include "bench/temporary_folder.h"
#include "bench/truth_entry.h"
#include "test_images.h"

namespace tessera::bench {
namespace {

namespace fs = std::filesystem;

shading::ReferenceImage sample_truth(uint32_t width = 24, uint32_t height = 14) {
  shading::ReferenceImage truth;
  truth.color = textured(width, height);
  for (uint32_t i = 0; i < width * height; ++i) {
    truth.triangle_plus_one.push_back(i / 5);
    truth.covered.push_back(i % 3 != 0);
    truth.depth.push_back(i % 7 ? 0.1f * static_cast<float>(i) : std::numeric_limits<float>::infinity());
  }
  return truth;
}

TruthKey sample_key(double x = 0) {
  TruthKey key{.scene = "hall", .renderer = "r1"};
  key.view.pose.position.x = x;
  key.view.width = 24;
  key.view.height = 14;
  return key;
}

bool same(const shading::ReferenceImage& a, const shading::ReferenceImage& b) {
  return a.color.rgba == b.color.rgba && a.color.width == b.color.width &&
         a.triangle_plus_one == b.triangle_plus_one && a.covered == b.covered && a.depth == b.depth;
}

std::vector<fs::path> entries(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder)) files.push_back(entry.path());
  return files;
}

TEST(TruthKey, EveryPartCounts) {
  const TruthKey key = sample_key();
  std::vector<TruthKey> others(14, key);
  others[0].scene = "other";
  others[1].renderer = "r2";
  others[2].scene_time_ns = 1;
  others[3].view.pose.position.z = 1e-12;
  others[4].view.pose.orientation.y = 1e-12;
  others[5].view.fov.left = -1.0000001f;
  others[6].view.fov.right = 2;
  others[7].view.fov.up = 2;
  others[8].view.fov.down = -2;
  others[9].view.width = 25;
  others[10].view.near_m = 0.1f;
  others[11].request.samples = 1;
  others[12].request.ids = true;
  others[13].request.depth = true;
  for (size_t i = 0; i < others.size(); ++i) EXPECT_NE(others[i].text(), key.text()) << i;
}

TEST(TruthCache, RendersOnceAndFindsItInTheNextRun) {
  const TemporaryFolder folder;
  int rendered = 0;
  const auto render = [&]() -> StatusOr<RenderedImage> {
    ++rendered;
    return std::make_shared<const shading::ReferenceImage>(sample_truth());
  };
  for (int run = 0; run < 2; ++run) {
    auto cache = TruthCache::open(folder.path());
    ASSERT_TRUE(cache.ok()) << cache.status();
    for (int i = 0; i < 2; ++i) {
      const auto image = (*cache)->get(sample_key(), render);
      ASSERT_TRUE(image.ok());
      EXPECT_TRUE(same(**image, sample_truth()));
    }
  }
  EXPECT_EQ(rendered, 1);
}

TEST(TruthCache, PlanesThatWereNotAskedForStayEmpty) {
  shading::ReferenceImage color_only;
  color_only.color = textured(8, 8);
  const auto read = unpack_truth("k", pack_truth("k", color_only));
  ASSERT_TRUE(read.has_value());
  EXPECT_TRUE(same(*read, color_only));
}

TEST(TruthCache, AnyDamageIsAMissAndIsRenderedAgain) {
  const std::vector<uint8_t> good = pack_truth("key", sample_truth());
  EXPECT_TRUE(unpack_truth("key", good).has_value());
  EXPECT_FALSE(unpack_truth("another key", good).has_value());
  for (size_t i = 0; i < good.size(); i += 7) {
    std::vector<uint8_t> bad = good;
    bad[i] ^= 0x10;
    EXPECT_FALSE(unpack_truth("key", bad).has_value()) << "byte " << i;
  }
  for (size_t length = 0; length < good.size(); length += 11) {
    EXPECT_FALSE(unpack_truth("key", std::span(good).first(length)).has_value()) << "length " << length;
  }
}

TEST(TruthCache, ADamagedFileIsReplaced) {
  const TemporaryFolder folder;
  auto cache = *TruthCache::open(folder.path());
  ASSERT_TRUE(cache->store(sample_key(), sample_truth()).ok());
  ASSERT_TRUE(write_file(entries(folder.path()).at(0), "garbage").ok());
  int rendered = 0;
  const auto render = [&]() -> StatusOr<RenderedImage> {
    ++rendered;
    return std::make_shared<const shading::ReferenceImage>(sample_truth());
  };
  EXPECT_TRUE(cache->get(sample_key(), render).ok());
  EXPECT_TRUE(cache->get(sample_key(), render).ok());
  EXPECT_EQ(rendered, 1);
}

TEST(TruthCache, TheLeastRecentlyUsedEntriesGoFirst) {
  const TemporaryFolder folder;
  const uint64_t one = pack_truth(sample_key(0).text(), sample_truth()).size();
  auto cache = *TruthCache::open(folder.path(), 3 * one + one / 2);
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(cache->store(sample_key(i), sample_truth()).ok());
  EXPECT_TRUE(cache->find(sample_key(0)).has_value());  // now 1 is the oldest
  ASSERT_TRUE(cache->store(sample_key(3), sample_truth()).ok());
  EXPECT_TRUE(cache->find(sample_key(0)).has_value());
  EXPECT_FALSE(cache->find(sample_key(1)).has_value());
  EXPECT_TRUE(cache->find(sample_key(3)).has_value());
  EXPECT_EQ(entries(folder.path()).size(), 3u);
  EXPECT_LE(cache->stats().bytes, 3 * one + one / 2);
}

TEST(TruthCache, TheLimitHoldsOverRuns) {
  const TemporaryFolder folder;
  const uint64_t one = pack_truth(sample_key(0).text(), sample_truth()).size();
  {
    auto cache = *TruthCache::open(folder.path());
    for (int i = 0; i < 4; ++i) ASSERT_TRUE(cache->store(sample_key(i), sample_truth()).ok());
  }
  auto cache = *TruthCache::open(folder.path(), 2 * one + one / 2);
  ASSERT_TRUE(cache->store(sample_key(9), sample_truth()).ok());
  EXPECT_EQ(entries(folder.path()).size(), 2u);
}

TEST(TruthCache, WithoutAFolderNothingIsKept) {
  TruthCache cache;
  EXPECT_TRUE(cache.store(sample_key(), sample_truth()).ok());
  EXPECT_FALSE(cache.find(sample_key()).has_value());
}

TEST(TruthCache, AFailedRenderIsPassedOn) {
  TruthCache cache;
  const auto image =
      cache.get(sample_key(), []() -> StatusOr<RenderedImage> { return absl::InternalError("lost"); });
  EXPECT_EQ(image.status().message(), "lost");
}

TEST(TruthCache, AnUnusableFolderIsAnError) {
  const TemporaryFolder folder;
  ASSERT_TRUE(write_file(folder.path() / "file", "x").ok());
  EXPECT_FALSE(TruthCache::open(folder.path() / "file").ok());
}

TEST(SceneIdentity, ChangesWithTheFile) {
  const TemporaryFolder folder;
  const std::string file = (folder.path() / "a.glb").string();
  ASSERT_TRUE(write_file(file, "one").ok());
  const std::string first = scene_identity(file);
  EXPECT_EQ(scene_identity(file), first);
  ASSERT_TRUE(write_file(file, "other").ok());
  EXPECT_NE(scene_identity(file), first);
  EXPECT_EQ(scene_identity("gallery:2"), "gallery:2");
}

}  // namespace
}  // namespace tessera::bench
