// The core with the real decoders: access units and packets as they come from the network.
#include "client-sdk/client_core.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "codec/video_encoder.h"
#include "codec/yuv.h"
#include "geometry-compression/meta_codec.h"
#include "meta_builder.h"

namespace tessera::client {
namespace {

using namespace test;
using ::testing::HasSubstr;

constexpr uint32_t kSide = 64;
constexpr FrameNumber kStart = 0xfffffffdu;  // wraps around within each test

// Luma of frame `index`: far enough from its neighbours' that coding cannot confuse them.
uint8_t luma_of(uint32_t index) {
  return static_cast<uint8_t>(40 + index % 10 * 18);
}

struct Frame {
  std::vector<uint8_t> atlas, meta;
};

// A stream of frames; `key_frames` are asked for by index.
std::vector<Frame> make_stream(uint32_t count, const std::vector<uint32_t>& key_frames) {
  auto encoder = codec::VideoEncoder::create(
      {.width = kSide, .height = kSide, .bitrate_bps = 4e6, .encoder = "x264", .preset = "ultrafast"});
  if (!encoder.ok()) {
    ADD_FAILURE() << encoder.status();
    std::abort();
  }
  std::vector<Frame> stream;
  for (uint32_t i = 0; i < count; ++i) {
    YuvImage picture{kSide, kSide, std::vector<uint8_t>(kSide * kSide, luma_of(i)),
                     std::vector<uint8_t>(kSide * kSide / 4, 128),
                     std::vector<uint8_t>(kSide * kSide / 4, 128)};
    const bool key = std::find(key_frames.begin(), key_frames.end(), i) != key_frames.end();
    auto unit = (*encoder)->encode(kStart + i, codec::view_of(picture), 1e5, key);
    if (!unit.ok()) {
      ADD_FAILURE() << unit.status();
      std::abort();
    }
    MetaFrame meta = i == 0 ? first_frame(kStart) : next_frame(kStart + i);
    meta.atlas_width = meta.atlas_height = kSide;
    meta.placements.push_back(in_color(0, i));
    stream.push_back({unit->bytes, geometry_compression::encode(meta)});
  }
  return stream;
}

std::unique_ptr<ClientCore> make_core() {
  auto core = ClientCore::create();
  if (!core.ok()) {
    ADD_FAILURE() << core.status();
    std::abort();
  }
  return *std::move(core);
}

// The index of a pair whose two halves belong together.
uint32_t checked_index(const Pair& pair) {
  const uint32_t index = pair.frame - kStart;
  EXPECT_NEAR(pair.atlas.y[kSide * kSide / 2], luma_of(index), 6);
  EXPECT_EQ(pair.state.frame, pair.frame);
  EXPECT_EQ(unpack(pair.state.records[0].at(0)).rgb, index);
  return index;
}

std::optional<uint32_t> take(ClientCore& core) {
  const Pair* pair = core.take_newest();
  return pair == nullptr ? std::nullopt : std::optional(checked_index(*pair));
}

TEST(ClientCore, PairsEveryFrameOfAnUndisturbedStream) {
  const auto stream = make_stream(12, {0, 7});
  auto core = make_core();
  for (uint32_t i = 0; i < stream.size(); ++i) {
    if (i % 2 == 0) {
      ASSERT_TRUE(core->on_meta(stream[i].meta).ok());
    }
    const Status status = core->on_atlas(stream[i].atlas).status();
    ASSERT_TRUE(status.ok()) << status;
    if (i % 2 == 1) {
      ASSERT_TRUE(core->on_meta(stream[i].meta).ok());
    }
    EXPECT_EQ(take(*core), i);
    EXPECT_FALSE(core->wants_key_frame());
  }
  const ClientStats stats = core->stats();
  EXPECT_EQ(stats.pairs, 12u);
  EXPECT_EQ(stats.atlas_frames, 12u);
  EXPECT_EQ(stats.meta_frames, 12u);
  EXPECT_EQ(stats.decode_errors, 0u);
  EXPECT_EQ(stats.orphans, 0u);
  EXPECT_EQ(stats.pairs_skipped, 0u);
  EXPECT_EQ(stats.newest_pair, kStart + 11);
}

// After a lost or damaged access unit nothing is shown that builds on it.
TEST(ClientCore, ABrokenVideoChainIsNotShownUntilTheNextKeyFrame) {
  const auto stream = make_stream(8, {0, 6});
  for (bool lost : {true, false}) {
    auto core = make_core();
    for (uint32_t i = 0; i < stream.size(); ++i) {
      ASSERT_TRUE(core->on_meta(stream[i].meta).ok());
      if (i == 2) {
        if (!lost) {
          EXPECT_FALSE(core->on_atlas(std::span(stream[i].atlas).first(stream[i].atlas.size() / 2)).ok());
        }
        continue;
      }
      const Status status = core->on_atlas(stream[i].atlas).status();
      const bool broken = i > 2 && i < 6;
      EXPECT_EQ(status.ok(), !broken) << i;
      EXPECT_EQ(core->wants_key_frame(), broken);
      EXPECT_EQ(take(*core), broken ? std::nullopt : std::optional(i));
    }
    EXPECT_EQ(core->stats().orphans, 3u);
    EXPECT_EQ(core->stats().decode_errors, lost ? 0u : 1u);
  }
}

TEST(ClientCore, RefusesAtlasesLargerThanTheSessions) {
  const auto stream = make_stream(1, {0});
  auto core = ClientCore::create(AtlasCodec::h264, kSide / 2, kSide / 2);
  ASSERT_TRUE(core.ok()) << core.status();
  EXPECT_EQ((*core)->on_atlas(stream[0].atlas).status().code(), absl::StatusCode::kResourceExhausted);
}

TEST(ClientCore, StaysUsableAfterNoise) {
  const auto stream = make_stream(3, {0, 1, 2});
  auto core = make_core();
  std::vector<uint8_t> noise(300);
  for (size_t i = 0; i < noise.size(); ++i) noise[i] = static_cast<uint8_t>(i * i * 31 >> 3);
  ASSERT_TRUE(core->on_meta(stream[0].meta).ok());
  EXPECT_FALSE(core->on_atlas(noise).ok());
  EXPECT_FALSE(core->on_atlas({}).ok());
  EXPECT_TRUE(core->wants_key_frame());
  ASSERT_TRUE(core->on_atlas(stream[0].atlas).ok());
  EXPECT_FALSE(core->wants_key_frame());
  EXPECT_EQ(take(*core), 0u);
}

TEST(ClientCore, ADamagedMetaPacketIsAnErrorThatLastsUntilFullState) {
  const auto stream = make_stream(4, {0});
  auto core = make_core();
  ASSERT_TRUE(core->on_meta(stream[0].meta).ok());
  const Status status = core->on_meta(std::span(stream[1].meta).first(stream[1].meta.size() / 2)).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(status.message()), HasSubstr("meta packet of"));
  EXPECT_EQ(core->on_meta(stream[2].meta).status().code(), absl::StatusCode::kDataLoss);
  for (uint32_t i = 0; i < 4; ++i) ASSERT_TRUE(core->on_atlas(stream[i].atlas).ok());
  EXPECT_EQ(take(*core), 0u);

