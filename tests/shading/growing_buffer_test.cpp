#include "shading/growing_buffer.h"

#include <gtest/gtest.h>

#include "test_world.h"

namespace tessera::shading::test {
namespace {

TEST(GrowingBuffer, GrowsSeldomAndNoFurtherThanABindingMaySpan) {
  constexpr uint64_t kMost = 128 << 20;
  uint64_t size = 0;
  int growths = 0;
  for (uint64_t bytes = 1; bytes <= kMost; bytes += bytes / 100 + 1) {
    if (bytes <= size) continue;
    size = grown_size(size, bytes, kMost);
    EXPECT_GE(size, bytes);
    EXPECT_LE(size, kMost);
    ++growths;
  }
  EXPECT_LE(growths, 21);
  EXPECT_EQ(grown_size(kMost, kMost + 1, kMost), kMost + 1) << "the binding's error tells what is too large";
}

TEST(GrowingBuffer, TellsWhetherItIsANewOne) {
  gpu::Buffer buffer;
  const auto first = grow(device(), buffer, 0, gpu::Memory::upload, "test");
  ASSERT_TRUE(first.ok()) << first.status();
  EXPECT_TRUE(*first);
  EXPECT_GT(buffer.size(), 0u);
  const uint64_t before = buffer.size();
  EXPECT_FALSE(*grow(device(), buffer, before, gpu::Memory::upload, "test"));
  EXPECT_TRUE(*grow(device(), buffer, before + 1, gpu::Memory::upload, "test"));
  EXPECT_EQ(buffer.size(), 2 * before);
}

}  // namespace
}  // namespace tessera::shading::test
