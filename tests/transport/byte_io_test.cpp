#include "transport/byte_io.h"

#include <gtest/gtest.h>

namespace tessera::transport {
namespace {

TEST(ByteIo, ReadsBackWhatItWrote) {
  std::vector<uint8_t> bytes;
  ByteWriter w(bytes);
  w.u8(0xab);
  w.u16(0x1234);
  w.u24(0x56789a);
  w.u32(0xdeadbeef);
  w.u64(0x0123456789abcdef);
  w.i64(-2);
  w.f32(-1.5f);
  w.f64(3.25);
  ASSERT_TRUE(w.ok());
  ByteReader r(bytes);
  EXPECT_EQ(r.u8(), 0xab);
  EXPECT_EQ(r.u16(), 0x1234);
  EXPECT_EQ(r.u24(), 0x56789au);
  EXPECT_EQ(r.u32(), 0xdeadbeefu);
  EXPECT_EQ(r.u64(), 0x0123456789abcdefu);
  EXPECT_EQ(r.i64(), -2);
  EXPECT_EQ(r.f32(), -1.5f);
  EXPECT_EQ(r.f64(), 3.25);
  EXPECT_TRUE(r.done());
}

TEST(ByteIo, IsBigEndian) {
  std::vector<uint8_t> bytes;
  ByteWriter w(bytes);
  w.u24(0x010203);
  w.u32(0x04050607);
  EXPECT_EQ(bytes, (std::vector<uint8_t>{1, 2, 3, 4, 5, 6, 7}));
}

TEST(ByteIo, ReadingPastTheEndLatches) {
  const std::vector<uint8_t> bytes = {1, 2, 3};
  ByteReader r(bytes);
  EXPECT_EQ(r.u32(), 0u);
  EXPECT_FALSE(r.ok());
  EXPECT_EQ(r.u8(), 0);  // although there is one
  EXPECT_EQ(r.remaining(), 0u);
  EXPECT_TRUE(r.rest().empty());
  EXPECT_FALSE(r.done());

  ByteReader huge(bytes);
  EXPECT_TRUE(huge.bytes(SIZE_MAX).empty());
  EXPECT_FALSE(huge.ok());
}

TEST(ByteIo, WritingPastTheLimitLatches) {
  std::vector<uint8_t> bytes;
  ByteWriter w(bytes, 5);
  w.u32(1);
  w.u16(2);
  EXPECT_FALSE(w.ok());
  w.u8(3);
  EXPECT_EQ(bytes.size(), 4u);
}

TEST(ByteIo, PatchesOnlyWhatWasWritten) {
  std::vector<uint8_t> bytes;
  ByteWriter w(bytes);
  w.patch_u16(0, 1);
  EXPECT_FALSE(w.ok());
  ByteWriter again(bytes);
  again.u32(0);
  again.patch_u16(2, 0x0102);
  EXPECT_TRUE(again.ok());
  EXPECT_EQ(bytes, (std::vector<uint8_t>{0, 0, 1, 2}));
  again.patch_u16(3, 1);
  EXPECT_FALSE(again.ok());
}

}  // namespace
}  // namespace tessera::transport
