#include "transport/rtp_receiver.h"

#include <algorithm>
#include <deque>
#include <random>
#include <utility>

#include "transport/receiver_statistics.h"
#include "transport/reorder_buffer.h"
#include "transport/report_timer.h"
#include "transport/rtcp_packet.h"

namespace tessera::transport {
namespace {

constexpr size_t kMaxNacksADatagram = 256;  // at most 1 KiB of them

}  // namespace

struct RtpReceiver::Impl {
  explicit Impl(const RtpReceiverSettings& s)
      : settings(s),
        own_ssrc(static_cast<uint32_t>(std::mt19937_64(s.seed)())),
        nack(s.nack),
        depacketizer(Depacketizer::create(s.codec, s.max_frame_bytes)),
        report_timer(s.report_interval_ns, s.seed) {
    if (s.ssrc) media.emplace(*s.ssrc);
    if (s.rtx_ssrc) rtx.emplace(*s.rtx_ssrc);
  }

  struct Source {
    explicit Source(uint32_t s) : ssrc(s), statistics(s) {}
    uint32_t ssrc;
    ReceiverStatistics statistics;
  };

  static bool is_of(std::optional<Source>& source, uint32_t ssrc);
  Status reject(std::string why);
  Status on_media(TimeNs now, const RtpPacket& packet);
  Status on_retransmission(TimeNs now, const RtpPacket& packet);
  void begin_stream(uint16_t sequence);
  void restart_stream();
  void insert(TimeNs now, ExtendedSequence sequence, const RtpPacket& packet);
  void release();
  void add_frame(ReceivedFrame frame);
  void append_nacks(TimeNs now, std::vector<RtcpPacket>& out);
  void append_key_frame_request(TimeNs now, std::vector<RtcpPacket>& out);
  std::vector<RtcpPacket> begin_compound() const;
  std::vector<RtcpPacket> make_report(TimeNs now);
  DurationNs key_frame_retry_ns() const { return std::max(settings.key_frame_retry_ns, 2 * nack.rtt_ns()); }

