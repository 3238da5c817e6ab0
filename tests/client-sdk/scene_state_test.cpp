#include "client-sdk/scene_state.h"

#include <gtest/gtest.h>

#include <random>

namespace tessera::client {
namespace {

TEST(TriangleRecord, EveryBlockPositionSizeAndSpacingSurvivesPacking) {
  for (uint32_t i = 0; i < 8192; i += 2) {
    TriangleFields f{.x = static_cast<uint16_t>(i), .y = static_cast<uint16_t>(8190 - i)};
    f.width = static_cast<uint16_t>(2 + i % 256);
    f.height = static_cast<uint16_t>(256 - i % 256);
    const auto code = static_cast<int8_t>(static_cast<int>(i / 2 % 255) - 127);
    f.spacing = {code, static_cast<int8_t>(-code), static_cast<int8_t>(code / 2)};
    ASSERT_EQ(unpack(pack(f)), f) << i;
  }
}

TEST(TriangleRecord, LsAndHalvesSurvivePacking) {
  std::mt19937 random(2);
  for (int i = 0; i < 20000; ++i) {
    TriangleFields f;
    f.object = random() >> 8;
    f.masked = random() & 1;
    for (size_t c = 1; c < 3; ++c) f.spacing[c] = static_cast<int8_t>(random());
    if (i % 2 == 0) {
      f.corner_kind = kCornerL;
      f.x = static_cast<uint16_t>(random() % 4096 * 2);
      f.y = static_cast<uint16_t>(random() % 4096 * 2);
      f.l = {static_cast<uint8_t>(1 + random() % 64), static_cast<uint8_t>(1 + random() % 31),
             random() % 2 == 0, 0};
      if (f.l.splits > 1) f.l.next_y = static_cast<uint16_t>(random() % 4096 * 2);
    } else {
      f.corner_kind = kCornerHalves;
      f.halves = {static_cast<uint8_t>(random() % 3),
                  static_cast<uint8_t>(random() % 64),
                  static_cast<uint8_t>(1 + random() % 128),
                  {}};
      for (auto& half : f.halves.half)
        half = {static_cast<uint16_t>(random() % 8192), static_cast<uint16_t>(random() % 4096 * 2),
                static_cast<uint16_t>(1 + random() % 1024), random() % 2 == 0};
    }
    ASSERT_EQ(unpack(pack(f)), f) << i;
    if (i % 2 == 0 && f.l.splits == 1) {
      ASSERT_EQ(pack(f).shape[1], 0u) << "the place of an L fits in 4 bytes";
    }
  }
}

TEST(TriangleRecord, FieldsDoNotDisturbEachOther) {
  std::mt19937 random(1);
  for (int i = 0; i < 20000; ++i) {
    TriangleFields f;
    for (auto& vertex : f.vertices) vertex = random() >> (random() % 2 ? 0 : 31);
    f.object = random() >> 8;
    f.corner_kind = static_cast<uint8_t>(random() % 6);
    f.transposed = random() & 1;
    f.masked = random() & 1;
    f.reversed = random() & 1;
    f.single_color = random() & 1;
    if (f.single_color) {
      f.rgb = random() >> 8;
    } else {
      f.x = static_cast<uint16_t>(random() % 4096 * 2);
      f.y = static_cast<uint16_t>(random() % 4096 * 2);
      f.width = static_cast<uint16_t>(random());
      f.height = static_cast<uint16_t>(random());
      for (int8_t& code : f.spacing) code = static_cast<int8_t>(random());
    }
    ASSERT_EQ(unpack(pack(f)), f);
  }
}

// The layout is shared with shaders, so the bits themselves are pinned.
TEST(TriangleRecord, BitsAreWhereTheHeaderSays) {
  const TriangleRecord block = pack({.vertices = {1, 2, 3},
                                     .object = 9,
                                     .corner_kind = 4,
                                     .transposed = true,
                                     .masked = true,
                                     .reversed = true,
                                     .x = 10,
                                     .y = 20,
                                     .width = 8,
                                     .height = 4,
                                     .spacing = {0, -1, 5}});
  EXPECT_EQ(block.vertices,
            (std::array<uint32_t, 4>{1, 2, 3, 9u | 4u << 24 | 1u << 27 | 1u << 28 | 1u << 29}));
  EXPECT_EQ(block.shape, (std::array<uint32_t, 4>{10u | 20u << 16, 8u | 4u << 16, 0x05ff00u, 0u}));
  const TriangleRecord color = pack({.single_color = true, .rgb = 0x123456});
  EXPECT_EQ(color.vertices[3], 1u << 30);
  EXPECT_EQ(color.shape[0], 0x123456u);
}

}  // namespace
}  // namespace tessera::client
