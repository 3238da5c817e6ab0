#include "transport/receiver_statistics.h"

#include <algorithm>
#include <limits>

#include "transport/ntp_time.h"

namespace tessera::transport {

void ReceiverStatistics::restart(uint16_t sequence) {
  base_ = highest_ = sequence;
  cycles_ = 0;
  received_ = received_before_ = 0;
  expected_before_ = 0;
  suspicious_.reset();
  transit_.reset();
  started_ = true;
}

// A.1 without probation: the source is already known by its address and SSRC.
ReceiverStatistics::Verdict ReceiverStatistics::on_packet(TimeNs now, uint16_t sequence,
                                                          uint32_t rtp_timestamp) {
  Verdict verdict = Verdict::valid;
  if (!started_) restart(sequence);
  const auto ahead = static_cast<uint16_t>(sequence - highest_);
  if (ahead < kMaxDropout) {
    if (sequence < highest_) cycles_ += 1u << 16;
    highest_ = sequence;
  } else if (ahead <= 0x10000 - kMaxMisorder) {
    if (suspicious_ != sequence) {
      suspicious_ = static_cast<uint16_t>(sequence + 1);
      return Verdict::ignore;
    }
    restart(sequence);
    verdict = Verdict::restarted;
  }
  ++received_;
  update_jitter(now, rtp_timestamp);
  return verdict;
}

// A.8, integer form.
void ReceiverStatistics::update_jitter(TimeNs now, uint32_t rtp_timestamp) {
  const uint32_t transit = ticks_from(now, clock_hz_) - rtp_timestamp;
  if (transit_) {
    const auto signed_change = static_cast<int32_t>(transit - *transit_);
    const uint32_t change =
        signed_change < 0 ? 0u - static_cast<uint32_t>(signed_change) : static_cast<uint32_t>(signed_change);
    jitter_16_ += change - ((jitter_16_ + 8) >> 4);
  }
  transit_ = transit;
}

void ReceiverStatistics::on_sender_report(TimeNs now, const SenderReport& report) {
  last_sr_ = middle_32(report.ntp);
  last_sr_ns_ = now;
}

int64_t ReceiverStatistics::expected() const {
  return started_ ? int64_t{cycles_} + highest_ - base_ + 1 : 0;
}

int64_t ReceiverStatistics::lost() const {
  return expected() - static_cast<int64_t>(received_);
}

// A.3
std::optional<ReportBlock> ReceiverStatistics::make_report(TimeNs now) {
  if (!started_) return std::nullopt;
  const int64_t expected_now = expected() - expected_before_;
  const int64_t received_now = static_cast<int64_t>(received_ - received_before_);
  const int64_t lost_now = expected_now - received_now;
  expected_before_ = expected();
  received_before_ = received_;

  ReportBlock block;
  block.ssrc = ssrc_;
  if (expected_now > 0 && lost_now > 0)
    block.fraction_lost = static_cast<uint8_t>(std::min<int64_t>(255, lost_now * 256 / expected_now));
  block.cumulative_lost = static_cast<int32_t>(std::clamp<int64_t>(lost(), -0x800000, 0x7fffff));
  block.highest_sequence = cycles_ + highest_;
  block.jitter = jitter();
  block.last_sr = last_sr_;
  if (last_sr_ != 0) block.delay_since_last_sr = compact_ntp(now - last_sr_ns_);
  return block;
}

}  // namespace tessera::transport
