// A client's two connections to its session, with the core behind them: poses out, complete pairs in.
#pragma once

#include <memory>
#include <string>

#include "base/status.h"
#include "base/time.h"
#include "base/view.h"
#include "client-sdk/client_core.h"
#include "transport/asio/byte_stream.h"
#include "transport/messages.h"
#include "transport/rtp_receiver.h"
#include "transport/session_token.h"

namespace tessera::client {

struct ConnectionSettings {
  std::string server_address = "127.0.0.1";  // in numbers
  uint16_t meta_port = 0;
  transport::SessionToken token{};
  transport::ClientSettings client;
  std::shared_ptr<transport::TlsContext> tls;        // empty: plain TCP
  DurationNs connect_timeout_ns = 8 * kNsPerSecond;  // for all steps together
};

struct ConnectionStats {
  ClientStats core;
  transport::RtpReceiverStats media;
  std::optional<DurationNs> round_trip_ns;    // of the network
  std::optional<DurationNs> clock_offset_ns;  // the server's clock minus ours
};

// Owns a thread that receives and one that decodes. take_newest() and report_displayed() belong to one
// drawing thread, as in ClientCore; the rest may be called from any thread.
class Connection {
 public:
  // Blocks until both connections stand, or one has failed; the error names the step (connect, TLS, hello,
  // media). `clock` outlives the connection.
  static StatusOr<std::unique_ptr<Connection>> connect(const ConnectionSettings& settings,
                                                       const Clock& clock);
  ~Connection();  // says bye

  // Newest wins; `pose.time_ns` on this side's clock, increasing. `gaze`: where the eyes look, a unit vector
  // in the head's axes; none: straight ahead.
  void send_pose(const TimedPose& pose, const std::optional<vec3>& gaze = {});
  // See ClientCore::take_newest(). Counts as the moment at which drawing begins.
  const Pair* take_newest();
  // The moment at which a pair's first picture was shown. The server predicts by it. All that is known of
  // this frame, and of those before it, goes to the server (base/frame_record.h).
  void report_displayed(FrameNumber frame, TimeNs displayed_ns);

  // OK while the session runs; then why it ended.
  Status status() const;
  const transport::Welcome& welcome() const;
  ConnectionStats stats() const;

 private:
  struct Impl;
  explicit Connection(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera::client
