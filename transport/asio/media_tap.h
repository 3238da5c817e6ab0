// A second receiver of a session's video: a player that speaks RTP but knows nothing of sessions. It gets
// each packet once, and the sender reports; it is not listened to.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "base/status.h"
#include "transport/asio/udp_socket.h"
#include "transport/rtp_sender.h"
#include "transport/srtp.h"

namespace tessera::transport {

using TapId = uint64_t;

// Not thread-safe.
class MediaTap {
 public:
  // `srtp`: another key than the session's; empty: clear text.
  static StatusOr<std::unique_ptr<MediaTap>> create(const PeerAddress& to, const StreamIds& stream,
                                                    const std::optional<SrtpKey>& srtp);
  void send(UdpSocket& socket, const Datagram& datagram);
  uint64_t packets() const { return packets_; }

 private:
  MediaTap(const PeerAddress& to, const StreamIds& stream, std::unique_ptr<Srtp> srtp)
      : to_(to), stream_(stream), srtp_(std::move(srtp)) {}

  PeerAddress to_;
  StreamIds stream_;
  std::unique_ptr<Srtp> srtp_;
  uint64_t packets_ = 0;  // of video
};

}  // namespace tessera::transport
