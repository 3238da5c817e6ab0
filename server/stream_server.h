// Serves many clients over real sockets: one media port, one meta port, one render thread for the device.
// Control (who may have a session, of which scene) lies above.
#pragma once

#include <functional>
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
  bool insecure = false;  // allows other addresses than loopback without TLS
};

// What a client needs to connect. The token is a secret.
struct SessionTicket {
  transport::SessionId session = 0;
  transport::SessionToken token{};
  uint16_t media_port = 0, meta_port = 0;
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
  // device (see renders()). ResourceExhausted: max_sessions.
  StatusOr<SessionTicket> create_session(RendererFactory renderer, const SessionSettings& settings);
  // NotFound.
  Status end_session(transport::SessionId session, const std::string& reason);
  void end_all(const std::string& reason);
  StatusOr<StreamedSessionStats> stats(transport::SessionId session) const;
  // See StreamedSession::records().
  StatusOr<std::vector<FrameRecord>> records(transport::SessionId session, uint64_t first,
                                             uint64_t& next) const;
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
