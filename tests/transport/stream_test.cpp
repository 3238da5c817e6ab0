// RtpSender and RtpReceiver over an emulated network, in virtual time.
#include <gtest/gtest.h>

#include <map>
#include <random>

#include "emulated_link.h"
#include "test_streams.h"
#include "transport/rtp_receiver.h"
#include "transport/rtp_sender.h"

namespace tessera::transport {
namespace {

using test::Bytes;
using test::EmulatedLink;
using test::EmulatedLinkSettings;

constexpr DurationNs kInterval = kNsPerSecond / 30;

struct Scenario {
  EmulatedLinkSettings down, up;
  RtpSenderSettings sender;
  RtpReceiverSettings receiver;
  int frames = 300;
  size_t frame_bytes = 60'000, key_frame_bytes = 150'000;
  bool answer_requests = true;  // with key frames
  bool use_budget = false;      // drop frames before they are made
};

// What came out, and both ends for a look at their figures.
struct Outcome {
  std::unique_ptr<RtpSender> sender;
  std::unique_ptr<RtpReceiver> receiver;
  EmulatedLink down, up;
  std::map<uint32_t, Bytes> sent;  // by RTP timestamp
  std::vector<ReceivedFrame> received;
  size_t most_sender_memory = 0, most_receiver_memory = 0;
  int key_frames = 0, dropped_before_encoding = 0;
  DurationNs worst_delay_ns = 0;  // of complete frames, from send_frame() on
};

class Simulation {
 public:
  explicit Simulation(const Scenario& run)
      : run_(run), out_{.down = EmulatedLink(run.down), .up = EmulatedLink(run.up)} {
    out_.sender = *RtpSender::create(run.sender);
    RtpReceiverSettings receiver = run.receiver;
    receiver.ssrc = out_.sender->ids().ssrc;
    receiver.rtx_ssrc = out_.sender->ids().rtx_ssrc;
    receiver.first_sequence = out_.sender->ids().first_sequence;
    out_.receiver = std::make_unique<RtpReceiver>(receiver);
  }

  Outcome run() {
    TimeNs now = kNsPerSecond;
    const TimeNs end = now + run_.frames * kInterval + 2 * kNsPerSecond;
    TimeNs next_frame = now;
    while (now < end) {
      if (now >= next_frame && made_ < run_.frames) {
        make_frame(now);
        next_frame += kInterval;
      }
      step(now);
      TimeNs next = std::min(out_.sender->next_event_ns(), out_.receiver->next_event_ns());
      if (made_ < run_.frames) next = std::min(next, next_frame);
      next = std::min(next, out_.down.next_event_ns().value_or(end));
      next = std::min(next, out_.up.next_event_ns().value_or(end));
      now = std::max(now + 1000, next);
    }
    return std::move(out_);
  }

 private:
  void make_frame(TimeNs now) {
    const bool key = made_ == 0 || (run_.answer_requests && out_.sender->take_key_frame_request());
    ++made_;
    const size_t bytes = key ? run_.key_frame_bytes : run_.frame_bytes;
    if (run_.use_budget &&
        out_.sender->frame_budget_bits(kInterval, key) < 4.0 * static_cast<double>(bytes)) {
      ++out_.dropped_before_encoding;
      return;
    }
    const Bytes unit = test::make_access_unit(key, bytes, random_);
    const auto timestamp = out_.sender->send_frame(now, now, unit, key);
    ASSERT_TRUE(timestamp.ok()) << timestamp.status();
    out_.key_frames += key;
    out_.sent[*timestamp] = unit;
    sent_ns_[*timestamp] = now;
  }

  void step(TimeNs now) {
    for (Datagram& d : out_.up.poll(now)) ASSERT_TRUE(out_.sender->on_rtcp(now, d).ok());
    for (Datagram& d : out_.sender->poll(now)) out_.down.send(now, std::move(d));
    for (Datagram& d : out_.down.poll(now)) {
      const bool rtcp = d.size() > 1 && d[1] >= 192 && d[1] <= 223;
      const Status status = rtcp ? out_.receiver->on_rtcp(now, d) : out_.receiver->on_rtp(now, d);
      ASSERT_TRUE(status.ok()) << status;
    }
    for (Datagram& d : out_.receiver->poll(now)) out_.up.send(now, std::move(d));
    out_.most_sender_memory = std::max(out_.most_sender_memory, out_.sender->memory_bytes());
    out_.most_receiver_memory = std::max(out_.most_receiver_memory, out_.receiver->memory_bytes());
    while (auto frame = out_.receiver->take_frame()) {
      if (frame->complete)
        out_.worst_delay_ns = std::max(out_.worst_delay_ns, now - sent_ns_.at(frame->rtp_timestamp));
      out_.received.push_back(*std::move(frame));
    }
  }

