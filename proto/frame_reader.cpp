#include "proto/frame_reader.h"

#include <utility>

#include "proto/frame_record.h"

namespace tessera {

FrameReader::FrameReader(v1::Control::Stub& control, uint64_t session)
    : control_(control), session_(session), thread_([this] { read(watching_, false); }) {}

FrameReader::~FrameReader() {
  stop();
}

void FrameReader::stop() {
  watching_.TryCancel();
  if (thread_.joinable()) thread_.join();
}

void FrameReader::read(grpc::ClientContext& context, bool once) {
  v1::WatchFramesRequest request;
  request.set_session(session_);
  request.set_first(next_);
  request.set_once(once);
  const auto reader = control_.WatchFrames(&context, request);
  for (v1::FrameRecord record; reader->Read(&record);) {
    records_.push_back(tessera::read(record));
    next_ = record.index() + 1;
  }
  (void)reader->Finish();  // the session's end, or stop()
}

std::vector<FrameRecord> FrameReader::finish() {
  stop();
  grpc::ClientContext context;
  read(context, true);
  return std::move(records_);
}

}  // namespace tessera
