#include "proto/frame_reader.h"

#include <chrono>
#include <utility>

#include "proto/control_access.h"
#include "proto/frame_record.h"

namespace tessera {
namespace {

constexpr std::chrono::seconds kRestTimeout{10};

}  // namespace

FrameReader::FrameReader(v1::Control::Stub& control, uint64_t session)
    : control_(control), session_(session), thread_([this] { watched_ = read(watching_, false); }) {}

FrameReader::~FrameReader() {
  stop();
}

void FrameReader::stop() {
  stopping_ = true;
  watching_.TryCancel();
  if (thread_.joinable()) thread_.join();
}

Status FrameReader::read(grpc::ClientContext& context, bool once) {
  v1::WatchFramesRequest request;
  request.set_session(session_);
  request.set_first(next_);
  request.set_once(once);
  const auto reader = control_.WatchFrames(&context, request);
  for (v1::FrameRecord record; reader->Read(&record);) {
    if (record.index() != next_) {
      context.TryCancel();
      return absl::DataLossError(absl::StrCat("WatchFrames of session ", session_, ": records ", next_,
                                              " to ", record.index(), " were dropped before they were read"));
    }
    records_.push_back(tessera::read(record));
    ++next_;
  }
  const grpc::Status end = reader->Finish();
  const bool stopped = end.error_code() == grpc::StatusCode::CANCELLED && stopping_ && !once;
  if (end.ok() || stopped) return absl::OkStatus();
  return to_status(end, absl::StrCat("WatchFrames of session ", session_));
}

StatusOr<std::vector<FrameRecord>> FrameReader::finish() {
  stop();
  TESSERA_RETURN_IF_ERROR(watched_);
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + kRestTimeout);
  TESSERA_RETURN_IF_ERROR(read(context, true));
  return std::move(records_);
}

}  // namespace tessera
