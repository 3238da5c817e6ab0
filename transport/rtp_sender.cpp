#include "transport/rtp_sender.h"

#include <algorithm>
#include <random>
#include <utility>

#include "transport/h264_packetizer.h"
#include "transport/ntp_time.h"
#include "transport/picture_payload.h"
#include "transport/receiver_statistics.h"
#include "transport/report_timer.h"

namespace tessera::transport {

RtpSenderStats& RtpSenderStats::operator+=(const RtpSenderStats& other) {
  frames += other.frames;
  packets += other.packets;
  bytes += other.bytes;
  retransmitted += other.retransmitted;
  retransmitted_bytes += other.retransmitted_bytes;
  nacked += other.nacked;
  not_retransmitted += other.not_retransmitted;
  key_frame_requests += other.key_frame_requests;
  malformed_rtcp += other.malformed_rtcp;
  return *this;
}
namespace {

// One SSRC's counters for sender reports.
struct Source {
  uint32_t ssrc = 0;
  uint32_t packets = 0, octets = 0;  // modulo 2^32; octets of payload

  void count(size_t datagram_bytes) {
    ++packets;
    octets += static_cast<uint32_t>(datagram_bytes - kRtpHeaderBytes);
  }
};

constexpr DurationNs kMaxRtt = 60 * kNsPerSecond;  // a larger one is nonsense or hostile
constexpr DurationNs kMinRetransmissionInterval = 5 * kNsPerMs;

Status check(const RtpSenderSettings& s) {
  const auto bad = [](const char* what) {
    return absl::InvalidArgumentError(absl::StrCat("RtpSender: ", what));
  };
  if (s.max_datagram_bytes < 64 || s.max_datagram_bytes > 65507)
    return bad("max_datagram_bytes not in 64..65507");
  if (s.payload_type > 127 || s.rtx_payload_type > 127) return bad("payload types are 0..127");
  if (s.payload_type == s.rtx_payload_type)
    return bad("media and retransmissions need different payload types");
  if (!(s.pacer.rate_bps > 0)) return bad("pacer.rate_bps must be above 0");
  if (s.pacer.burst_bytes < s.max_datagram_bytes + Pacer::kIpUdpBytes)
    return bad("pacer.burst_bytes is below one datagram");
  if (s.cname.empty() || s.cname.size() > 255) return bad("cname needs 1..255 bytes");
  if (s.report_interval_ns <= 0) return bad("report_interval_ns must be above 0");
  return absl::OkStatus();
}

}  // namespace

struct RtpSender::Impl {
  explicit Impl(const RtpSenderSettings& s)
      : settings(s), pacer(s.pacer), history(s.history), report_timer(s.report_interval_ns, s.seed) {
    std::mt19937_64 random(s.seed);
    ids = {static_cast<uint32_t>(random()), static_cast<uint32_t>(random()), s.payload_type,
           s.rtx_payload_type};
    if (ids.rtx_ssrc == ids.ssrc) ++ids.rtx_ssrc;
    media.ssrc = ids.ssrc;
    rtx.ssrc = ids.rtx_ssrc;
    next_sequence = ids.first_sequence = static_cast<uint16_t>(random());
    next_rtx_sequence = static_cast<uint16_t>(random());
    timestamp_offset = static_cast<uint32_t>(random());
  }

  uint32_t timestamp(TimeNs t) const { return ticks_from(t, kVideoClockHz) + timestamp_offset; }
  DurationNs rtt_ns() const { return report && report->rtt_ns ? *report->rtt_ns : 0; }

  void retransmit(TimeNs now, const Nack& nack);
  void on_report_block(TimeNs now, const ReportBlock& block);
  void on_key_frame_request(TimeNs now);
  void on_packet(TimeNs now, const RtcpPacket& packet);
  Datagram make_reports(TimeNs now) const;

