#include "geometry-compression/bit_io.h"

#include <gtest/gtest.h>

#include <random>

#include "geometry-compression/columns.h"

namespace tessera::geometry_compression {
namespace {

// On the heap at the exact size, so that the address sanitizer sees a read past the end.
std::vector<uint8_t> exactly(std::span<const uint8_t> bytes) {
  return {bytes.begin(), bytes.end()};
}

TEST(BitIo, EveryWidthKeepsItsValue) {
  std::mt19937_64 random(1);
  std::vector<std::pair<uint64_t, uint32_t>> written;
  BitWriter out;
  for (int round = 0; round < 50; ++round)
    for (uint32_t count = 0; count <= 64; ++count) {
      const uint64_t value = count == 64 ? random() : random() & ((uint64_t{1} << count) - 1);
      out.put(value, count);
      written.emplace_back(value, count);
    }
  const uint64_t bits = out.bit_count();
  const auto bytes = exactly(std::move(out).take());
  EXPECT_EQ(bytes.size(), (bits + 7) / 8);
  BitReader in(bytes);
  for (const auto& [value, count] : written) ASSERT_EQ(in.get(count), value);
  EXPECT_TRUE(in.ok());
}

TEST(BitIo, ExpGolombHasTheTextbookCodes) {
  // Order 0 as in H.264 (table 9-2): 1, 010, 011, 00100, …
  const struct {
    uint32_t value, order;
    uint64_t code;
    uint32_t bits;
  } known[] = {{0, 0, 0b1, 1},     {1, 0, 0b010, 3},     {2, 0, 0b011, 3},  {3, 0, 0b00100, 5},
               {6, 0, 0b00111, 5}, {7, 0, 0b0001000, 7}, {0, 1, 0b10, 2},   {1, 1, 0b11, 2},
               {2, 1, 0b0100, 4},  {5, 1, 0b0111, 4},    {0, 3, 0b1000, 4}, {7, 3, 0b1111, 4},
               {8, 3, 0b010000, 6}};
  for (const auto& k : known) {
    BitWriter out;
    out.put_unsigned(k.value, k.order);
    EXPECT_EQ(out.bit_count(), k.bits);
    const auto bytes = std::move(out).take();
    EXPECT_EQ(BitReader(bytes).get(k.bits), k.code) << k.value << " of order " << k.order;
  }
}

TEST(BitIo, ExpGolombKeepsSmallAndExtremeValuesForEveryOrder) {
  std::vector<uint32_t> values;
  for (uint32_t v = 0; v < 600; ++v) values.push_back(v);
  for (int bit = 9; bit < 32; ++bit)
    for (uint32_t d : {~0u, 0u, 1u}) values.push_back((1u << bit) + d);
  for (uint32_t v : {INT32_MAX, INT32_MIN + 0}) values.push_back(v);
  for (uint32_t v = 0; v < 5; ++v) values.push_back(UINT32_MAX - v);
  for (uint32_t order = 0; order <= kMaxOrder; ++order) {
    BitWriter out;
    uint64_t bits = 0;
    for (uint32_t v : values) {
      out.put_unsigned(v, order);
      out.put_signed(static_cast<int32_t>(v), order);
      bits += exp_golomb_bits(v, order) + exp_golomb_bits(zigzag(static_cast<int32_t>(v)), order);
      ASSERT_EQ(out.bit_count(), bits) << v << " of order " << order;
    }
    const auto bytes = exactly(std::move(out).take());
    BitReader in(bytes);
    for (uint32_t v : values) {
      ASSERT_EQ(in.get_unsigned(order), v) << "order " << order;
      ASSERT_EQ(in.get_signed(order), static_cast<int32_t>(v)) << "order " << order;
    }
    EXPECT_TRUE(in.ok());
    EXPECT_LT(in.bits_left(), 8u);
  }
}

TEST(BitIo, ZigzagOrdersByMagnitudeAndReversesOverTheWholeRange) {
  for (int32_t v = -1000; v <= 1000; ++v) {
    EXPECT_EQ(unzigzag(zigzag(v)), v);
    EXPECT_EQ(zigzag(v), static_cast<uint32_t>(v < 0 ? -2 * v - 1 : 2 * v));
  }
  for (int32_t v : {INT32_MIN, INT32_MIN + 1, INT32_MAX - 1, INT32_MAX}) EXPECT_EQ(unzigzag(zigzag(v)), v);
}

TEST(BitIo, AnErrorStaysAndReadsAsZero) {
  const auto bytes = exactly(std::vector<uint8_t>{0xff, 0xff});
  BitReader in(bytes);
  EXPECT_EQ(in.get(12), 0xfffu);
  EXPECT_EQ(in.get(5), 0u);  // four are left
  EXPECT_FALSE(in.ok());
  EXPECT_EQ(in.get(1), 0u);
  EXPECT_EQ(in.get_unsigned(3), 0u);
  EXPECT_FALSE(in.ok());
}

TEST(BitIo, CodesThatNoValueHasAreErrors) {
  // 2^32 + 1 of order 0 would be the value 2^32; 33 leading zeros have no value at all.
  for (const auto& [prefix, rest] : {std::pair{32u, 1ull << 32 | 1}, std::pair{33u, 1ull << 33}}) {
    BitWriter out;
    out.put(0, prefix);
    out.put(rest, prefix + 1);
    const auto bytes = exactly(std::move(out).take());
    BitReader in(bytes);
    in.get_unsigned(0);
    EXPECT_FALSE(in.ok()) << prefix;
  }
  const std::vector<uint8_t> zeros(64, 0);
  for (uint32_t order = 0; order <= kMaxOrder; ++order) {
    BitReader in(zeros);
    in.get_unsigned(order);
    EXPECT_FALSE(in.ok()) << order;
  }
}

TEST(Columns, KeepRunsOfEveryKindAndLength) {
  std::mt19937 random(7);
  for (uint32_t count : {0u, 1u, 63u, 64u, 65u, 128u, 1000u})
    for (uint32_t shift : {0u, 8u, 20u, 31u}) {
      std::vector<uint32_t> values(count);
      for (uint32_t i = 0; i < count; ++i)
        values[i] = i / 100 % 2 ? 0 : static_cast<uint32_t>(random()) >> shift;
      BitWriter out;
      write_column(out, values);
      write_repeats(out, values);
      const auto bytes = exactly(std::move(out).take());
      BitReader in(bytes);
      EXPECT_EQ(read_column(in, count), values);
      std::vector<uint32_t> repeats;
      EXPECT_TRUE(
          read_repeats(in, count, [&](uint32_t n, uint32_t v) { repeats.insert(repeats.end(), n, v); }));
      EXPECT_EQ(repeats, values);
    }
}

TEST(Columns, ARunTakesItsCheapestCodeAndZerosTakeNothing) {
  const auto bits = [](const std::vector<uint32_t>& values) {
    BitWriter out;
    write_column(out, values);
    return out.bit_count();
  };
  EXPECT_EQ(bits(std::vector<uint32_t>(kRunLength, 0)), kCodeBits);
  EXPECT_EQ(bits(std::vector<uint32_t>(kRunLength, 255)), kCodeBits + kRunLength * 9);  // order 8
  std::mt19937 random(3);
  std::vector<uint32_t> mixed(kRunLength);
  for (uint32_t& v : mixed) v = static_cast<uint32_t>(random()) >> (random() % 32);
  uint64_t best = UINT64_MAX;
  for (uint32_t order = 0; order <= kLastOrder; ++order) {
    uint64_t sum = kCodeBits;
    for (uint32_t v : mixed) sum += exp_golomb_bits(v, order);
    best = std::min(best, sum);
  }
  EXPECT_EQ(bits(mixed), best);
}

TEST(Columns, EvenlySpreadSmallValuesArePlainNumbers) {
  for (uint32_t width = 1; kLastOrder + width < kAllZeros; ++width) {
    std::vector<uint32_t> values(kRunLength);
    for (uint32_t i = 0; i < kRunLength; ++i) values[i] = (i * 37) % (1u << width);
    BitWriter out;
    write_column(out, values);
    EXPECT_EQ(out.bit_count(), kCodeBits + kRunLength * width);
    const auto bytes = exactly(std::move(out).take());
    BitReader in(bytes);
    EXPECT_EQ(read_column(in, kRunLength), values);
  }
}

}  // namespace
}  // namespace tessera::geometry_compression
