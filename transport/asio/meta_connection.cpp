#include "transport/asio/meta_connection.h"

#include <chrono>
#include <utility>

namespace tessera::transport {
namespace {

constexpr size_t kReadBytes = 64 << 10;

}  // namespace

ErrorCode error_code(const Status& status) {
  switch (status.code()) {
    case absl::StatusCode::kUnauthenticated:
    case absl::StatusCode::kPermissionDenied:
    case absl::StatusCode::kNotFound:  // the session has ended, and its token with it
      return ErrorCode::bad_token;
    case absl::StatusCode::kUnimplemented:
      return ErrorCode::unsupported_version;
    case absl::StatusCode::kInvalidArgument:
      return ErrorCode::malformed;
    case absl::StatusCode::kDeadlineExceeded:
      return ErrorCode::too_slow;
    case absl::StatusCode::kResourceExhausted:
      return ErrorCode::full;
    case absl::StatusCode::kFailedPrecondition:
      return ErrorCode::busy;
    default:
      return ErrorCode::internal;
  }
}

Status to_status(const ErrorMessage& message) {
  const std::string text = absl::StrCat("the peer says: ", message.text);
  switch (message.code) {
    case ErrorCode::bad_token:
      return absl::UnauthenticatedError(text);
    case ErrorCode::unsupported_version:
      return absl::UnimplementedError(text);
    case ErrorCode::malformed:
      return absl::InvalidArgumentError(text);
    case ErrorCode::too_slow:
      return absl::DeadlineExceededError(text);
    case ErrorCode::full:
      return absl::ResourceExhaustedError(text);
    case ErrorCode::busy:
      return absl::FailedPreconditionError(text);
    default:
      return absl::InternalError(text);
  }
}

MetaConnection::MetaConnection(std::unique_ptr<ByteStream> stream, const MetaConnectionSettings& settings,
                               MetaConnectionEvents events)
    : stream_(std::move(stream)),
      stall_timer_(stream_->executor()),
      settings_(settings),
      events_(std::move(events)),
      parser_(settings.max_payload),
      read_buffer_(kReadBytes) {}

std::shared_ptr<MetaConnection> MetaConnection::start(std::unique_ptr<ByteStream> stream,
                                                      const MetaConnectionSettings& settings,
                                                      MetaConnectionEvents events) {
  std::shared_ptr<MetaConnection> self(new MetaConnection(std::move(stream), settings, std::move(events)));
  asio::post(self->stream_->executor(), [self] {
    const std::lock_guard lock(self->mutex_);
    self->read();
  });
  return self;
}

// All calls of the stream happen on its executor, under the lock.
void MetaConnection::read() {
  if (closed_) return;
  stream_->async_read_some(asio::buffer(read_buffer_),
                           [self = shared_from_this()](SystemError e, size_t n) { self->on_read(e, n); });
}

void MetaConnection::on_read(SystemError error, size_t bytes) {
  if (error) return finish(absl::UnavailableError(absl::StrCat("the connection ended: ", error.message())));
  const Status status =
      parser_.feed(std::span(read_buffer_).first(bytes), [this](FrameType type, auto payload) {
        return closed() ? absl::CancelledError("closed") : on_frame(type, payload);
      });
  if (!status.ok()) begin_close(status);
  const std::lock_guard lock(mutex_);
  if (!closing_) read();
}

Status MetaConnection::on_frame(FrameType type, std::span<const uint8_t> payload) {
  if (type == FrameType::bye) {
    TESSERA_ASSIGN_OR_RETURN(const ByeMessage message, decode_bye(payload));
    finish(message.reason.empty() ? absl::OkStatus() : absl::CancelledError(message.reason));
  } else if (type == FrameType::error) {
    TESSERA_ASSIGN_OR_RETURN(const ErrorMessage message, decode_error(payload));
    finish(to_status(message));
  } else {
    return events_.on_frame ? events_.on_frame(type, payload) : absl::OkStatus();
  }
  return absl::OkStatus();
}

Status MetaConnection::send(FrameType type, std::span<const uint8_t> payload) {
  std::vector<uint8_t> frame;
  TESSERA_RETURN_IF_ERROR(write_frame(type, payload, frame, UINT32_MAX));
  {
    const std::lock_guard lock(mutex_);
    if (closed_ || closing_) return absl::FailedPreconditionError("the connection is closed");
    if (queued_bytes_ + frame.size() <= settings_.max_queued_bytes) {
      enqueue(std::move(frame));
      return absl::OkStatus();
    }
  }
  const Status too_slow = absl::DeadlineExceededError(
      absl::StrCat("the peer takes its data too slowly: more than max_queued_bytes (",
                   settings_.max_queued_bytes, ") would wait for it"));
  asio::post(stall_timer_.get_executor(), [self = shared_from_this(), too_slow] { self->finish(too_slow); });
  return too_slow;
}

void MetaConnection::enqueue(std::vector<uint8_t> frame) {
  queued_bytes_ += frame.size();
  queue_.push_back(std::move(frame));
  if (std::exchange(writing_, true)) return;
  asio::post(stall_timer_.get_executor(), [self = shared_from_this()] {
    const std::lock_guard lock(self->mutex_);
    if (self->closed_) return;
    self->watch_stall();
    self->write();
  });
}

void MetaConnection::write() {
  const std::vector<uint8_t>& front = queue_.front();
  stream_->async_write_some(asio::buffer(front) + written_,
                            [self = shared_from_this()](SystemError e, size_t n) { self->on_written(e, n); });
}

void MetaConnection::on_written(SystemError error, size_t bytes) {
  std::optional<Status> done;
  {
    const std::lock_guard lock(mutex_);
    if (closed_) return;
    if (error) {
      done = absl::UnavailableError(absl::StrCat("the connection ended: ", error.message()));
    } else {
      ++progress_;
      written_ += bytes;
      queued_bytes_ -= bytes;
      if (written_ == queue_.front().size()) {
        queue_.pop_front();
        written_ = 0;
      }
      if (!queue_.empty()) return write();
      writing_ = false;
      stall_timer_.cancel();
      done = closing_;
    }
  }
  if (done) finish(*done);
}

void MetaConnection::watch_stall() {
  stall_timer_.expires_after(std::chrono::nanoseconds(settings_.stall_timeout_ns));
  stall_timer_.async_wait([self = shared_from_this(), before = progress_](SystemError error) {
    if (error) return;
    {
      const std::lock_guard lock(self->mutex_);
      if (self->closed_ || !self->writing_) return;
      if (self->progress_ != before && !self->closing_) return self->watch_stall();
    }
    self->finish(absl::DeadlineExceededError(
        absl::StrCat("the peer took no data for ", to_seconds(self->settings_.stall_timeout_ns), " s while ",
                     self->queued_bytes(), " bytes waited")));
  });
}

std::vector<uint8_t> MetaConnection::last_frame(const Status& reason) {
  std::vector<uint8_t> out;
  const bool bye = reason.ok() || absl::IsCancelled(reason);
  const auto payload = bye ? encode(ByeMessage{std::string(reason.message())})
                           : encode(ErrorMessage{error_code(reason), std::string(reason.message())});
  (void)write_frame(bye ? FrameType::bye : FrameType::error, payload, out);  // always short enough
  return out;
}

void MetaConnection::begin_close(Status reason) {
  const std::lock_guard lock(mutex_);
  if (closed_ || closing_) return;
  const bool was_writing = writing_;
  enqueue(last_frame(reason));
  closing_ = std::move(reason);
  settings_.stall_timeout_ns = std::min(settings_.stall_timeout_ns, settings_.close_timeout_ns);
  if (was_writing) watch_stall();
}

void MetaConnection::close(Status reason) {
  asio::post(stall_timer_.get_executor(),
             [self = shared_from_this(), reason = std::move(reason)] { self->begin_close(reason); });
}

void MetaConnection::finish(Status reason) {
  {
    const std::lock_guard lock(mutex_);
    if (std::exchange(closed_, true)) return;
    stall_timer_.cancel();
    stream_->close();
    if (closing_) reason = *closing_;
    queue_.clear();
    queued_bytes_ = 0;
  }
  if (events_.on_closed) events_.on_closed(reason);
  events_ = {};  // what they hold must not keep the connection alive
}

size_t MetaConnection::queued_bytes() const {
  const std::lock_guard lock(mutex_);
  return queued_bytes_;
}

bool MetaConnection::closed() const {
  const std::lock_guard lock(mutex_);
  return closed_;
}

void MetaConnection::set_max_payload(size_t max_payload) {
  parser_.set_max_payload(max_payload);
}

}  // namespace tessera::transport
