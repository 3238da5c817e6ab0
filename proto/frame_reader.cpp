#include "proto/frame_reader.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "proto/control_access.h"
#include "proto/frame_record.h"

namespace tessera {
namespace {

constexpr std::chrono::seconds kRestTimeout{10};

}  // namespace

FrameReader::FrameReader(v1::Control::Stub& control, uint64_t session)
    : control_(control),
      session_(session),
      thread_([this] { watched_ = read(watching_, false, [] { return false; }); }) {}

FrameReader::~FrameReader() {
  stop();
}

void FrameReader::stop() {
  stopping_ = true;
  watching_.TryCancel();
  if (thread_.joinable()) thread_.join();
}

template <class Done>
Status FrameReader::read(grpc::ClientContext& context, bool once, Done&& done) {
  v1::WatchFramesRequest request;
  request.set_session(session_);
  request.set_first(next_);
  request.set_once(once);
  const auto reader = control_.WatchFrames(&context, request);
  bool enough = done();
  for (v1::FrameRecord record; !enough && reader->Read(&record); enough = done()) {
    if (record.index() != next_) {
      context.TryCancel();
      return absl::DataLossError(absl::StrCat("WatchFrames of session ", session_, ": records ", next_,
                                              " to ", record.index(), " were dropped before they were read"));
    }
    records_.push_back(tessera::read(record));
    ++next_;
  }
  if (enough) context.TryCancel();
  const grpc::Status end = reader->Finish();
  const bool stopped =
      end.error_code() == grpc::StatusCode::CANCELLED && (enough || (&context == &watching_ && stopping_));
  if (end.ok() || stopped) return absl::OkStatus();
  return to_status(end, absl::StrCat("WatchFrames of session ", session_));
}

// With `last`, the daemon keeps sending until that is there.
Status FrameReader::read_rest(std::optional<FrameNumber> last) {
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + kRestTimeout);
  const auto is_last = [&](const FrameRecord& record) { return record.frame == *last; };
  const Status status = read(context, !last, [&] { return last && std::ranges::any_of(records_, is_last); });
  if (!last || !absl::IsDeadlineExceeded(status)) return status;
  return read_rest(std::nullopt);  // whether the daemon answers at all
}

StatusOr<std::vector<FrameRecord>> FrameReader::finish(std::optional<FrameNumber> last) {
  stop();
  TESSERA_RETURN_IF_ERROR(watched_);
  TESSERA_RETURN_IF_ERROR(read_rest(last));
  return std::move(records_);
}

}  // namespace tessera