  RtpSenderSettings settings;
  StreamIds ids;
  Pacer pacer;
  RetransmissionHistory history;
  ReportTimer report_timer;
  Source media, rtx;
  ExtendedSequence next_sequence = 0;
  uint16_t next_rtx_sequence = 0;
  uint32_t timestamp_offset = 0;
  std::optional<TimeNs> key_frame_ns;  // when the last one was queued
  bool key_frame_requested = false, peer_left = false;
  std::optional<PeerReport> report;
  RtpSenderStats stats;
};

RtpSender::RtpSender(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
RtpSender::~RtpSender() = default;

StatusOr<std::unique_ptr<RtpSender>> RtpSender::create(const RtpSenderSettings& settings) {
  TESSERA_RETURN_IF_ERROR(check(settings));
  return std::unique_ptr<RtpSender>(new RtpSender(std::make_unique<Impl>(settings)));
}

const StreamIds& RtpSender::ids() const {
  return impl_->ids;
}

AtlasCodec RtpSender::codec() const {
  return impl_->settings.codec;
}

double RtpSender::frame_budget_bits(DurationNs frame_interval_ns, bool key_frame) const {
  return impl_->pacer.frame_budget_bits(frame_interval_ns, key_frame);
}

void RtpSender::set_rate(double rate_bps) {
  impl_->pacer.set_rate(rate_bps);
}

StatusOr<uint32_t> RtpSender::send_frame(TimeNs now, TimeNs capture_ns, std::span<const uint8_t> access_unit,
                                         bool key_frame) {
  Impl& s = *impl_;
  const size_t max_payload = s.settings.max_datagram_bytes - kRtpHeaderBytes - kRtxHeaderBytes;
  const std::vector<RtpPayload> payloads = s.settings.codec == AtlasCodec::h264
                                               ? packetize_h264(access_unit, max_payload)
                                               : packetize_picture(access_unit, max_payload);
  if (payloads.empty()) return absl::InvalidArgumentError("RtpSender: an access unit without content");

  std::vector<PacedPacket> packets;
  packets.reserve(payloads.size());
  ExtendedSequence sequence = s.next_sequence;
  for (const RtpPayload& payload : payloads) {
    PacedPacket packet{.sequence = sequence++};
    packet.bytes.reserve(kRtpHeaderBytes + payload.size());
    write_rtp_header({payload.last, s.ids.payload_type, static_cast<uint16_t>(packet.sequence),
                      s.timestamp(capture_ns), s.ids.ssrc},
                     packet.bytes);
    packet.bytes.insert(packet.bytes.end(), payload.prefix, payload.prefix + payload.prefix_bytes);
    packet.bytes.insert(packet.bytes.end(), payload.body.begin(), payload.body.end());
    packets.push_back(std::move(packet));
  }
  TESSERA_RETURN_IF_ERROR(s.pacer.enqueue_frame(std::move(packets)));
  s.next_sequence = sequence;
  ++s.stats.frames;
  if (key_frame) {
    s.key_frame_ns = now;
    s.key_frame_requested = false;
  }
  return s.timestamp(capture_ns);
}

void RtpSender::Impl::retransmit(TimeNs now, const Nack& nack) {
  const DurationNs min_interval = std::max(kMinRetransmissionInterval, rtt_ns() / 2);
  for (uint16_t sequence : nack.sequences) {
    ++stats.nacked;
    const auto original = history.take(now, sequence, min_interval);
    bool queued = false;
    if (original) {
      Datagram packet = make_rtx(*original, ids.rtx_payload_type, next_rtx_sequence, ids.rtx_ssrc);
      queued = pacer.enqueue_retransmission({std::move(packet), sequence, true});
    }
    next_rtx_sequence = static_cast<uint16_t>(next_rtx_sequence + (queued ? 1 : 0));
    stats.not_retransmitted += queued ? 0 : 1;
  }
}

void RtpSender::Impl::on_report_block(TimeNs now, const ReportBlock& block) {
  if (block.ssrc != ids.ssrc) return;
  PeerReport r;
  r.received_ns = now;
  r.loss = block.fraction_lost / 256.0;
  r.cumulative_lost = block.cumulative_lost;
  r.jitter_ns = static_cast<DurationNs>(uint64_t{block.jitter} * kNsPerSecond / kVideoClockHz);
  if (report) r.rtt_ns = report->rtt_ns;
  if (block.last_sr != 0) {
    // RFC 3550 6.4.1: A - LSR - DLSR, modulo 2^32; a little below zero is rounding.
    const auto rtt =
        static_cast<int32_t>(middle_32(ntp_from(now)) - block.last_sr - block.delay_since_last_sr);
    const DurationNs rtt_ns = from_compact_ntp(static_cast<uint32_t>(std::max(0, rtt)));
    if (rtt > -65536 && rtt_ns <= kMaxRtt) r.rtt_ns = rtt_ns;
  }
  report = r;
}

// A request that crossed a key frame on its way is answered by it.
void RtpSender::Impl::on_key_frame_request(TimeNs now) {
  ++stats.key_frame_requests;
  const DurationNs quiet = std::max(settings.min_key_frame_interval_ns, rtt_ns());
  if (!key_frame_ns || now - *key_frame_ns >= quiet) key_frame_requested = true;
}

void RtpSender::Impl::on_packet(TimeNs now, const RtcpPacket& packet) {
  if (const auto* rr = std::get_if<ReceiverReport>(&packet)) {
    for (const ReportBlock& block : rr->blocks) on_report_block(now, block);
  } else if (const auto* sr = std::get_if<SenderReport>(&packet)) {
    for (const ReportBlock& block : sr->blocks) on_report_block(now, block);
  } else if (const auto* nack = std::get_if<Nack>(&packet)) {
    if (nack->media_ssrc == ids.ssrc) retransmit(now, *nack);
  } else if (const auto* pli = std::get_if<PictureLoss>(&packet)) {
    if (pli->media_ssrc == ids.ssrc) on_key_frame_request(now);
  } else if (const auto* fir = std::get_if<FullIntraRequest>(&packet)) {
    if (std::ranges::any_of(fir->entries, [&](const auto& e) { return e.ssrc == ids.ssrc; }))
      on_key_frame_request(now);
  } else if (std::holds_alternative<Bye>(packet)) {
    peer_left = true;
  }
}

Status RtpSender::on_rtcp(TimeNs now, std::span<const uint8_t> datagram) {
  const auto packets = parse_rtcp(datagram);
  if (!packets.ok()) {
    ++impl_->stats.malformed_rtcp;
    return packets.status();
  }
  for (const RtcpPacket& packet : *packets) impl_->on_packet(now, packet);
  return absl::OkStatus();
}

// RFC 4588 8.1: both streams are of one participant, which their common CNAME says.
Datagram RtpSender::Impl::make_reports(TimeNs now) const {
  std::vector<RtcpPacket> packets;
  SourceDescription names;
  for (const Source& source : {media, rtx}) {
    if (source.packets == 0 && source.ssrc != ids.ssrc) continue;
    packets.push_back(
        SenderReport{source.ssrc, ntp_from(now), timestamp(now), source.packets, source.octets, {}});
    names.chunks.push_back({source.ssrc, settings.cname});
  }
  packets.push_back(names);
  return build_rtcp(packets);
}

std::vector<Datagram> RtpSender::poll(TimeNs now) {
  Impl& s = *impl_;
  std::vector<Datagram> out;
  if (s.report_timer.due(now)) out.push_back(s.make_reports(now));
  for (PacedPacket& packet : s.pacer.poll(now)) {
    if (packet.retransmission) {
      ++s.stats.retransmitted;
      s.stats.retransmitted_bytes += packet.bytes.size();
      s.rtx.count(packet.bytes.size());
    } else {
      ++s.stats.packets;
      s.stats.bytes += packet.bytes.size();
      s.media.count(packet.bytes.size());
      s.history.add(now, packet.sequence, packet.bytes);
    }
    out.push_back(std::move(packet.bytes));
  }
  return out;
}

TimeNs RtpSender::next_event_ns() const {
  const TimeNs report = impl_->report_timer.next_ns();
  return std::min(report, impl_->pacer.next_event_ns().value_or(report));
}

Datagram RtpSender::make_bye(TimeNs now, std::string reason) const {
  Datagram out = impl_->make_reports(now);
  const RtcpPacket bye = Bye{{impl_->ids.ssrc, impl_->ids.rtx_ssrc}, std::move(reason)};
  const Datagram tail = build_rtcp({&bye, 1});
  out.insert(out.end(), tail.begin(), tail.end());
  return out;
}

bool RtpSender::take_key_frame_request() {
  return std::exchange(impl_->key_frame_requested, false);
}
bool RtpSender::peer_left() const {
  return impl_->peer_left;
}
const std::optional<PeerReport>& RtpSender::peer_report() const {
  return impl_->report;
}
const RtpSenderStats& RtpSender::stats() const {
  return impl_->stats;
}
size_t RtpSender::queued_bytes() const {
  return impl_->pacer.queued_bytes();
}
size_t RtpSender::memory_bytes() const {
  return impl_->pacer.queued_bytes() + impl_->history.bytes();
}

}  // namespace tessera::transport