  Scenario run_;
  Outcome out_;
  std::mt19937_64 random_{9};
  std::map<uint32_t, TimeNs> sent_ns_;
  int made_ = 0;
};

// Every frame that is called complete is right; the result is how many are.
size_t complete_frames(const Outcome& out) {
  size_t complete = 0;
  for (const ReceivedFrame& frame : out.received) {
    if (!frame.complete) continue;
    ++complete;
    EXPECT_EQ(frame.access_unit, out.sent.at(frame.rtp_timestamp));
  }
  return complete;
}

TEST(Stream, WithoutLossEveryFrameArrivesAndNothingIsAskedFor) {
  Scenario run;
  run.sender.seed = 5;
  const Outcome out = Simulation(run).run();
  EXPECT_EQ(complete_frames(out), 300u);
  EXPECT_EQ(out.sender->stats().nacked, 0u);
  EXPECT_EQ(out.receiver->stats().key_frame_requests, 0u);
  EXPECT_EQ(out.key_frames, 1);
  ASSERT_TRUE(out.sender->peer_report());
  EXPECT_EQ(out.sender->peer_report()->cumulative_lost, 0);
  ASSERT_TRUE(out.sender->peer_report()->rtt_ns);
  EXPECT_NEAR(to_ms(*out.sender->peer_report()->rtt_ns), 50, 1);
}

// The promise of the design: 5 % loss both ways, with reordering and duplicates, and every frame arrives
// whole.
TEST(Stream, RetransmissionRecoversEverythingAtFivePercentLoss) {
  for (uint64_t seed : {1, 2, 3, 4, 5}) {
    for (DurationNs delay : {5 * kNsPerMs, 50 * kNsPerMs, 150 * kNsPerMs}) {
      Scenario run;
      run.down = {
          .delay_ns = delay, .jitter_ns = 2 * kNsPerMs, .loss = 0.05, .duplication = 0.01, .seed = seed};
      run.up = {.delay_ns = delay,
                .jitter_ns = 2 * kNsPerMs,
                .loss = 0.05,
                .duplication = 0.01,
                .seed = seed + 100};
      run.sender.seed = run.receiver.seed = seed;
      run.receiver.nack.give_up_ns = 3 * kNsPerSecond;
      const Outcome out = Simulation(run).run();
      // A loss shows when something comes after it, so the very last packet has nobody to tell of it.
      EXPECT_GE(complete_frames(out), 299u) << seed;
      EXPECT_EQ(out.receiver->stats().incomplete_frames, 0u) << seed;
      EXPECT_EQ(out.receiver->stats().given_up, 0u) << seed;
      EXPECT_GT(out.down.lost(), 500u);
      EXPECT_EQ(out.key_frames, 1);
      // Few are asked for twice without need.
      EXPECT_LT(out.receiver->stats().nacks, out.down.lost() * 13 / 10 + 50);
      ASSERT_TRUE(out.sender->peer_report());
      EXPECT_NEAR(out.sender->peer_report()->loss, 0.05, 0.05);
    }
  }
}

// Pictures that stand by themselves travel likewise, and a lost one costs no other.
TEST(Stream, PicturePacketsArriveTooAndALostOneCostsNoOther) {
  Scenario run;
  run.sender.codec = run.receiver.codec = AtlasCodec::jpeg;
  run.down = {.delay_ns = 25 * kNsPerMs, .jitter_ns = 2 * kNsPerMs, .loss = 0.05, .seed = 1};
  const Outcome recovered = Simulation(run).run();
  EXPECT_GE(complete_frames(recovered), 299u);
  EXPECT_GT(recovered.down.lost(), 500u);

  run.receiver.nack.max_tries = 0;
  run.down.loss = 0.001;
  const Outcome lost = Simulation(run).run();
  EXPECT_GT(lost.receiver->stats().given_up, 0u);
  EXPECT_GE(complete_frames(lost), 299u - lost.receiver->stats().given_up);
}

TEST(Stream, SequenceNumbersMayWrapManyTimesOver) {
  Scenario run;
  run.frames = 1000;
  run.frame_bytes = 250'000;
  run.key_frame_bytes = 250'000;
  run.sender.pacer.rate_bps = 200e6;
  run.down.loss = 0.01;
  const Outcome out = Simulation(run).run();
  EXPECT_GT(out.sender->stats().packets, 3u << 16);
  EXPECT_EQ(complete_frames(out), 1000u);
}

// Losses beyond the retry budget: the gap is given up, a key frame asked for, and the stream goes on.
TEST(Stream, HeavyLossEndsInAKeyFrameNotInAStandstill) {
  for (uint64_t seed : {1, 2, 3}) {
    Scenario run;
    run.frames = 600;
    run.frame_bytes = 30'000;
    run.down = {.delay_ns = 25 * kNsPerMs, .loss = 0.3, .burst = 20, .seed = seed};
    run.up = {.delay_ns = 25 * kNsPerMs, .loss = 0.3, .seed = seed + 100};
    run.sender.seed = seed;
    run.receiver.nack.max_tries = 3;
    const Outcome out = Simulation(run).run();
    EXPECT_GT(out.receiver->stats().given_up, 0u);
    EXPECT_GT(out.key_frames, 1);
    EXPECT_LE(out.key_frames, 600 * kInterval / (250 * kNsPerMs) + 1);  // throttled
    EXPECT_GT(complete_frames(out), 200u);
    ASSERT_FALSE(out.received.empty());
    // The newest frames are among them.
    EXPECT_GT(out.received.back().rtp_timestamp - out.received.front().rtp_timestamp, 580u * 3000);
  }
}

TEST(Stream, EveryLossIsUnrecoverableWithoutTheBackChannel) {
  Scenario run;
  run.down.loss = 0.02;
  run.up.loss = 0.999999;
  const Outcome out = Simulation(run).run();
  EXPECT_GT(out.receiver->stats().given_up, 0u);
  EXPECT_TRUE(out.receiver->wants_key_frame());
  EXPECT_LT(complete_frames(out), 300u);
}

// RELIABILITY R4: a link at half load with a small queue loses nothing, because frames are paced.
TEST(Stream, PacedFramesDoNotOverflowASwitch) {
  Scenario run;
  run.frame_bytes = 40'000;  // 9.6 Mbit/s
  run.down = {.delay_ns = 10 * kNsPerMs, .rate_bps = 20e6, .queue_bytes = 8000};
  run.sender.pacer.rate_bps = 18e6;
  Outcome out = Simulation(run).run();
  EXPECT_EQ(out.down.overflowed(), 0u);
  EXPECT_EQ(complete_frames(out), 300u);
  // The same load unpaced shows that the switch does overflow.
  run.sender.pacer.rate_bps = 10e9;
  run.sender.pacer.burst_bytes = 1 << 20;
  EXPECT_GT(Simulation(run).run().down.overflowed(), 100u);
}

// A sender that makes more than its rate drops frames before it encodes them; delay stays bounded.
TEST(Stream, FramesAreDroppedBeforeTheEncoderNeverTails) {
  Scenario run;
  run.use_budget = true;
  run.frame_bytes = 80'000;  // 19 Mbit/s for 10
  run.key_frame_bytes = 160'000;
  run.sender.pacer.rate_bps = 10e6;
  const Outcome out = Simulation(run).run();
  EXPECT_GT(out.dropped_before_encoding, 100);
  EXPECT_EQ(complete_frames(out), out.sent.size());
  EXPECT_EQ(out.received.size(), out.sent.size());
  EXPECT_LT(out.worst_delay_ns, 25 * kNsPerMs + 5 * kInterval);
}

TEST(Stream, MemoryStaysBounded) {
  Scenario run;
  run.frames = 600;
  run.down = {.delay_ns = 100 * kNsPerMs, .loss = 0.2, .burst = 10};
  run.up.loss = 0.9;
  run.sender.history = {.max_bytes = 1 << 20};
  run.sender.pacer.max_queued_bytes = 1 << 20;
  run.receiver.max_buffered_bytes = 500'000;
  run.receiver.nack.give_up_ns = 100 * kNsPerSecond;  // so that the bound decides
  run.receiver.nack.max_tries = 1000;
  const Outcome out = Simulation(run).run();
  EXPECT_LE(out.most_sender_memory, 2u << 20);
  EXPECT_LE(out.most_receiver_memory, 500'000u + 2 * run.key_frame_bytes);
  EXPECT_GT(out.most_receiver_memory, 300'000u);
}

TEST(Stream, TheSameSeedGivesTheSameDatagrams) {
  std::mt19937_64 random(1);
  const Bytes unit = test::make_access_unit(true, 5000, random);
  const auto datagrams = [&](uint64_t seed) {
    auto sender = *RtpSender::create({.seed = seed, .pacer = {.rate_bps = 1e9, .burst_bytes = 1 << 20}});
    EXPECT_TRUE(sender->send_frame(0, 0, unit, true).ok());
    return sender->poll(0);
  };
  EXPECT_EQ(datagrams(3), datagrams(3));
  EXPECT_NE(datagrams(3), datagrams(4));
}

TEST(RtpSender, RefusesSettingsOutsideTheirRange) {
  using Change = void (*)(RtpSenderSettings&);
  for (Change change : std::initializer_list<Change>{
           [](auto& s) { s.max_datagram_bytes = 63; }, [](auto& s) { s.max_datagram_bytes = 65'508; },
           [](auto& s) { s.payload_type = 128; }, [](auto& s) { s.rtx_payload_type = s.payload_type; },
           [](auto& s) { s.pacer.rate_bps = 0; }, [](auto& s) { s.pacer.burst_bytes = 1200; },
           [](auto& s) { s.cname = ""; }, [](auto& s) { s.cname = std::string(256, 'x'); },
           [](auto& s) { s.report_interval_ns = 0; }}) {
    RtpSenderSettings settings;
    change(settings);
    EXPECT_EQ(RtpSender::create(settings).status().code(), absl::StatusCode::kInvalidArgument);
  }
}

TEST(RtpSender, AnswersRequestsForKeyFramesOnceAndNotWhenOneIsUnderWay) {
  auto sender = *RtpSender::create({});
  const uint32_t ssrc = sender->ids().ssrc;
  const auto request = [&](TimeNs now, const RtcpPacket& packet) {
    ASSERT_TRUE(sender->on_rtcp(now, build_rtcp({&packet, 1})).ok());
  };
  request(0, PictureLoss{1, ssrc + 1});
  EXPECT_FALSE(sender->take_key_frame_request());  // another stream
  request(0, PictureLoss{1, ssrc});
  request(0, PictureLoss{1, ssrc});
  EXPECT_TRUE(sender->take_key_frame_request());
  EXPECT_FALSE(sender->take_key_frame_request());
  std::mt19937_64 random(1);
  ASSERT_TRUE(sender->send_frame(0, 0, test::make_access_unit(true, 100, random), true).ok());
  request(249 * kNsPerMs, FullIntraRequest{1, {{ssrc, 1}}});
  EXPECT_FALSE(sender->take_key_frame_request());
  request(250 * kNsPerMs, FullIntraRequest{1, {{ssrc, 1}}});
  EXPECT_TRUE(sender->take_key_frame_request());
}

TEST(RtpSender, HostileReportsDoNotBreakTheRoundTrip) {
  auto sender = *RtpSender::create({});
  for (uint32_t last_sr : {1u, 0x7fffffffu, 0xffffffffu}) {
    const RtcpPacket report =
        ReceiverReport{1, {{sender->ids().ssrc, 255, -1, 0, 0xffffffff, last_sr, 0xfffffff0}}};
    ASSERT_TRUE(sender->on_rtcp(kNsPerSecond, build_rtcp({&report, 1})).ok());
    EXPECT_LE(sender->peer_report()->rtt_ns.value_or(0), 60 * kNsPerSecond);
  }
  EXPECT_FALSE(sender->on_rtcp(0, Bytes{1, 2, 3}).ok());
  EXPECT_EQ(sender->stats().malformed_rtcp, 1u);
}

TEST(RtpReceiver, AByeEndsTheStreamAtBothEnds) {
  auto sender = *RtpSender::create({});
  RtpReceiver receiver({.ssrc = sender->ids().ssrc});
  ASSERT_TRUE(receiver.on_rtcp(0, sender->make_bye(0, "server stops")).ok());
  EXPECT_TRUE(receiver.sender_left());
  ASSERT_TRUE(sender->on_rtcp(0, receiver.make_bye(0, "client stops")).ok());
  EXPECT_TRUE(sender->peer_left());
}

TEST(RtpReceiver, RejectsOtherStreams) {
  RtpReceiver receiver({.ssrc = 7, .rtx_ssrc = 8});
  const auto packet = [](uint8_t type, uint32_t ssrc) {
    Datagram d;
    write_rtp_header({true, type, 1, 2, ssrc}, d);
    d.insert(d.end(), {0x67, 1, 2});
    return d;
  };
  EXPECT_FALSE(receiver.on_rtp(0, packet(96, 8)).ok());
  EXPECT_FALSE(receiver.on_rtp(0, packet(98, 7)).ok());
  EXPECT_FALSE(receiver.on_rtp(0, packet(97, 8)).ok());  // a retransmission before any packet
  EXPECT_TRUE(receiver.on_rtp(0, packet(96, 7)).ok());
  EXPECT_EQ(receiver.stats().rejected, 3u);
}

}  // namespace
}  // namespace tessera::transport
