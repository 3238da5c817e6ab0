// Serves many clients over real sockets: one media port, one meta port, one render thread for the device.
// Control (who may have a session, of which scene) lies above.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "base/time.h"
#include "server/frame.h"
#include "server/streamed_session.h"
#include "transport/asio/media_port.h"
#include "transport/asio/meta_listener.h"

namespace tessera::server {

struct StreamServerSettings {
  transport::UdpSocketSettings media;    // port 0: a free one
  transport::MetaListenerSettings meta;  // likewise
  size_t max_sessions = 32;
  uint64_t max_atlas_texels = 128u << 20;  // of all sessions together
  DurationNs idle_timeout_ns = 0;          // a session without a client ends after it; 0: never
  StreamedSession::OnRendered on_rendered;
  bool insecure = false;  // allows other addresses than loopback without TLS
};

// InvalidArgument: an address beyond loopback without TLS and without `insecure`.
Status check_exposure(const StreamServerSettings& settings);

// What a client needs to connect. The token is a secret.
struct SessionTicket {
  transport::SessionId session = 0;
  transport::SessionToken token{};
  uint16_t media_port = 0, meta_port = 0;
};

// A session's video on its way to a plain RTP player as well.
struct Forwarding {
  transport::SessionId session = 0;
  transport::TapId tap = 0;
  std::string sdp;  // with TLS it holds the key: as secret as the token
};

struct StreamServerStats {
  std::map<transport::SessionId, StreamedSessionStats> sessions;
  StreamedSessionStats ended;  // the counters of sessions that are no more, summed
  std::map<absl::StatusCode, uint64_t> refused_clients;
  transport::BindingStats binding;
  uint64_t dropped_datagrams = 0;  // the socket's queue was full
  uint64_t atlas_texels = 0;       // of all sessions
};

// Thread-safe.
class StreamServer {
 public:
  // InvalidArgument: an address beyond loopback without TLS and without `insecure`. Busy ports: see
  // bind_error(). `clock` outlives the server.
  static StatusOr<std::unique_ptr<StreamServer>> create(const StreamServerSettings& settings,
                                                        const Clock& clock);
  // Tells all clients and waits for its threads.
  ~StreamServer();

  // The session waits for its client; it renders once both its connections stand. All renderers are of one
  // device (see renders()). ResourceExhausted: max_sessions, max_atlas_texels.
  StatusOr<SessionTicket> create_session(RendererFactory renderer, const SessionSettings& settings);
  // From the next frame on; the client need not connect again. NotFound.
  Status set_rate(transport::SessionId session, double bitrate_bps, double frames_per_second);
  // Sends the session's video to `to` as well, encrypted where the session is. NotFound;
  // FailedPrecondition: no frame was sent yet; ResourceExhausted: MediaPort::kMaxTaps.
  StatusOr<Forwarding> forward(transport::SessionId session, const transport::PeerAddress& to);
  void end_forward(const Forwarding& forwarding);
  // Sent so far. NotFound: the session has ended, or its client has left.
  StatusOr<uint64_t> forwarded_packets(const Forwarding& forwarding) const;
  // NotFound.
  Status end_session(transport::SessionId session, const std::string& reason);
  void end_all(const std::string& reason);
  StatusOr<StreamedSessionStats> stats(transport::SessionId session) const;
  // See StreamedSession::records().
  StatusOr<std::vector<FrameRecord>> records(transport::SessionId session, uint64_t first,
                                             uint64_t& next) const;
  StreamServerStats stats() const;
  bool has(transport::SessionId session) const;
  size_t sessions() const;

  // Runs `work` on the render thread, between two frames, and waits for it: a device belongs to one thread.
  // Whatever of a scene lies on the device is made and destroyed this way. Cancelled: the server stops.
  Status run_on_device(const std::function<Status()>& work);

  uint16_t media_port() const;
  uint16_t meta_port() const;

 private:
  struct Impl;
  explicit StreamServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera::server
