#include "client-sdk/session.h"

#include <utility>

namespace tessera::client {

Session::Session(const Ticket& ticket, const transport::ClientSettings& client, DurationNs connect_timeout_ns)
    : thread_([this, ticket, client, connect_timeout_ns] { connect(ticket, client, connect_timeout_ns); }) {}

Session::~Session() {
  thread_.join();
}

void Session::connect(const Ticket& ticket, const transport::ClientSettings& client, DurationNs timeout_ns) {
  auto connection = client::connect(ticket, client, timeout_ns, clock_);
  if (!connection.ok()) {
    const std::lock_guard lock(mutex_);
    failure_ = connection.status();
    return;
  }
  owned_ = *std::move(connection);
  connection_.store(owned_.get(), std::memory_order_release);
}

Status Session::status() const {
  if (const Connection* standing = connection()) return standing->status();
  const std::lock_guard lock(mutex_);
  return failure_;
}

bool Session::send_pose(const TimedPose& pose, const std::optional<vec3>& gaze) {
  Connection* standing = connection();
  if (standing != nullptr) standing->send_pose(pose, gaze);
  return standing != nullptr;
}

std::optional<SessionEvent> Session::poll_event() {
  const Status now = status();
  const Connection* standing = connection();
  const std::optional<ConnectionStats> seen = stats();

  const std::lock_guard lock(mutex_);
  if (announced_ == SessionState::lost) return std::nullopt;
  const auto announce = [this](SessionState state, const Status& reason) {
    announced_ = state;
    return SessionEvent{.state = state, .reason = reason};
  };
  if (!announced_) return announce(SessionState::connecting, absl::OkStatus());
  if (standing != nullptr && announced_ == SessionState::connecting)
    return announce(SessionState::streaming, absl::OkStatus());
  if (seen && seen->core.pairs > 0 && !std::exchange(first_picture_announced_, true))
    return SessionEvent{
        .kind = SessionEvent::Kind::first_picture, .state = *announced_, .frame = seen->core.newest_pair};
  if (seen && seen->core.pairs > pairs_announced_) {
    pairs_announced_ = seen->core.pairs;
    return SessionEvent{
        .kind = SessionEvent::Kind::frame_available, .state = *announced_, .frame = seen->core.newest_pair};
  }
  if (!now.ok()) return announce(SessionState::lost, now);
  return std::nullopt;
}

Session::Acquired Session::acquire() {
  Connection* standing = connection();
  const Pair* next = standing == nullptr ? nullptr : standing->take_newest();
  if (next != nullptr) pair_ = next;
  return {pair_, next != nullptr};
}

void Session::report_displayed(FrameNumber frame, TimeNs displayed_ns) {
  if (Connection* standing = connection()) standing->report_displayed(frame, displayed_ns);
}

std::optional<ConnectionStats> Session::stats() const {
  const Connection* standing = connection();
  if (standing == nullptr) return std::nullopt;
  return standing->stats();
}

}  // namespace tessera::client
