#include "transport/srtp.h"

#include <srtp2/srtp.h>

#include <algorithm>
#include <array>
#include <utility>

#include "transport/datagram.h"

namespace tessera::transport {
namespace {

constexpr unsigned long kReplayWindow = 1024;  // packets; reordering beyond it is loss

Status failed(const char* what, srtp_err_status_t code) {
  if (code == srtp_err_status_auth_fail)
    return absl::UnauthenticatedError(absl::StrCat("SRTP: ", what, ": forged or changed"));
  if (code == srtp_err_status_replay_fail || code == srtp_err_status_replay_old)
    return absl::AlreadyExistsError(absl::StrCat("SRTP: ", what, ": seen before, or too old to tell"));
  return absl::InvalidArgumentError(absl::StrCat("SRTP: ", what, ": libsrtp error ", static_cast<int>(code)));
}

// One direction, for any SSRC.
StatusOr<srtp_t> make_context(SrtpKey key, srtp_ssrc_type_t direction) {
  static const srtp_err_status_t ready = srtp_init();
  if (ready != srtp_err_status_ok) return failed("srtp_init", ready);
  srtp_policy_t policy{};
  srtp_crypto_policy_set_aes_cm_128_hmac_sha1_80(&policy.rtp);
  srtp_crypto_policy_set_aes_cm_128_hmac_sha1_80(&policy.rtcp);
  policy.ssrc.type = direction;
  policy.key = key.data();
  policy.window_size = kReplayWindow;
  srtp_t context = nullptr;
  if (const auto code = srtp_create(&context, &policy); code != srtp_err_status_ok)
    return failed("srtp_create", code);
  return context;
}

}  // namespace

struct Srtp::Impl {
  srtp_t outbound = nullptr, inbound = nullptr;
  ~Impl() {
    if (outbound) srtp_dealloc(outbound);
    if (inbound) srtp_dealloc(inbound);
  }
};

Srtp::Srtp(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Srtp::~Srtp() = default;

StatusOr<std::unique_ptr<Srtp>> Srtp::create(const SrtpKey& own, const SrtpKey& peer) {
  auto impl = std::make_unique<Impl>();
  TESSERA_ASSIGN_OR_RETURN(impl->outbound, make_context(own, ssrc_any_outbound));
  TESSERA_ASSIGN_OR_RETURN(impl->inbound, make_context(peer, ssrc_any_inbound));
  return std::unique_ptr<Srtp>(new Srtp(std::move(impl)));
}

Status Srtp::protect(Datagram& datagram) {
  const bool rtcp = classify(datagram) == DatagramKind::rtcp;
  if (datagram.size() < (rtcp ? 8 : kRtpHeaderBytes))
    return absl::InvalidArgumentError("SRTP: shorter than a header");
  auto length = static_cast<int>(datagram.size());
  datagram.resize(datagram.size() + SRTP_MAX_TRAILER_LEN + 4);
  const auto code = (rtcp ? srtp_protect_rtcp : srtp_protect)(impl_->outbound, datagram.data(), &length);
  if (code != srtp_err_status_ok) return failed("protect", code);
  datagram.resize(static_cast<size_t>(length));
  return absl::OkStatus();
}

StatusOr<Datagram> Srtp::unprotect(std::span<const uint8_t> datagram) {
  const bool rtcp = classify(datagram) == DatagramKind::rtcp;
  Datagram out(datagram.begin(), datagram.end());
  auto length = static_cast<int>(out.size());
  const auto code = (rtcp ? srtp_unprotect_rtcp : srtp_unprotect)(impl_->inbound, out.data(), &length);
  if (code != srtp_err_status_ok) return failed("unprotect", code);
  out.resize(static_cast<size_t>(length));
  return out;
}

}  // namespace tessera::transport
