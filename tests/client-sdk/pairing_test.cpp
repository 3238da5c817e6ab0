#include "client-sdk/pairing.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "meta_builder.h"

namespace tessera::client {
namespace {

using namespace test;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

// Frame numbers start just before the wrap-around in most tests.
constexpr FrameNumber kStart = 0xfffffffeu;

// Feeds frames by their index. The picture's luma and the one patch's colour both say which frame they belong
// to.
class Bench {
 public:
  explicit Bench(FrameNumber start = kStart) : start_(start) {}

  Status atlas(uint32_t index, uint32_t side = 16) {
    std::vector<uint8_t> luma(size_t{side} * side, static_cast<uint8_t>(index)), chroma(luma.size() / 4, 128);
    const YuvView picture{side, side, luma.data(), chroma.data(), chroma.data(), side, side / 2};
    return pairing_.on_atlas(start_ + index, picture);
  }

  Status meta(uint32_t index) {
    MetaFrame frame = index == 0 ? first_frame(start_) : next_frame(start_ + index);
    frame.placements.push_back(in_color(0, index));
    return pairing_.on_meta(frame);
  }

  Status full_state(uint32_t index) {
    MetaFrame frame = first_frame(start_ + index);
    frame.placements.push_back(in_color(0, index));
    return pairing_.on_meta(frame);
  }

  // The index of the pair that was published since the last call; checks that its halves belong together.
  std::optional<uint32_t> take() {
    const Pair* pair = pairs_.take();
    if (pair == nullptr) return std::nullopt;
    const uint32_t index = pair->frame - start_;
    EXPECT_EQ(pair->state.frame, pair->frame);
    EXPECT_EQ(pair->atlas.y[0], index);
    EXPECT_EQ(unpack(pair->state.records[0].at(0)).rgb, index);
    return index;
  }

  Pairing& pairing() { return pairing_; }

