// A session as an app lives with it: it connects in the background, and says what has happened when it is
// asked.
#pragma once

#include <atomic>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "base/time.h"
#include "client-sdk/connection.h"
#include "client-sdk/ticket.h"

namespace tessera::client {

enum class SessionState { connecting, streaming, lost };

struct SessionEvent {
  enum class Kind { state_changed, first_picture, frame_available };
  Kind kind = Kind::state_changed;
  SessionState state = SessionState::connecting;
  Status reason;          // of `lost`; never OK there
  FrameNumber frame = 0;  // of the others
};

// acquire() and report_displayed() belong to one drawing thread; the rest may be called from any thread.
class Session {
 public:
  // Returns at once.
  Session(const Ticket& ticket, const transport::ClientSettings& client, DurationNs connect_timeout_ns);
  // Says bye. Waits for an attempt to connect that is under way.
  ~Session();

  // False while it connects: the pose is ignored. See Connection::send_pose().
  bool send_pose(const TimedPose& pose, const std::optional<vec3>& gaze = {});
  // The next event, in this order: connecting; streaming; the first picture; frames, of which a newer one may
  // stand for several; lost, which is the last and may come at any place.
  std::optional<SessionEvent> poll_event();

  // Takes the newest pair if there is a new one. `pair` is the newest taken so far, null before the first,
  // and stays valid until the next call.
  struct Acquired {
    const Pair* pair = nullptr;
    bool is_new = false;
  };
  Acquired acquire();
  // What acquire() returned last.
  const Pair* pair() const { return pair_; }
  void report_displayed(FrameNumber frame, TimeNs displayed_ns);

  // OK while it connects or streams; then why it ended.
  Status status() const;
  std::optional<ConnectionStats> stats() const;  // none before it streams

 private:
  void connect(const Ticket& ticket, const transport::ClientSettings& client, DurationNs timeout_ns);
  // Null before it stands. Never changes after.
  Connection* connection() const { return connection_.load(std::memory_order_acquire); }

  const SteadyClock clock_;
  mutable std::mutex mutex_;  // of all up to the connection
  Status failure_;            // of the attempt to connect
  std::optional<SessionState> announced_;
  bool first_picture_announced_ = false;
  uint64_t pairs_announced_ = 0;

  std::unique_ptr<Connection> owned_;
  std::atomic<Connection*> connection_{nullptr};
  const Pair* pair_ = nullptr;
  std::thread thread_;  // connects
};

}  // namespace tessera::client
