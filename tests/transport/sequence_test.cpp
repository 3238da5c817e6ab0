#include "transport/sequence.h"

#include <gtest/gtest.h>

#include <random>

namespace tessera::transport {
namespace {

TEST(SequenceUnwrapper, CountsThroughEveryWrap) {
  for (uint16_t start : {0, 1, 0x7fff, 0x8000, 0xffff}) {
    SequenceUnwrapper unwrapper;
    const ExtendedSequence first = unwrapper.unwrap(start);
    for (ExtendedSequence i = 1; i < 200'000; ++i)
      ASSERT_EQ(unwrapper.unwrap(static_cast<uint16_t>(start + i)), first + i);
  }
}

TEST(SequenceUnwrapper, EveryStepBelowHalfTheRangeIsRight) {
  for (int step = -0x7fff; step <= 0x7fff; ++step) {
    SequenceUnwrapper unwrapper;
    const ExtendedSequence first = unwrapper.unwrap(0xfffe);
    ASSERT_EQ(unwrapper.unwrap(static_cast<uint16_t>(0xfffe + step)), first + step) << step;
  }
}

TEST(SequenceUnwrapper, LateAndShuffledPacketsKeepTheirPlace) {
  std::mt19937 random(7);
  SequenceUnwrapper unwrapper;
  const ExtendedSequence base = unwrapper.unwrap(60'000);
  ExtendedSequence highest = base;
  for (int i = 0; i < 100'000; ++i) {
    const ExtendedSequence real =
        std::max<ExtendedSequence>(0, highest + static_cast<int>(random() % 2000) - 900);
    ASSERT_EQ(unwrapper.unwrap(static_cast<uint16_t>(real)), real);
    highest = std::max(highest, real);
    ASSERT_EQ(unwrapper.highest(), highest);
  }
}

TEST(SequenceUnwrapper, PeekDoesNotMoveIt) {
  SequenceUnwrapper unwrapper;
  const ExtendedSequence first = unwrapper.unwrap(10);
  EXPECT_EQ(unwrapper.peek(500), first + 490);
  EXPECT_EQ(unwrapper.highest(), first);
}

}  // namespace
}  // namespace tessera::transport
