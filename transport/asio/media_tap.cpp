#include "transport/asio/media_tap.h"

#include <utility>

#include "transport/datagram.h"
#include "transport/rtp_packet.h"

namespace tessera::transport {

StatusOr<std::unique_ptr<MediaTap>> MediaTap::create(const PeerAddress& to, const StreamIds& stream,
                                                     const std::optional<SrtpKey>& srtp) {
  std::unique_ptr<Srtp> protection;
  if (srtp) {
    TESSERA_ASSIGN_OR_RETURN(protection, Srtp::create(*srtp, *srtp));
  }
  return std::unique_ptr<MediaTap>(new MediaTap(to, stream, std::move(protection)));
}

void MediaTap::send(UdpSocket& socket, const Datagram& datagram) {
  const DatagramKind kind = classify(datagram);
  if (kind == DatagramKind::rtp) {
    const auto packet = parse_rtp(datagram);
    if (!packet.ok() || packet->header.payload_type != stream_.payload_type) return;  // a retransmission
    ++packets_;
  }
  Datagram copy = datagram;
  if (srtp_ && !srtp_->protect(copy).ok()) return;  // never in clear text
  socket.send(to_, std::move(copy));
}

}  // namespace tessera::transport
