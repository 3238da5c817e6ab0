// The server's media port: one UDP socket for all sessions. Carries datagrams and time to each session's
// RtpSender.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "base/status.h"
#include "base/time.h"
#include "transport/asio/asio.h"
#include "transport/asio/media_tap.h"
#include "transport/asio/udp_socket.h"
#include "transport/rtp_sender.h"
#include "transport/session_binding.h"
#include "transport/srtp.h"

namespace tessera::transport {

// Called on the port's executor, never while it holds a lock: they may call the port.
struct MediaSessionEvents {
  std::function<void()> on_bound;                     // the client's address is known, or new
  std::function<void(const SequencedPose&)> on_pose;  // newer than all before
  std::function<void()> on_key_frame_request;         // once a request, throttled
  std::function<void()> on_left;                      // the client said BYE
};

// Thread-safe. Close it before its last owner lets go.
class MediaPort : public std::enable_shared_from_this<MediaPort> {
 public:
  // `clock` outlives the port. Failures: see bind_error().
  static StatusOr<std::shared_ptr<MediaPort>> open(asio::any_io_executor executor,
                                                   const UdpSocketSettings& settings, const Clock& clock);
  ~MediaPort();
  void close();

  // AlreadyExists: the id or the token is in use. With `srtp`, media and feedback are encrypted and
  // authenticated, and poses by UDP, which are not, are refused.
  Status add_session(SessionId session, const SessionToken& token, std::unique_ptr<RtpSender> sender,
                     MediaSessionEvents events, const std::optional<SrtpKeys>& srtp = std::nullopt);
  // Says BYE to the client. What was sent to it in all.
  RtpSenderStats remove_session(SessionId session, const std::string& reason);

  // Sends the session's video to another address too, in its own SRTP if `srtp` is given, for players that
  // know nothing of sessions. A tapped stream has a key frame every two seconds, so that they may begin at
  // any time. NotFound; ResourceExhausted: kMaxTaps. Taps end with their session.
  StatusOr<TapId> add_tap(SessionId session, const PeerAddress& to, const std::optional<SrtpKey>& srtp);
  void remove_tap(SessionId session, TapId tap);
  // Of video that a tap was sent. NotFound: the tap, or its session, is no more.
  StatusOr<uint64_t> tap_packets(SessionId session, TapId tap) const;
  // SPS and PPS (Annex B) of the newest key frame, for make_sdp(). NotFound; FailedPrecondition: there was
  // none yet.
  StatusOr<std::vector<uint8_t>> parameter_sets(SessionId session) const;
  static constexpr size_t kMaxTaps = 4;  // of a session

  // See RtpSender. NotFound: no such session. FailedPrecondition: its client has not said hello yet.
  StatusOr<double> frame_budget_bits(SessionId session, DurationNs frame_interval_ns, bool key_frame) const;
  StatusOr<uint32_t> send_frame(SessionId session, TimeNs capture_ns, std::span<const uint8_t> access_unit,
                                bool key_frame);
  Status set_rate(SessionId session, double rate_bps);

  uint16_t port() const { return socket_->port(); }
  BindingStats binding_stats() const;
  std::optional<StreamIds> stream_ids(SessionId session) const;
  std::optional<RtpSenderStats> sender_stats(SessionId session) const;
  std::optional<PeerReport> peer_report(SessionId session) const;
  uint64_t dropped_datagrams() const { return socket_->dropped(); }  // the socket's queue was full

 private:
  struct Session {
    std::unique_ptr<RtpSender> sender;
    std::shared_ptr<const MediaSessionEvents> events;
    NewestPose newest_pose;
    bool left = false;
    std::unique_ptr<Srtp> srtp;  // empty: clear text
    std::map<TapId, std::unique_ptr<MediaTap>> taps;
    std::vector<uint8_t> parameter_sets;
    TimeNs key_frame_ns = 0;  // when the last one was sent, or asked for on account of taps
  };
  using Calls = std::vector<std::function<void()>>;

  MediaPort(asio::any_io_executor executor, const Clock& clock);
  void on_datagram(const PeerAddress& from, std::span<const uint8_t> datagram);
  void handle(const RoutedDatagram& routed, std::span<const uint8_t> datagram, Calls& calls);
  void on_feedback(Session& session, std::span<const uint8_t> datagram, Calls& calls);
  void log_dropped();
  void send(const PeerAddress& to, Session& session, Datagram datagram);
  void pump(SessionId id, Session& session);
  void on_sent_frame(Session& session, std::span<const uint8_t> access_unit, bool key_frame, Calls& calls);
  void schedule();
  void on_timer();
  StatusOr<const Session*> find_bound(SessionId session) const;

  const Clock& clock_;
  std::shared_ptr<UdpSocket> socket_;
  mutable std::mutex mutex_;  // of all below
  asio::steady_timer timer_;
  std::optional<TimeNs> timer_due_ns_;
  SessionBinding binding_;
  std::map<SessionId, Session> sessions_;
  LogLimiter drop_log_;
  TapId next_tap_ = 1;
  bool closed_ = false;
};

}  // namespace tessera::transport