  MetaFrame anew = first_frame(kStart + 3);
  anew.atlas_width = anew.atlas_height = kSide;
  anew.placements.push_back(in_color(0, 3));
  ASSERT_TRUE(core->on_meta(geometry_compression::encode(anew)).ok());
  EXPECT_EQ(take(*core), 3u);
  EXPECT_EQ(core->stats().decode_errors, 2u);
}

TEST(ClientCore, ReceivesAndDrawsOnTwoThreads) {
  constexpr uint32_t kFrames = 150;
  const auto stream = make_stream(kFrames, {0});
  auto core = make_core();
  std::atomic<bool> failed{false};
  std::jthread receiver([&] {
    for (const Frame& frame : stream) {
      if (!core->on_meta(frame.meta).ok() || !core->on_atlas(frame.atlas).ok()) failed = true;
    }
  });
  std::optional<uint32_t> newest;
  uint64_t taken = 0;
  while (newest != kFrames - 1 && !failed) {
    const auto index = take(*core);
    if (!index) {
      std::this_thread::yield();
      continue;
    }
    EXPECT_TRUE(!newest || *index > *newest);
    EXPECT_FALSE(core->wants_key_frame());
    EXPECT_LE(core->stats().pairs, kFrames);
    newest = index;
    ++taken;
  }
  receiver.join();
  EXPECT_FALSE(failed);
  EXPECT_EQ(core->stats().pairs, kFrames);
  EXPECT_EQ(core->stats().pairs_skipped, kFrames - taken);
}

// Losses and damage on the receiving thread; the drawing thread still sees whole pairs of intact chains only.
TEST(ClientCore, DrawsOnlyIntactChainsWhileAnotherThreadReceivesDamage) {
  constexpr uint32_t kGroup = 10, kGroups = 12, kLost = 4;  // a key frame begins each group
  constexpr uint32_t kFrames = kGroup * kGroups;
  std::vector<uint32_t> key_frames;
  for (uint32_t group = 0; group < kGroups; ++group) key_frames.push_back(group * kGroup);
  const auto stream = make_stream(kFrames, key_frames);
  auto core = make_core();
  std::atomic<bool> done{false}, meta_failed{false};
  std::jthread receiver([&] {
    for (uint32_t i = 0; i < kFrames; ++i) {
      if (!core->on_meta(stream[i].meta).ok()) meta_failed = true;
      const std::span<const uint8_t> unit = stream[i].atlas;
      if (i % kGroup != kLost) {
        (void)core->on_atlas(unit);
      } else if (i / kGroup % 2 == 0) {
        (void)core->on_atlas(unit.first(unit.size() / 2));
      }
    }
    done = true;
  });
  std::optional<uint32_t> newest;
  while (true) {
    const bool last_look = done;
    if (const auto index = take(*core)) {
      EXPECT_LT(*index % kGroup, kLost) << "drawn though its chain is broken";
      EXPECT_TRUE(!newest || *index > *newest);
      newest = index;
    } else if (last_look) {
      break;
    } else {
      std::this_thread::yield();
    }
  }
  EXPECT_FALSE(meta_failed);
  EXPECT_TRUE(core->wants_key_frame());
  EXPECT_EQ(newest, kFrames - kGroup + kLost - 1);
  EXPECT_EQ(core->stats().pairs, kGroups * kLost);
}

}  // namespace
}  // namespace tessera::client