 private:
  FrameNumber start_;
  TripleBuffer<Pair> pairs_;
  Pairing pairing_{pairs_};
};

TEST(Pairing, AMetaThatRunsAheadDoesNotReachAnOlderAtlas) {
  Bench bench;
  ASSERT_TRUE(bench.meta(0).ok());
  ASSERT_TRUE(bench.meta(1).ok());
  ASSERT_TRUE(bench.meta(2).ok());
  EXPECT_EQ(bench.take(), std::nullopt);
  ASSERT_TRUE(bench.atlas(0).ok());
  EXPECT_EQ(bench.take(), 0u);  // take() checks the state is frame 0's
  ASSERT_TRUE(bench.atlas(1).ok());
  EXPECT_EQ(bench.take(), 1u);
}

TEST(Pairing, ANewerPairReplacesOneThatWasNotTaken) {
  Bench bench;
  for (uint32_t i = 0; i < 3; ++i) {
    ASSERT_TRUE(bench.meta(i).ok());
    ASSERT_TRUE(bench.atlas(i).ok());
  }
  EXPECT_EQ(bench.take(), 2u);
  EXPECT_EQ(bench.pairing().published(), 3u);
  EXPECT_EQ(bench.pairing().skipped(), 2u);
  EXPECT_EQ(bench.take(), std::nullopt);
}

// One arrival: the meta or the atlas of a frame.
struct Arrival {
  bool is_meta;
  uint32_t index;
};

// All frames' metas in order, interleaved in every way with `atlases` in their order.
void for_each_interleaving(uint32_t metas, const std::vector<uint32_t>& atlases,
                           const std::function<void(const std::vector<Arrival>&)>& run) {
  std::vector<bool> is_meta(metas + atlases.size(), false);
  std::fill(is_meta.end() - metas, is_meta.end(), true);
  do {
    std::vector<Arrival> arrivals;
    uint32_t meta = 0;
    size_t atlas = 0;
    for (bool m : is_meta) arrivals.push_back(m ? Arrival{true, meta++} : Arrival{false, atlases[atlas++]});
    run(arrivals);
  } while (std::next_permutation(is_meta.begin(), is_meta.end()));
}

// Every ordered choice of frames out of `count`: losses and reorderings together.
void for_each_delivery(uint32_t count, std::vector<uint32_t>& chosen,
                       const std::function<void(const std::vector<uint32_t>&)>& run) {
  run(chosen);
  for (uint32_t i = 0; i < count; ++i) {
    if (std::find(chosen.begin(), chosen.end(), i) != chosen.end()) continue;
    chosen.push_back(i);
    for_each_delivery(count, chosen, run);
    chosen.pop_back();
  }
}

void check_run(const std::vector<uint32_t>& delivered, const std::vector<Arrival>& arrivals) {
  Bench bench;
  std::vector<uint32_t> shown;
  for (const Arrival& arrival : arrivals) {
    ASSERT_TRUE((arrival.is_meta ? bench.meta(arrival.index) : bench.atlas(arrival.index)).ok());
    if (const auto index = bench.take()) shown.push_back(*index);
  }
  // Only what was delivered, in order, none twice (take() has checked that the halves belong together).
  for (size_t i = 0; i < shown.size(); ++i) {
    EXPECT_NE(std::find(delivered.begin(), delivered.end(), shown[i]), delivered.end());
    if (i > 0) {
      EXPECT_LT(shown[i - 1], shown[i]);
    }
  }
  // The newest picture is always reached, and if none came late, so is every one.
  if (!delivered.empty()) {
    ASSERT_FALSE(shown.empty());
    EXPECT_EQ(shown.back(), *std::max_element(delivered.begin(), delivered.end()));
  }
  if (std::is_sorted(delivered.begin(), delivered.end())) {
    EXPECT_EQ(bench.pairing().published(), delivered.size());
  }
}

TEST(Pairing, RulesHoldForAllInterleavingsLossesAndReorderings) {
  constexpr uint32_t kFrames = 5;
  size_t runs = 0;
  std::vector<uint32_t> chosen;
  for_each_delivery(kFrames, chosen, [&](const std::vector<uint32_t>& delivered) {
    for_each_interleaving(kFrames, delivered, [&](const std::vector<Arrival>& arrivals) {
      if (::testing::Test::HasFailure()) return;
      ++runs;
      check_run(delivered, arrivals);
    });
  });
  EXPECT_EQ(runs, 1u * 1 + 5 * 6 + 20 * 21 + 60 * 56 + 120 * 126 + 120 * 252) << "the enumeration itself";
}

TEST(Pairing, AStalledMetaChannelLowersTheRateButDoesNotStopThePairs) {
  for (uint32_t delay : {3u, 9u, 20u, 60u}) {
    Bench bench;
    uint32_t shown = 0;
    for (uint32_t i = 0; i < 250; ++i) {
      ASSERT_TRUE(bench.atlas(i).ok());
      if (i >= delay) {
        ASSERT_TRUE(bench.meta(i - delay).ok());
      }
      shown += bench.take().has_value() ? 1 : 0;
    }
    // At best as many per delay as wait at a time; at least half of that.
    const uint32_t possible =
        (250 - delay) * std::min<uint32_t>(delay, Pairing::kMaxWaitingAtlases - 1) / delay;
    EXPECT_GE(shown, possible / 2) << delay;
  }
}

TEST(Pairing, AfterAMetaStallTheNewestFrameIsShownAtOnce) {
  Bench bench;
  for (uint32_t i = 0; i < 100; ++i) ASSERT_TRUE(bench.atlas(i).ok());
  for (uint32_t i = 0; i < 100; ++i) ASSERT_TRUE(bench.meta(i).ok());
  EXPECT_EQ(bench.take(), 99u);
}

TEST(Pairing, AStalledAtlasChannelCatchesUp) {
  Bench bench;
  for (uint32_t i = 0; i < 100; ++i) ASSERT_TRUE(bench.meta(i).ok());
  std::vector<uint32_t> shown;
  for (uint32_t i = 0; i < 100; ++i) {
    ASSERT_TRUE(bench.atlas(i).ok());
    if (const auto index = bench.take()) shown.push_back(*index);
  }
  // The scene has moved past all but the held frames; those are shown one by one.
  EXPECT_THAT(shown, ElementsAre(92, 93, 94, 95, 96, 97, 98, 99));
}

TEST(Pairing, ADamagedMetaEndsTheStateUntilAFullState) {
  Bench bench;
  ASSERT_TRUE(bench.meta(0).ok());
  ASSERT_TRUE(bench.atlas(0).ok());
  EXPECT_EQ(bench.take(), 0u);
  bench.pairing().on_damaged_meta();
  ASSERT_TRUE(bench.atlas(1).ok());
  EXPECT_EQ(bench.meta(2).code(), absl::StatusCode::kDataLoss);
  ASSERT_TRUE(bench.atlas(2).ok());
  EXPECT_EQ(bench.take(), std::nullopt);
  ASSERT_TRUE(bench.full_state(3).ok());
  ASSERT_TRUE(bench.atlas(3).ok());
  EXPECT_EQ(bench.take(), 3u);
  ASSERT_TRUE(bench.meta(4).ok());
  ASSERT_TRUE(bench.atlas(4).ok());
  EXPECT_EQ(bench.take(), 4u);
}

TEST(Pairing, ADamagedMetaSparesTheFramesBeforeIt) {
  Bench bench;
  ASSERT_TRUE(bench.meta(0).ok());
  ASSERT_TRUE(bench.meta(1).ok());
  bench.pairing().on_damaged_meta();
  ASSERT_TRUE(bench.atlas(0).ok());
  EXPECT_EQ(bench.take(), 0u);
  ASSERT_TRUE(bench.atlas(1).ok());
  EXPECT_EQ(bench.take(), 1u);
}

TEST(Pairing, APictureOfAnotherSizeThanTheMetaSaysIsRefused) {
  Bench bench;
  ASSERT_TRUE(bench.meta(0).ok());
  const Status status = bench.atlas(0, 32);
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(status.message()), HasSubstr("32x32, but its meta frame says 16x16"));
  EXPECT_EQ(bench.take(), std::nullopt);
  ASSERT_TRUE(bench.meta(1).ok());
  EXPECT_TRUE(bench.atlas(1).ok());
  EXPECT_EQ(bench.take(), 1u);
}

// The decoder's rows may be padded.
TEST(Pairing, CopiesPicturesWithoutTheirPadding) {
  TripleBuffer<Pair> pairs;
  Pairing pairing(pairs);
  std::vector<uint8_t> luma(16 * 20), chroma(8 * 11);
  for (size_t i = 0; i < luma.size(); ++i) luma[i] = i % 20 < 16 ? static_cast<uint8_t>(i / 20) : 255;
  for (size_t i = 0; i < chroma.size(); ++i) chroma[i] = i % 11 < 8 ? static_cast<uint8_t>(i / 11) : 255;
  ASSERT_TRUE(pairing.on_meta(first_frame(1)).ok());
  ASSERT_TRUE(pairing.on_atlas(1, {16, 16, luma.data(), chroma.data(), chroma.data(), 20, 11}).ok());
  const Pair* pair = pairs.take();
  ASSERT_NE(pair, nullptr);
  for (size_t i = 0; i < 256; ++i) ASSERT_EQ(pair->atlas.y[i], i / 16);
  for (size_t i = 0; i < 64; ++i) ASSERT_EQ(pair->atlas.v[i], i / 8);
}

}  // namespace
}  // namespace tessera::client
