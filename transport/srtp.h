// SRTP and SRTCP (RFC 3711, AES128_CM_SHA1_80) around the datagrams of one session, by libsrtp. Keys come
// over TLS, in the welcome message.
#pragma once

#include <memory>
#include <span>

#include "base/status.h"
#include "transport/messages.h"
#include "transport/rtp_packet.h"

namespace tessera::transport {

constexpr size_t kSrtpOverheadBytes = 14;  // at most: SRTCP's index and tag; 10 for SRTP

// Not thread-safe. unprotect() is safe for untrusted input: forged, changed and repeated datagrams are
// errors.
class Srtp {
 public:
  // `own`: of what this end sends; `peer`: of what it receives.
  static StatusOr<std::unique_ptr<Srtp>> create(const SrtpKey& own, const SrtpKey& peer);
  ~Srtp();

  // RTP or RTCP, as classify() tells them apart. The datagram grows by up to kSrtpOverheadBytes.
  Status protect(Datagram& datagram);
  StatusOr<Datagram> unprotect(std::span<const uint8_t> datagram);

 private:
  struct Impl;
  explicit Srtp(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera::transport
