#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <thread>
#include <vector>

#include "bench/temporary_folder.h"
#include "bench/truth_cache.h"
#include "test_images.h"

namespace tessera::bench {
namespace {

TruthKey key_of(uint32_t picture) {
  TruthKey key{.scene = "hall", .renderer = "r1"};
  key.view.width = 8;
  key.view.height = 4 + picture;
  return key;
}

shading::ReferenceImage picture_of(uint32_t picture) {
  shading::ReferenceImage truth;
  truth.color = uniform_image(8, 4 + picture, static_cast<uint8_t>(picture));
  return truth;
}

// Whatever the others store, find and push out of the small folder: everyone gets the picture they asked for.
TEST(TruthCacheThreads, EveryoneGetsTheirOwnPicture) {
  constexpr uint32_t kThreads = 4, kPictures = 6, kGets = 60;
  const TemporaryFolder folder;
  auto cache = TruthCache::open(folder.path(), 1200);
  ASSERT_TRUE(cache.ok()) << cache.status();
  std::atomic<uint32_t> right = 0, rendered = 0;
  {
    std::vector<std::jthread> threads;
    for (uint32_t t = 0; t < kThreads; ++t) {
      threads.emplace_back([&, t] {
        for (uint32_t i = 0; i < kGets; ++i) {
          const uint32_t picture = (t + i) % kPictures;
          const auto image = (*cache)->get(key_of(picture), [&]() -> StatusOr<RenderedImage> {
            ++rendered;
            return std::make_shared<const shading::ReferenceImage>(picture_of(picture));
          });
          if (image.ok() && (*image)->color.rgba == picture_of(picture).color.rgba) ++right;
        }
      });
    }
  }
  const TruthCache::Stats stats = (*cache)->stats();
  EXPECT_EQ(right, kThreads * kGets);
  EXPECT_EQ(stats.hits + stats.misses, uint64_t{kThreads} * kGets);
  EXPECT_EQ(stats.misses, rendered);
  EXPECT_LE(stats.bytes, 1200u);
}

}  // namespace
}  // namespace tessera::bench
