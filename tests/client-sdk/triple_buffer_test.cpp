#include "client-sdk/triple_buffer.h"

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <thread>

namespace tessera::client {
namespace {

TEST(TripleBuffer, GivesTheNewestValueOnce) {
  TripleBuffer<int> buffer;
  EXPECT_EQ(buffer.take(), nullptr);
  buffer.back() = 1;
  EXPECT_FALSE(buffer.publish());
  buffer.back() = 2;
  EXPECT_TRUE(buffer.publish());  // replaces 1
  const int* taken = buffer.take();
  ASSERT_NE(taken, nullptr);
  EXPECT_EQ(*taken, 2);
  buffer.back() = 3;
  EXPECT_FALSE(buffer.publish());
  EXPECT_EQ(*taken, 2) << "what the reader holds stays as it is";
  EXPECT_EQ(*buffer.take(), 3);
  EXPECT_EQ(buffer.take(), nullptr);
}

// Two threads; each value is written in several words, so that a torn one would be seen.
TEST(TripleBuffer, ValuesAreWholeAndInOrderAcrossThreads) {
  struct Value {
    std::array<uint64_t, 64> words{};
  };
  constexpr uint64_t kLast = 20000;
  TripleBuffer<Value> buffer;
  uint64_t replaced = 0, taken = 0;
  std::jthread writer([&] {
    for (uint64_t i = 1; i <= kLast; ++i) {
      buffer.back().words.fill(i);
      replaced += buffer.publish() ? 1 : 0;
    }
  });
  uint64_t newest = 0;
  while (newest != kLast) {
    const Value* value = buffer.take();
    if (value == nullptr) {
      std::this_thread::yield();
      continue;
    }
    ++taken;
    ASSERT_GT(value->words[0], newest);
    newest = value->words[0];
    for (uint64_t word : value->words) ASSERT_EQ(word, newest);
  }
  writer.join();
  EXPECT_EQ(taken + replaced, kLast);
}

}  // namespace
}  // namespace tessera::client
