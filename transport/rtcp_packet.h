// RTCP (RFC 3550 section 6) with the feedback messages of RFC 4585 (NACK, PLI) and RFC 5104 (FIR). Parsing is
// safe for untrusted input: memory stays within a small multiple of the datagram.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "base/status.h"
#include "transport/rtp_packet.h"

namespace tessera::transport {

struct ReportBlock {                 // RFC 3550 6.4.1
  uint32_t ssrc = 0;                 // the reported source
  uint8_t fraction_lost = 0;         // since the last report, in 1/256
  int32_t cumulative_lost = 0;       // 24 bits; negative with duplicates
  uint32_t highest_sequence = 0;     // extended by the count of wrap-arounds
  uint32_t jitter = 0;               // in timestamp units
  uint32_t last_sr = 0;              // middle 32 bits of the last SR's NTP time; 0: none yet
  uint32_t delay_since_last_sr = 0;  // in 1/65536 s
  bool operator==(const ReportBlock&) const = default;
};

struct SenderReport {
  uint32_t ssrc = 0;
  uint64_t ntp = 0;            // 32.32 seconds; see ntp_from()
  uint32_t rtp_timestamp = 0;  // of the same instant
  uint32_t packets = 0, octets = 0;
  std::vector<ReportBlock> blocks;  // at most 31
  bool operator==(const SenderReport&) const = default;
};

struct ReceiverReport {
  uint32_t ssrc = 0;
  std::vector<ReportBlock> blocks;  // at most 31
  bool operator==(const ReceiverReport&) const = default;
};

struct SourceDescription {  // only the CNAME item is kept
  struct Chunk {
    uint32_t ssrc = 0;
    std::string cname;  // at most 255 bytes
    bool operator==(const Chunk&) const = default;
  };
  std::vector<Chunk> chunks;  // at most 31
  bool operator==(const SourceDescription&) const = default;
};

struct Bye {
  std::vector<uint32_t> ssrcs;  // at most 31
  std::string reason;           // at most 255 bytes
  bool operator==(const Bye&) const = default;
};

struct Nack {  // generic NACK, RFC 4585 6.2.1
  uint32_t sender_ssrc = 0, media_ssrc = 0;
  std::vector<uint16_t> sequences;  // lost packets, in the order of the message; written in ascending order
  bool operator==(const Nack&) const = default;
};

struct PictureLoss {  // PLI, RFC 4585 6.3.1
  uint32_t sender_ssrc = 0, media_ssrc = 0;
  bool operator==(const PictureLoss&) const = default;
};

struct FullIntraRequest {  // FIR, RFC 5104 4.3.1
  struct Entry {
    uint32_t ssrc = 0;
    uint8_t sequence = 0;  // of the command; a repetition keeps it
    bool operator==(const Entry&) const = default;
  };
  uint32_t sender_ssrc = 0;
  std::vector<Entry> entries;
  bool operator==(const FullIntraRequest&) const = default;
};

struct UnknownRtcp {  // any other type; a receiver ignores it
  uint8_t type = 0, count = 0;
  bool operator==(const UnknownRtcp&) const = default;
};

using RtcpPacket = std::variant<SenderReport, ReceiverReport, SourceDescription, Bye, Nack, PictureLoss,
                                FullIntraRequest, UnknownRtcp>;

// A whole datagram. A compound may begin with any type (reduced size, RFC 5506). InvalidArgument, and nothing
// of the datagram counts: a wrong version, a length that does not fit, padding before the last packet.
StatusOr<std::vector<RtcpPacket>> parse_rtcp(std::span<const uint8_t> datagram);

// Writes the packets in order. Lists beyond their maximum are cut; UnknownRtcp is left out.
Datagram build_rtcp(std::span<const RtcpPacket> packets);

}  // namespace tessera::transport
