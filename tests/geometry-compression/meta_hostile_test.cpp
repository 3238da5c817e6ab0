// Packets from an enemy, a broken disk, or a truncated stream.
#include <gtest/gtest.h>

#include <limits>
#include <memory>
#include <random>

#include "geometry-compression/bit_io.h"
#include "geometry-compression/columns.h"
#include "geometry-compression/meta_codec.h"
#include "synthetic.h"

namespace tessera::geometry_compression {
namespace {

std::string decode_exactly(std::span<const uint8_t> bytes) {
  const std::unique_ptr<uint8_t[]> copy(new uint8_t[bytes.size()]);  // the address sanitizer guards its end
  std::copy(bytes.begin(), bytes.end(), copy.get());
  MetaFrame out;
  return decode({copy.get(), bytes.size()}, out);
}

TEST(MetaHostile, EveryPrefixIsAnError) {
  std::mt19937 random(2);
  std::vector<std::vector<uint8_t>> packets = {encode({}), encode(torus_frame(random, 8))};
  for (int i = 0; i < 30; ++i) packets.push_back(encode(random_frame(random, 8)));
  for (const auto& packet : packets)
    for (size_t size = 0; size < packet.size(); ++size)
      ASSERT_NE(decode_exactly(std::span(packet).first(size)), "") << size << " of " << packet.size();
}

TEST(MetaHostile, DataAfterTheEndIsAnError) {
  std::mt19937 random(3);
  auto packet = encode(random_frame(random, 8));
  packet.push_back(0);
  EXPECT_NE(decode_exactly(packet), "");
}

TEST(MetaHostile, FlippedBitsNeverCrash) {
  std::mt19937 random(4);
  int errors = 0;
  for (int round = 0; round < 3000; ++round) {
    auto packet = encode(random_frame(random, 10));
    for (uint32_t flips = 1 + random() % 4; flips > 0; --flips)
      packet[random() % packet.size()] ^= static_cast<uint8_t>(1u << random() % 8);
    errors += !decode_exactly(packet).empty();
  }
  EXPECT_GT(errors, 500);  // most flips give another valid value
}

TEST(MetaHostile, NoiseBehindAValidHeaderNeverCrashes) {
  std::mt19937 random(5);
  for (int round = 0; round < 3000; ++round) {
    auto packet = encode({});
    packet.resize(19 + random() % 200);
    for (size_t i = 17; i < packet.size(); ++i) packet[i] = static_cast<uint8_t>(random());
    decode_exactly(packet);
  }
}

// In the order of the sections.
using SectionCounts = std::array<uint32_t, 6>;

void put_header(BitWriter& out, const SectionCounts& counts) {
  out.put(0x54534D46, 32);
  out.put(kMetaVersion, 8);
  out.put(0, 64);
  out.put(16 << 16 | 16, 32);
  out.put(0, 1);
  for (uint32_t n : counts) out.put_unsigned(n, 6);
  out.put_unsigned(0, 12);
}

std::vector<uint8_t> header_that_claims(const SectionCounts& counts) {
  BitWriter out;
  put_header(out, counts);
  return std::move(out).take();
}

TEST(MetaHostile, ClaimsBeyondTheLimitsAreRefusedBeforeAnythingIsRead) {
  for (int section = 0; section < 6; ++section) {
    std::array<uint32_t, 6> counts{};
    counts[section] = UINT32_MAX;
    const std::string error = decode_exactly(header_that_claims(counts));
    EXPECT_NE(error.find("limit"), std::string::npos) << error;
  }
}

TEST(MetaHostile, ClaimsWithinTheLimitsAllocateOnlyWhatTheBytesHold) {
  for (int section = 0; section < 6; ++section) {
    std::array<uint32_t, 6> counts{};
    counts[section] = 1u << 20;
    const auto packet = header_that_claims(counts);
    MetaFrame out;
    EXPECT_NE(decode(packet, out), "");
    // A run header of 5 bits brings at most 64 items.
    const size_t most = 64 * 8 * packet.size() / 5;
    EXPECT_LE(out.meshes.capacity(), most);
    EXPECT_LE(out.vertices.capacity(), most);
    EXPECT_LE(out.objects.capacity(), most);
    EXPECT_LE(out.moved.capacity(), most);
    EXPECT_LE(out.patches.capacity(), most);
    EXPECT_LE(out.placements.capacity(), most);
  }
}

TEST(MetaHostile, LimitsAreTheReceivers) {
  std::mt19937 random(8);
  const auto packet = encode(torus_frame(random, 8));
  MetaFrame out;
  EXPECT_EQ(decode(packet, out), "");
  EXPECT_NE(decode(packet, out, {.max_vertices = 63}), "");
  EXPECT_NE(decode(packet, out, {.max_objects = 0}), "");
  EXPECT_NE(decode(packet, out, {.max_patches = 63}), "");
}

TEST(MetaHostile, OtherVersionsAndFormatsAreNamed) {
  auto packet = encode({});
  packet[4] = kMetaVersion + 1;
  EXPECT_NE(decode_exactly(packet).find("version " + std::to_string(kMetaVersion + 1)), std::string::npos);
  packet = encode({});
  packet[0] = 'X';
  EXPECT_NE(decode_exactly(packet).find("TSMF"), std::string::npos);
}

TEST(MetaHostile, ValuesOutsideTheirRangeAreErrors) {
  const float inf = std::numeric_limits<float>::infinity();
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const auto refuses = [](const MetaFrame& frame) { return !decode_exactly(encode(frame)).empty(); };
  for (float bad : {inf, -inf, nan}) {
    MetaFrame f;
    f.objects.resize(1);
    f.objects[0].transform.linear[4] = bad;
    EXPECT_TRUE(refuses(f));
    f = {};
    f.moved.resize(1);
    f.moved[0].transform.translation[2] = bad;
    EXPECT_TRUE(refuses(f));
    f = {};
    f.meshes.resize(1);
    f.meshes[0].offset[0] = bad;
    EXPECT_TRUE(refuses(f));
  }
  MetaFrame f;
  for (double step : {0.0, -1.0}) {
    f = {};
    f.meshes = {{{}, step}};
    EXPECT_TRUE(refuses(f));
  }
  for (int32_t q : {1 << 30, -(1 << 30)}) {
    f = {};
    f.vertices = {{0, {0, q, 0}}};
    EXPECT_TRUE(refuses(f));
  }
  f = {};
  const auto refuses_block = [&](uint16_t x, uint16_t width, uint16_t height) {
    f.placements = {{.kind = PlacementKind::block, .x = x, .width = width, .height = height}};
    return refuses(f);
  };
  EXPECT_FALSE(refuses_block(8190, 2, 2));
  EXPECT_TRUE(refuses_block(8192, 2, 2));
  EXPECT_TRUE(refuses_block(0, 9, 1));
  EXPECT_TRUE(refuses_block(0, 1, 0));
}

TEST(MetaHostile, VertexRulesThatDoNotExistAreErrors) {
  for (const uint32_t rank : {12u, 13u, 63u}) {
    BitWriter out;
    put_header(out, {0, 0, 0, 1, 0, 0});
    write_column(out, std::vector<uint32_t>{1});  // one triangle less than two
    write_repeats(out, std::vector<uint32_t>{0});
    for (const uint32_t of_corner : {0u, rank, 0u}) write_column(out, std::vector<uint32_t>{of_corner});
    for (int corner = 3; corner < 5; ++corner) write_column(out, {});
    const bool spelled_out = rank == 12;
    out.put_unsigned(spelled_out, 4);
    write_column(out, std::vector<uint32_t>(spelled_out));
    out.put_unsigned(0, 4);  // vertices' runs of meshes
    out.put(0, 4);           // placements
    const std::string error = decode_exactly(std::move(out).take());
    if (spelled_out)
      EXPECT_EQ(error, "");
    else
      EXPECT_NE(error.find("no vertex rule " + std::to_string(rank)), std::string::npos) << error;
  }
}

TEST(MetaHostile, LsAndHalvesOutOfTheirRangesAreErrors) {
  const auto refuses_l = [](uint16_t x, LPlacement l, int8_t spacing = 0) {
    MetaFrame f, out;
    f.placements = {{.part = 1, .kind = PlacementKind::l, .x = x, .spacing = {spacing}, .l = l}};
    return !decode(encode(f), out).empty();
  };
  EXPECT_FALSE(refuses_l(8190, {64, 31, true, 8190}, -126));
  EXPECT_TRUE(refuses_l(8192, {64, 1, true, 0}));
  EXPECT_TRUE(refuses_l(0, {0, 1, false, 0}));
  EXPECT_TRUE(refuses_l(0, {65, 1, false, 0}));
  EXPECT_TRUE(refuses_l(0, {3, 0, false, 0}));
  EXPECT_TRUE(refuses_l(0, {3, 32, false, 0}));
  EXPECT_TRUE(refuses_l(0, {3, 2, false, 8192}));
  EXPECT_TRUE(refuses_l(0, {3, 1, false, 0}, 127));

  const auto refuses_halves = [](HalvesPlacement halves) {
    MetaFrame f, out;
    f.placements = {{.part = 3, .kind = PlacementKind::halves, .halves = halves}};
    return !decode(encode(f), out).empty();
  };
  EXPECT_FALSE(refuses_halves({2, 63, 128, {{{8191, 8190, 1024, true}, {0, 0, 1, true}}}}));
  EXPECT_TRUE(refuses_halves({3, 0, 1, {{{0, 0, 1, false}, {0, 0, 1, true}}}}));
  EXPECT_TRUE(refuses_halves({0, 64, 1, {{{0, 0, 1, false}, {0, 0, 1, true}}}}));
  EXPECT_TRUE(refuses_halves({0, 0, 0, {{{0, 0, 1, false}, {0, 0, 1, true}}}}));
  EXPECT_TRUE(refuses_halves({0, 0, 129, {{{0, 0, 1, false}, {0, 0, 1, true}}}}));
  EXPECT_TRUE(refuses_halves({0, 0, 1, {{{0, 0, 0, false}, {0, 0, 1, true}}}}));
  EXPECT_TRUE(refuses_halves({0, 0, 1, {{{0, 0, 1, false}, {0, 0, 1025, true}}}}));
  EXPECT_TRUE(refuses_halves({0, 0, 1, {{{8192, 0, 1, false}, {0, 0, 1, true}}}}));
  EXPECT_TRUE(refuses_halves({0, 0, 1, {{{0, 0, 1, false}, {0, 8192, 1, true}}}}));
}

}  // namespace
}  // namespace tessera::geometry_compression
