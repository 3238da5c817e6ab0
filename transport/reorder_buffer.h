// Holds packets that came before one that is still missing, and gives them out in order. Bounded.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "base/time.h"
#include "transport/rtp_packet.h"
#include "transport/sequence.h"

namespace tessera::transport {

// A packet that owns its payload.
struct StoredPacket {
  ExtendedSequence sequence = 0;
  TimeNs arrival_ns = 0;
  RtpHeader header;
  std::vector<uint8_t> payload;
};

class ReorderBuffer {
 public:
  // False: it was here before, or its turn is over.
  bool insert(TimeNs arrival_ns, ExtendedSequence sequence, const RtpPacket& packet) {
    if (released_ && sequence <= *released_) return false;
    const auto [at, is_new] = packets_.try_emplace(sequence);
    if (!is_new) return false;
    at->second = {sequence, arrival_ns, packet.header, {packet.payload.begin(), packet.payload.end()}};
    bytes_ += at->second.payload.size();
    return true;
  }
  // The next packet below `end` (empty: any), in order.
  std::optional<StoredPacket> take_before(std::optional<ExtendedSequence> end) {
    if (packets_.empty() || (end && packets_.begin()->first >= *end)) return std::nullopt;
    StoredPacket packet = std::move(packets_.extract(packets_.begin()).mapped());
    bytes_ -= packet.payload.size();
    released_ = packet.sequence;
    return packet;
  }
  void restart() {
    packets_.clear();
    bytes_ = 0;
    released_.reset();
  }
  size_t packets() const { return packets_.size(); }
  size_t bytes() const { return bytes_; }  // of payload

 private:
  std::map<ExtendedSequence, StoredPacket> packets_;
  std::optional<ExtendedSequence> released_;
  size_t bytes_ = 0;
};

}  // namespace tessera::transport
