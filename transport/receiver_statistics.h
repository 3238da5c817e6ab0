// What a receiver reports about one source: loss and jitter (RFC 3550 appendices A.1, A.3, A.8).
#pragma once

#include <cstdint>
#include <optional>

#include "base/time.h"
#include "transport/rtcp_packet.h"
#include "transport/sequence.h"

namespace tessera::transport {

constexpr uint32_t kVideoClockHz = 90'000;

class ReceiverStatistics {
 public:
  // Jumps beyond these are not believed until the next packet confirms them (A.1).
  static constexpr int kMaxDropout = 3000, kMaxMisorder = 100;

  explicit ReceiverStatistics(uint32_t ssrc, uint32_t clock_hz = kVideoClockHz)
      : ssrc_(ssrc), clock_hz_(clock_hz) {}

  enum class Verdict : uint8_t {
    valid,
    ignore,     // far from the stream; perhaps a stray
    restarted,  // the source began again elsewhere: statistics start anew with this packet
  };
  Verdict on_packet(TimeNs now, uint16_t sequence, uint32_t rtp_timestamp);
  void on_sender_report(TimeNs now, const SenderReport& report);

  // Starts the next interval of fraction_lost. Empty before the first packet.
  std::optional<ReportBlock> make_report(TimeNs now);

  uint64_t received() const { return received_; }
  int64_t lost() const;                                // of all since the start; negative with duplicates
  uint32_t jitter() const { return jitter_16_ >> 4; }  // in timestamp units

 private:
  void restart(uint16_t sequence);
  void update_jitter(TimeNs now, uint32_t rtp_timestamp);
  int64_t expected() const;

  uint32_t ssrc_, clock_hz_;
  bool started_ = false;
  uint16_t base_ = 0, highest_ = 0;
  uint32_t cycles_ = 0;                 // wrap-arounds, in the upper 16 bits
  std::optional<uint16_t> suspicious_;  // the sequence that would confirm a restart
  uint64_t received_ = 0, received_before_ = 0;
  int64_t expected_before_ = 0;
  std::optional<uint32_t> transit_;
  uint32_t jitter_16_ = 0;  // times 16
  uint32_t last_sr_ = 0;
  TimeNs last_sr_ns_ = 0;
};

}  // namespace tessera::transport
