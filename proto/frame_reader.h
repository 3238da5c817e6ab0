// Collects a session's frame records from a daemon, beside whatever else goes on.
#pragma once

#include <grpcpp/grpcpp.h>

#include <atomic>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "base/frame_record.h"
#include "base/status.h"
#include "tessera/v1/control.grpc.pb.h"

namespace tessera {

class FrameReader {
 public:
  // `control` outlives the reader.
  FrameReader(v1::Control::Stub& control, uint64_t session);
  ~FrameReader();
  FrameReader(const FrameReader&) = delete;
  FrameReader& operator=(const FrameReader&) = delete;

  // All records so far, those included that the daemon has not sent yet. The client's report of frame `last`
  // may still be on its way there: finish() waits for its record, 10 s at most. Call it once, while the
  // session lives. Errors are those of WatchFrames: records are all there, or none is returned.
  StatusOr<std::vector<FrameRecord>> finish(std::optional<FrameNumber> last = std::nullopt);

 private:
  // Until `done`, which looks at records_, or the stream's end.
  template <class Done>
  Status read(grpc::ClientContext& context, bool once, Done&& done);
  Status read_rest(std::optional<FrameNumber> last);
  void stop();

  v1::Control::Stub& control_;
  const uint64_t session_;
  uint64_t next_ = 0;  // index
  std::vector<FrameRecord> records_;
  Status watched_;  // how watching ended
  std::atomic<bool> stopping_ = false;
  grpc::ClientContext watching_;
  std::thread thread_;  // last: it uses all of the above
};

}  // namespace tessera
