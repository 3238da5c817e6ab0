// Any bytes as RTCP. What parses and is built again must parse to the same; both ends of a stream bear it.
#include <cstdlib>

#include "transport/rtp_receiver.h"
#include "transport/rtp_sender.h"

using namespace tessera;
using namespace tessera::transport;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::span<const uint8_t> bytes(data, size);
  static const std::unique_ptr<RtpSender> sender = *RtpSender::create({});
  static RtpReceiver receiver({});
  (void)sender->on_rtcp(kNsPerSecond, bytes);
  (void)receiver.on_rtcp(kNsPerSecond, bytes);

  auto packets = parse_rtcp(bytes);
  if (!packets.ok()) return 0;
  std::erase_if(*packets, [](const RtcpPacket& p) { return std::holds_alternative<UnknownRtcp>(p); });
  // A NACK may name packets twice or in any order; its second writing is the canonical one.
  const Datagram built = build_rtcp(*packets);
  if (packets->empty()) return built.empty() ? 0 : (std::abort(), 0);
  const auto again = parse_rtcp(built);
  if (!again.ok() || again->size() != packets->size()) std::abort();
  if (build_rtcp(*again) != built) std::abort();
  return 0;
}