  RtpReceiverSettings settings;
  uint32_t own_ssrc;
  std::optional<Source> media, rtx;
  SequenceUnwrapper unwrapper;
  NackGenerator nack;
  ReorderBuffer buffer;
  std::unique_ptr<Depacketizer> depacketizer;
  ReportTimer report_timer;
  std::deque<ReceivedFrame> frames;
  size_t frame_bytes = 0;
  bool wants_key_frame = false, sender_left = false;
  std::optional<TimeNs> key_frame_asked_ns;
  RtpReceiverStats stats;
};

RtpReceiver::RtpReceiver(const RtpReceiverSettings& settings) : impl_(std::make_unique<Impl>(settings)) {}
RtpReceiver::~RtpReceiver() = default;

bool RtpReceiver::Impl::is_of(std::optional<Source>& source, uint32_t ssrc) {
  if (!source) source.emplace(ssrc);
  return source->ssrc == ssrc;
}

Status RtpReceiver::Impl::reject(std::string why) {
  ++stats.rejected;
  return absl::InvalidArgumentError(std::move(why));
}

Status RtpReceiver::on_rtp(TimeNs now, std::span<const uint8_t> datagram) {
  Impl& r = *impl_;
  const StatusOr<RtpPacket> packet = parse_rtp(datagram);
  if (!packet.ok()) return r.reject(std::string(packet.status().message()));
  const uint8_t type = packet->header.payload_type;
  const bool is_rtx = type == r.settings.rtx_payload_type;
  if (!is_rtx && type != r.settings.payload_type) return r.reject(absl::StrCat("RTP: payload type ", type));
  if (!Impl::is_of(is_rtx ? r.rtx : r.media, packet->header.ssrc))
    return r.reject(absl::StrCat("RTP: SSRC ", packet->header.ssrc));
  TESSERA_RETURN_IF_ERROR(is_rtx ? r.on_retransmission(now, *packet) : r.on_media(now, *packet));
  ++r.stats.packets;
  r.stats.bytes += datagram.size();
  return absl::OkStatus();
}

Status RtpReceiver::Impl::on_media(TimeNs now, const RtpPacket& packet) {
  using Verdict = ReceiverStatistics::Verdict;
  const Verdict verdict = media->statistics.on_packet(now, packet.header.sequence, packet.header.timestamp);
  if (verdict == Verdict::ignore)
    return reject(absl::StrCat("RTP: sequence ", packet.header.sequence, " is far off"));
  if (verdict == Verdict::restarted) restart_stream();
  if (!unwrapper.highest()) begin_stream(packet.header.sequence);
  insert(now, unwrapper.unwrap(packet.header.sequence), packet);
  return absl::OkStatus();
}

Status RtpReceiver::Impl::on_retransmission(TimeNs now, const RtpPacket& packet) {
  if (packet.payload.empty()) return absl::OkStatus();  // padding only: a probe
  if (!media) return reject("RTX: before any packet of its stream");
  const StatusOr<RtpPacket> original = unwrap_rtx(packet, settings.payload_type, media->ssrc);
  if (!original.ok()) return reject(std::string(original.status().message()));
  rtx->statistics.on_packet(now, packet.header.sequence, packet.header.timestamp);
  // Only what came before can be asked for, so a retransmission never moves the stream on.
  const ExtendedSequence sequence = unwrapper.peek(original->header.sequence);
  if (!unwrapper.highest() || sequence > *unwrapper.highest()) return reject("RTX: of a packet not yet sent");
  const uint64_t duplicates = stats.duplicates;
  insert(now, sequence, *original);
  if (stats.duplicates == duplicates) ++stats.recovered;
  return absl::OkStatus();
}

void RtpReceiver::Impl::begin_stream(uint16_t sequence) {
  if (!settings.first_sequence) return;
  const uint16_t first = *std::exchange(settings.first_sequence, std::nullopt);  // a restart begins elsewhere
  if (static_cast<uint16_t>(sequence - first) > settings.nack.max_missing) return;
  const ExtendedSequence begin = unwrapper.unwrap(first);
  nack.begin(begin);
  depacketizer->begin(begin);
}

void RtpReceiver::Impl::restart_stream() {
  unwrapper = {};
  nack.restart();
  buffer.restart();
  depacketizer = Depacketizer::create(settings.codec, settings.max_frame_bytes);
  wants_key_frame = true;
}

void RtpReceiver::Impl::insert(TimeNs now, ExtendedSequence sequence, const RtpPacket& packet) {
  if (!buffer.insert(now, sequence, packet)) {
    ++stats.duplicates;
    return;
  }
  nack.on_packet(now, sequence);
  while (nack.missing() > 0 &&
         (buffer.packets() > settings.max_buffered_packets || buffer.bytes() > settings.max_buffered_bytes)) {
    nack.give_up_oldest();
    release();
  }
  release();
}

void RtpReceiver::Impl::release() {
  // First, so that a key frame behind the loss settles it.
  if (nack.given_up() != stats.given_up) wants_key_frame = true;
  stats.given_up = nack.given_up();
  std::vector<ReceivedFrame> done;
  while (auto stored = buffer.take_before(nack.oldest_missing()))
    depacketizer->push(stored->arrival_ns, stored->sequence, {stored->header, stored->payload}, done);
  for (ReceivedFrame& frame : done) add_frame(std::move(frame));
}

void RtpReceiver::Impl::add_frame(ReceivedFrame frame) {
  ++stats.frames;
  if (!frame.complete) ++stats.incomplete_frames;
  if (frame.complete && frame.key_frame) {
    wants_key_frame = false;
    key_frame_asked_ns.reset();
  } else if (!frame.complete || frame.follows_gap) {
    wants_key_frame = true;
  }
  frame_bytes += frame.access_unit.size();
  frames.push_back(std::move(frame));
  while (frames.size() > settings.max_frames || frame_bytes > settings.max_queued_frame_bytes) {
    frame_bytes -= frames.front().access_unit.size();
    frames.pop_front();
    ++stats.dropped_frames;
    wants_key_frame = true;
  }
}

Status RtpReceiver::on_rtcp(TimeNs now, std::span<const uint8_t> datagram) {
  Impl& r = *impl_;
  const auto packets = parse_rtcp(datagram);
  if (!packets.ok()) return r.reject(std::string(packets.status().message()));
  for (const RtcpPacket& packet : *packets) {
    if (const auto* report = std::get_if<SenderReport>(&packet)) {
      for (auto* source : {&r.media, &r.rtx}) {
        if (*source && (*source)->ssrc == report->ssrc) (*source)->statistics.on_sender_report(now, *report);
      }
    } else if (const auto* bye = std::get_if<Bye>(&packet)) {
      if (r.media && std::ranges::count(bye->ssrcs, r.media->ssrc) > 0) r.sender_left = true;
    }
  }
  return absl::OkStatus();
}

// RFC 4585 3.1: feedback travels in a compound that begins with a report and the CNAME. The report of early
// feedback is empty, so that the interval of fraction_lost stays that of the regular ones.
std::vector<RtcpPacket> RtpReceiver::Impl::begin_compound() const {
  return {ReceiverReport{own_ssrc, {}}, SourceDescription{{{own_ssrc, settings.cname}}}};
}

std::vector<RtcpPacket> RtpReceiver::Impl::make_report(TimeNs now) {
  std::vector<RtcpPacket> compound = begin_compound();
  auto& report = std::get<ReceiverReport>(compound.front());
  for (auto* source : {&media, &rtx}) {
    if (!*source) continue;
    if (const auto block = (*source)->statistics.make_report(now)) report.blocks.push_back(*block);
  }
  return compound;
}

void RtpReceiver::Impl::append_nacks(TimeNs now, std::vector<RtcpPacket>& out) {
  const std::vector<ExtendedSequence> missing = nack.poll(now);
  release();  // the generator may have given up
  if (!media) return;
  for (size_t at = 0; at < missing.size(); at += kMaxNacksADatagram) {
    Nack message{own_ssrc, media->ssrc, {}};
    for (size_t i = at; i < std::min(missing.size(), at + kMaxNacksADatagram); ++i)
      message.sequences.push_back(static_cast<uint16_t>(missing[i]));
    out.push_back(std::move(message));
  }
  stats.nacks += missing.size();
}

void RtpReceiver::Impl::append_key_frame_request(TimeNs now, std::vector<RtcpPacket>& out) {
  if (!wants_key_frame || !media) return;
  if (key_frame_asked_ns && now < *key_frame_asked_ns + key_frame_retry_ns()) return;
  key_frame_asked_ns = now;
  ++stats.key_frame_requests;
  out.push_back(PictureLoss{own_ssrc, media->ssrc});
}

std::vector<Datagram> RtpReceiver::poll(TimeNs now) {
  Impl& r = *impl_;
  std::vector<RtcpPacket> feedback;
  r.append_nacks(now, feedback);
  r.append_key_frame_request(now, feedback);
  std::vector<Datagram> out;
  if (r.report_timer.due(now)) out.push_back(build_rtcp(r.make_report(now)));
  for (RtcpPacket& message : feedback) {
    std::vector<RtcpPacket> compound = r.begin_compound();
    compound.push_back(std::move(message));
    out.push_back(build_rtcp(compound));
  }
  return out;
}

TimeNs RtpReceiver::next_event_ns() const {
  const Impl& r = *impl_;
  TimeNs next = r.report_timer.next_ns();
  if (const auto nack = r.nack.next_event_ns()) next = std::min(next, *nack);
  if (r.wants_key_frame && r.media)
    next = std::min(next, r.key_frame_asked_ns ? *r.key_frame_asked_ns + r.key_frame_retry_ns() : 0);
  return next;
}

Datagram RtpReceiver::make_bye(TimeNs now, std::string reason) const {
  std::vector<RtcpPacket> packets = impl_->make_report(now);
  packets.push_back(Bye{{impl_->own_ssrc}, std::move(reason)});
  return build_rtcp(packets);
}

std::optional<ReceivedFrame> RtpReceiver::take_frame() {
  Impl& r = *impl_;
  if (r.frames.empty()) return std::nullopt;
  ReceivedFrame frame = std::move(r.frames.front());
  r.frames.pop_front();
  r.frame_bytes -= frame.access_unit.size();
  return frame;
}

void RtpReceiver::request_key_frame() {
  impl_->wants_key_frame = true;
}
bool RtpReceiver::wants_key_frame() const {
  return impl_->wants_key_frame;
}
bool RtpReceiver::sender_left() const {
  return impl_->sender_left;
}
void RtpReceiver::set_rtt(DurationNs rtt_ns) {
  impl_->nack.set_rtt(rtt_ns);
}
DurationNs RtpReceiver::rtt_ns() const {
  return impl_->nack.rtt_ns();
}
uint32_t RtpReceiver::jitter() const {
  return impl_->media ? impl_->media->statistics.jitter() : 0;
}
RtpReceiverStats RtpReceiver::stats() const {
  return impl_->stats;
}
size_t RtpReceiver::memory_bytes() const {
  return impl_->buffer.bytes() + impl_->frame_bytes;
}

}  // namespace tessera::transport
