#include "server/streamed_session.h"

#include <algorithm>
#include <utility>

#include "base/log.h"

namespace tessera::server {
namespace {

using transport::FrameType;

constexpr DurationNs kHistoryNs = kNsPerSecond / 2;  // of poses, for prediction
constexpr size_t kMaxPoses = 256;
// Of a client's eyes: id buffers of this size are drawn and read back for every predicted view.
constexpr uint32_t kMaxViewPixels = 1u << 24;
constexpr DurationNs kFirstRoundTripNs = 100 * kNsPerMs;  // assumed before the client has reported one
constexpr DurationNs kMaxRoundTripNs = kNsPerSecond;
constexpr size_t kMaxFramesInFlight = 256;
constexpr DurationNs kRateWindowNs = kNsPerSecond;

// The media port says so when the client has just left, or its address went to another session: no error of
// the frame.
bool left(const Status& status) {
  return absl::IsNotFound(status) || absl::IsFailedPrecondition(status);
}

}  // namespace

StreamedSession::StreamedSession(transport::SessionId id, RendererFactory make_renderer,
                                 const SessionSettings& settings, std::shared_ptr<transport::MediaPort> media,
                                 const Clock& clock, OnRendered on_rendered)
    : id_(id),
      media_(std::move(media)),
      clock_(clock),
      settings_(settings),
      on_rendered_(std::move(on_rendered)),
      make_renderer_(std::move(make_renderer)),
      rate_(settings.rate) {
  stats_.round_trip_ns = kFirstRoundTripNs;
  idle_since_ns_ = clock_.now();
}

Status StreamedSession::admit(const transport::ClientSettings& client) {
  const std::lock_guard lock(mutex_);
  if (closed_) return absl::NotFoundError(absl::StrCat("session ", id_, " has ended"));
  if (admitted_) {
    return absl::FailedPreconditionError(
        absl::StrCat("session ", id_, " has a client already; create a session for each client"));
  }
  if (client.eyes.size() * client.width * client.height > kMaxViewPixels) {
    return absl::ResourceExhaustedError(absl::StrCat(
        client.eyes.size(), " eyes with ", client.width, "x", client.height, " pixels each; the limit is ",
        kMaxViewPixels, " together: say hello with a smaller view, and draw as large as you like"));
  }
  admitted_ = true;
  client_view_.width = client.width;
  client_view_.height = client.height;
  eyes_ = client.eyes;
  return absl::OkStatus();
}

void StreamedSession::on_connected(std::shared_ptr<transport::MetaConnection> connection) {
  Status reason;
  {
    const std::lock_guard lock(mutex_);
    if (!closed_) {
      connection_ = std::move(connection);
      return;
    }
    reason = *closed_;
  }
  connection->close(reason);
}

void StreamedSession::on_closed(const Status& reason) {
  const std::lock_guard lock(mutex_);
  stats_.media += media_->remove_session(id_, std::string(reason.message()));
  connection_.reset();
  poses_.clear();
  gaze_.reset();
  under_way_.clear();
  admitted_ = bound_ = false;
  restart_ = true;  // the next client knows nothing
  prepared_ = false;
  idle_since_ns_ = clock_.now();
  stats_.ended = reason;
  stats_.round_trip_ns = kFirstRoundTripNs;  // the next one comes another way
  stats_.layout = {};
}

void StreamedSession::on_bound() {
  const std::lock_guard lock(mutex_);
  bound_ = true;
}

void StreamedSession::on_unbound() {
  const std::lock_guard lock(mutex_);
  bound_ = false;  // until its next hello
}

void StreamedSession::on_pose(const transport::SequencedPose& pose) {
  const std::lock_guard lock(mutex_);
  if (!poses_.empty() && pose.timed.time_ns <= poses_.back().time_ns) return;
  std::erase_if(poses_, [&](const TimedPose& p) { return p.time_ns < pose.timed.time_ns - kHistoryNs; });
  if (poses_.size() == kMaxPoses) poses_.erase(poses_.begin());  // the times are the client's word
  poses_.push_back(pose.timed);
  gaze_ = pose.gaze;
  newest_pose_sent_ns_ = pose.sent_ns;
  newest_pose_received_ns_ = clock_.now();
}

void StreamedSession::on_key_frame_request() {
  const std::lock_guard lock(mutex_);
  key_frame_wanted_ = true;
}

Status StreamedSession::on_frame(FrameType type, std::span<const uint8_t> payload) {
  switch (type) {
    case FrameType::pose: {
      TESSERA_ASSIGN_OR_RETURN(const transport::SequencedPose pose, transport::decode_pose(payload));
      on_pose(pose);
      return absl::OkStatus();
    }
    case FrameType::timing:
      return on_timing(payload);
    case FrameType::ping:
      return answer_ping(payload);
    default:
      return absl::InvalidArgumentError(
          absl::StrCat("frame of type ", static_cast<int>(type), " is not the client's to send"));
  }
}

Status StreamedSession::on_timing(std::span<const uint8_t> payload) {
  TESSERA_ASSIGN_OR_RETURN(const std::vector<ClientFrameTimes> timings, transport::decode_timings(payload));
  const std::lock_guard lock(mutex_);
  for (const ClientFrameTimes& times : timings) {
    auto sent = under_way_.extract(times.frame);
    if (sent.empty()) continue;
    FrameRecord& record = sent.mapped();
    record.client = times;
    // Both times are the client's.
    if (times.displayed > record.pose_time)
      stats_.round_trip_ns = std::min(times.displayed - record.pose_time, kMaxRoundTripNs);
    if (records_.size() == kMaxRecords) records_.pop_front(), ++first_record_;
    records_.push_back(record);
  }
  return absl::OkStatus();
}

std::vector<FrameRecord> StreamedSession::records(uint64_t first, uint64_t& next) const {
  const std::lock_guard lock(mutex_);
  next = first_record_ + records_.size();
  const uint64_t skip = first > first_record_ ? first - first_record_ : 0;
  if (skip >= records_.size()) return {};
  return {records_.begin() + static_cast<int64_t>(skip), records_.end()};
}

Status StreamedSession::answer_ping(std::span<const uint8_t> payload) {
  const TimeNs received = clock_.now();
  TESSERA_ASSIGN_OR_RETURN(const transport::ClockPing ping, transport::decode_ping(payload));
  std::shared_ptr<transport::MetaConnection> connection;
  {
    const std::lock_guard lock(mutex_);
    connection = connection_;
  }
  if (!connection) return absl::OkStatus();
  return connection->send(FrameType::pong, transport::encode(transport::ClockPong{ping.id, ping.client_sent,
                                                                                  received, clock_.now()}));
}

void StreamedSession::close(const Status& reason) {
  std::shared_ptr<transport::MetaConnection> connection;
  {
    const std::lock_guard lock(mutex_);
    closed_ = reason;
    connection = std::exchange(connection_, nullptr);
  }
  if (connection) connection->close(reason);
}

bool StreamedSession::ready() const {
  const std::lock_guard lock(mutex_);
  return connection_ && (!prepared_ || (bound_ && !poses_.empty()));
}

std::optional<TimeNs> StreamedSession::idle_since() const {
  const std::lock_guard lock(mutex_);
  return admitted_ ? std::nullopt : std::optional(idle_since_ns_);
}

TimeNs StreamedSession::due_ns() const {
  const std::lock_guard lock(mutex_);
  return due_ns_;
}

StreamedSession::Work StreamedSession::take_work() {
  const std::lock_guard lock(mutex_);
  if (std::exchange(restart_, false)) renderer_.reset();
  return {.poses = poses_,
          .connection = connection_,
          .gaze = gaze_,
          .client_view = client_view_,
          .eyes = eyes_,
          .round_trip_ns = stats_.round_trip_ns,
          .pose_sent_ns = newest_pose_sent_ns_,
          .pose_received_ns = newest_pose_received_ns_,
          .due_ns = due_ns_,
          .bound = bound_,
          .key_frame = std::exchange(key_frame_wanted_, false),
          .rate = rate_};
}

// Frames keep their rhythm; one that comes too late begins a new one.
void StreamedSession::put_off() {
  const TimeNs now = clock_.now();
  const std::lock_guard lock(mutex_);
  due_ns_ = std::max(due_ns_ + period_ns(), now);
}

void StreamedSession::count(const Frame& frame) {
  const TimeNs now = clock_.now();
  const std::lock_guard lock(mutex_);
  stats_.key_frames += frame.atlas.key_frame ? 1 : 0;
  stats_.meta_bytes += frame.meta.size();
  if (connection_) stats_.layout = frame.stats.layout;
  std::erase_if(sent_, [&](const auto& s) { return s.first <= now - kRateWindowNs; });
  sent_.emplace_back(now, frame.meta.size() + frame.atlas.bytes.size());
}

Status StreamedSession::set_rate(double bitrate_bps, double frames_per_second) {
  {
    const std::lock_guard lock(mutex_);
    rate_.bitrate_bps = bitrate_bps;
    rate_.frames_per_second = frames_per_second;
  }
  const Status set = media_->set_rate(id_, bitrate_bps);
  return absl::IsNotFound(set) ? absl::OkStatus() : set;  // the next client's stream begins with it
}

RateSplit StreamedSession::rate() const {
  const std::lock_guard lock(mutex_);
  return rate_;
}

Status StreamedSession::render() {
  const Work work = take_work();
  if (!work.connection) return absl::OkStatus();
  if (!renderer_) TESSERA_RETURN_IF_ERROR(prepare(work));
  if (!work.bound || work.poses.empty()) {
    if (work.key_frame) on_key_frame_request();
    return absl::OkStatus();
  }
  renderer_->set_rate(work.rate);
  const StatusOr<double> budget =
      media_->frame_budget_bits(id_, from_seconds(1 / work.rate.frames_per_second), work.key_frame);
  if (left(budget.status())) {
    on_unbound();
    return absl::OkStatus();
  }
  if (!budget.ok()) return budget.status();
  if (*budget <= 0) {  // frames are dropped before they are encoded, never after
    if (work.key_frame) on_key_frame_request();
    put_off();
    const std::lock_guard lock(mutex_);
    ++stats_.frames_skipped;
    return absl::OkStatus();
  }
  FrameRecord record{.session = id_, .frame = next_frame_++, .pose_sent = work.pose_sent_ns};
  record.server = {.pose_received = work.pose_received_ns, .due = work.due_ns, .render_begin = clock_.now()};
  record.scene_time = record.server.render_begin;
  TESSERA_ASSIGN_OR_RETURN(const Frame frame,
                           renderer_->render({.number = record.frame,
                                              .poses = work.poses,
                                              .round_trip_ns = work.round_trip_ns,
                                              .interval_ns = interval_ns(record.server.render_begin),
                                              .scene_time_ns = record.scene_time,
                                              .gaze = work.gaze,
                                              .key_frame = work.key_frame}));
  record.server.render_end = clock_.now();
  count(frame);
  if (spdlog::should_log(spdlog::level::debug)) {
    log_event(spdlog::level::debug, "frame rendered",
              {{"session", id_},
               {"frame", frame.number},
               {"key_frame", frame.atlas.key_frame},
               {"atlas_bytes", frame.atlas.bytes.size()},
               {"meta_bytes", frame.meta.size()},
               {"render_ms", frame.stats.times.total_ms()}});
  }
  if (on_rendered_) on_rendered_(frame.stats);
  const Status sent = send(work, frame, record);
  put_off();
  return sent;
}

// How long the frame before had to last: this one will have to as well.
DurationNs StreamedSession::interval_ns(TimeNs begin) {
  const TimeNs before = std::exchange(last_begin_ns_, begin);
  return before == 0 ? 0 : std::min(begin - before, kMaxRoundTripNs);
}

Status StreamedSession::prepare(const Work& work) {
  SessionSettings settings = settings_;
  settings.client_view = work.client_view;
  settings.eyes = work.eyes;
  settings.rate = work.rate;
  TESSERA_ASSIGN_OR_RETURN(renderer_, make_renderer_(settings));
  last_begin_ns_ = 0;
  const std::lock_guard lock(mutex_);
  stats_.encoder = renderer_->encoder();
  prepared_ = !restart_;
  return absl::OkStatus();
}

Status StreamedSession::send(const Work& work, const Frame& frame, FrameRecord record) {
  const StageTimes& times = frame.stats.times;
  record.pose_time = frame.pose.time_ns;
  record.key_frame = frame.atlas.key_frame;
  record.atlas_bytes = frame.atlas.bytes.size();
  record.meta_bytes = frame.meta.size();
  record.server.visibility = from_ms(times.visibility_ms);
  record.server.layout = from_ms(times.density_ms + times.layout_ms);
  record.server.shading = from_ms(times.shading_ms);
  record.server.encode = from_ms(times.encode_ms);
  record.server.sent = record.server.render_end;  // until it is known: the client may report before that
  expect_report(record);
  // A client that left meanwhile is no error of this frame: on_closed() tells.
  if (!work.connection->send(FrameType::meta, frame.meta).ok()) return absl::OkStatus();
  const StatusOr<uint32_t> sent =
      media_->send_frame(id_, record.server.render_begin, frame.atlas.bytes, frame.atlas.key_frame);
  if (left(sent.status())) {
    on_unbound();
    return absl::OkStatus();
  }
  on_sent(record.frame, clock_.now());
  if (!absl::IsResourceExhausted(sent.status())) return sent.status();
  on_key_frame_request();
  return absl::OkStatus();
}

void StreamedSession::expect_report(const FrameRecord& record) {
  const std::lock_guard lock(mutex_);
  under_way_[record.frame] = record;
  if (under_way_.size() > kMaxFramesInFlight) under_way_.erase(under_way_.begin());
}

void StreamedSession::on_sent(FrameNumber frame, TimeNs sent) {
  const std::lock_guard lock(mutex_);
  ++stats_.frames_sent;
  if (const auto found = under_way_.find(frame); found != under_way_.end()) found->second.server.sent = sent;
}

void StreamedSession::release() {
  renderer_.reset();
  make_renderer_ = {};
}

StreamedSessionStats StreamedSession::stats() const {
  const std::lock_guard lock(mutex_);
  StreamedSessionStats stats = stats_;
  stats.connected = connection_ != nullptr;
  stats.atlas_texels = uint64_t{settings_.layout.width} * settings_.layout.height;
  for (const auto& [when, bytes] : sent_)
    if (when > clock_.now() - kRateWindowNs) stats.bitrate_bps += 8 * static_cast<double>(bytes);
  stats.media += media_->sender_stats(id_).value_or(transport::RtpSenderStats());
  stats.peer = media_->peer_report(id_);
  return stats;
}

}  // namespace tessera::server
