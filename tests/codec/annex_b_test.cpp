#include "codec/annex_b.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace tessera::codec {
namespace {

using Bytes = std::vector<uint8_t>;

const Bytes kKey = {0, 0, 0, 1, 0x67, 1, 2, 0, 0, 0, 1, 0x68, 3, 0, 0, 1, 0x65, 9, 8, 7};
const Bytes kPredicted = {0, 0, 1, 0x41, 5, 6};

TEST(AnnexB, SplitsAtStartCodesOfBothLengths) {
  const auto nals = split_nals(kKey);
  ASSERT_EQ(nals.size(), 3u);
  EXPECT_EQ(type_of(nals[0]), NalType::sps);
  EXPECT_EQ(Bytes(nals[1].begin(), nals[1].end()), (Bytes{0x68, 3}));
  EXPECT_EQ(Bytes(nals[2].begin(), nals[2].end()), (Bytes{0x65, 9, 8, 7}));
}

TEST(AnnexB, FindsNothingWhereNothingIs) {
  for (const Bytes& bytes : {Bytes{}, Bytes{0}, Bytes{0, 0, 1}, Bytes{0, 0, 0, 0, 0}, Bytes{1, 2, 3, 4},
                             Bytes{0, 0, 1, 0, 0, 1}}) {
    EXPECT_TRUE(split_nals(bytes).empty());
    const AccessUnitInfo info = inspect(bytes);
    EXPECT_FALSE(info.has_slice || info.key_frame || info.tag);
  }
}

TEST(AnnexB, TagsOfEveryKindOfNumberComeBack) {
  // Zeros and small bytes need emulation prevention.
  std::vector<uint32_t> numbers = {0,          1,          2,          3,          0x00000300,
                                   0x03000000, 0x00010000, 0x80000000, 0xfffffffe, 0xffffffff};
  std::mt19937 random(1);
  for (int i = 0; i < 300; ++i)
    numbers.push_back(static_cast<uint32_t>(random()) & static_cast<uint32_t>(random()) &
                      static_cast<uint32_t>(random()));
  for (uint32_t frame : numbers)
    for (uint32_t reference : {frame - 1, frame, 0u}) {
      const Bytes tagged = with_tag(kPredicted, {frame, reference});
      const AccessUnitInfo info = inspect(tagged);
      ASSERT_TRUE(info.tag.has_value()) << frame;
      ASSERT_EQ(*info.tag, (FrameTag{frame, reference}));
      ASSERT_LE(8 * (tagged.size() - kPredicted.size()), kTagBits);
      // No start code but those of the two units.
      ASSERT_EQ(split_nals(tagged).size(), 2u);
    }
}

TEST(AnnexB, TheTagStandsBeforeTheFirstSliceAndReplacesOtherMessages) {
  Bytes with_banner = {0,   0,    0, 1, 0x67, 1,    0, 0, 1, 0x06, 5,    2, 'h',
                       'i', 0x80, 0, 0, 1,    0x65, 1, 0, 0, 1,    0x65, 2};
  const Bytes tagged = with_tag(with_banner, {7, 7});
  const auto nals = split_nals(tagged);
  ASSERT_EQ(nals.size(), 4u);
  EXPECT_EQ(type_of(nals[0]), NalType::sps);
  EXPECT_EQ(type_of(nals[1]), NalType::sei);
  EXPECT_EQ(type_of(nals[2]), NalType::idr_slice);
  EXPECT_EQ(type_of(nals[3]), NalType::idr_slice);
  EXPECT_TRUE(inspect(tagged).key_frame);
  EXPECT_FALSE(inspect(with_tag(kPredicted, {7, 6})).key_frame);
}

TEST(AnnexB, FindsTheTagBehindOtherMessages) {
  // One unit with three messages: padding of type 511 and 300 bytes, a foreign UUID, ours.
  Bytes raw = {0x06, 255, 255, 1, 255, 45};
  raw.insert(raw.end(), 300, 0x55);
  raw.insert(raw.end(), {5, 24});
  raw.insert(raw.end(), 24, 0x11);
  const Bytes ours = with_tag(kPredicted, {0x12345678, 0x12345677});
  const Nal sei = split_nals(ours)[0];
  raw.insert(raw.end(), sei.begin() + 1, sei.end());
  Bytes unit = {0, 0, 1};
  unit.insert(unit.end(), raw.begin(), raw.end());
  unit.insert(unit.end(), kPredicted.begin(), kPredicted.end());
  ASSERT_TRUE(inspect(unit).tag.has_value());
  EXPECT_EQ(inspect(unit).tag->frame, 0x12345678u);
}

TEST(AnnexB, TruncatedAndDamagedMessagesAreNoTag) {
  const Bytes tagged = with_tag(kPredicted, {41, 40});
  const Nal sei = split_nals(tagged)[0];
  for (size_t size = 1; size + 1 < sei.size(); ++size) {  // without the stop bit the payload is still whole
    Bytes unit = {0, 0, 1};
    unit.insert(unit.end(), sei.begin(), sei.begin() + static_cast<ptrdiff_t>(size));
    EXPECT_FALSE(inspect(Bytes(unit)).tag.has_value()) << size;
  }
  std::mt19937 random(5);
  for (int i = 0; i < 20000; ++i) {
    Bytes noise(1 + random() % 60);
    for (uint8_t& b : noise)
      b = random() % 3 ? static_cast<uint8_t>(random() % 8) : static_cast<uint8_t>(random());
    inspect(noise);
    with_tag(noise, {1, 1});
  }
}

}  // namespace
}  // namespace tessera::codec
