// The packets that a peer may still ask for again (RFC 4588), bounded by bytes, by age and by count.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <span>

#include "base/time.h"
#include "transport/rtp_packet.h"
#include "transport/sequence.h"

namespace tessera::transport {

struct HistorySettings {
  size_t max_bytes = 8u << 20;
  DurationNs max_age_ns = 2 * kNsPerSecond;
};

class RetransmissionHistory {
 public:
  static constexpr size_t kMaxPackets = 1 << 15;  // so that a 16-bit number names one packet

  explicit RetransmissionHistory(const HistorySettings& settings) : settings_(settings) {}

  // A packet that was just sent. Sequence numbers come in order, each one above the last. Older packets make
  // room; a packet larger than the whole history is not kept.
  void add(TimeNs now, ExtendedSequence sequence, Datagram packet);

  // The packet, if it is still here and was not sent, or sent again, within the last `min_interval_ns`: a
  // second request for it then only crossed the answer to the first. Counts as sending it.
  std::optional<std::span<const uint8_t>> take(TimeNs now, uint16_t sequence, DurationNs min_interval_ns);

  size_t bytes() const { return bytes_; }
  size_t packets() const { return packets_.size(); }

 private:
  struct Entry {
    ExtendedSequence sequence;
    TimeNs first_sent_ns, last_sent_ns;
    Datagram packet;
  };
  void trim(TimeNs now);

  HistorySettings settings_;
  std::deque<Entry> packets_;
  size_t bytes_ = 0;
};

}  // namespace tessera::transport
