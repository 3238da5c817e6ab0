// One client of a StreamServer: what its connections bring in, and the frames that go out to it.
#pragma once

#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/frame_record.h"
#include "server/frame.h"
#include "transport/asio/media_port.h"
#include "transport/asio/meta_connection.h"

namespace tessera::server {

struct StreamedSessionStats {
  bool connected = false;
  uint64_t frames_sent = 0;
  uint64_t frames_skipped = 0;  // periods given up: the network still held the frame before
  uint64_t key_frames = 0;      // of those sent
  uint64_t meta_bytes = 0;      // of geometry sent
  double bitrate_bps = 0;       // measured: of the last second's frames, atlas and geometry
  std::string encoder;          // which one runs, and why; empty before the first frame
  transport::RtpSenderStats media;
  std::optional<transport::PeerReport> peer;  // what the client last reported of the media
  DurationNs round_trip_ns = 0;  // from a pose to the picture that shows its frame, as the client reports it
  Status ended;                  // why the client left, or OK
  atlas::LayoutStats layout;     // of the client's last frame
  uint64_t atlas_texels = 0;     // of the whole atlas
  double share(uint64_t texels) const {
    return atlas_texels == 0 ? 0 : static_cast<double>(texels) / static_cast<double>(atlas_texels);
  }
};

// The network's threads call on_*; the render thread calls ready(), due_ns(), render() and release().
// Thread-safe.
class StreamedSession {
 public:
  static constexpr size_t kMaxRecords = 1024;

  // `settings.client_view` and `eyes` are replaced by what the client's hello says.
  // `on_rendered` is called by the render thread after each frame, and must not block.
  using OnRendered = std::function<void(const FrameStats&)>;
  StreamedSession(transport::SessionId id, RendererFactory make_renderer, const SessionSettings& settings,
                  std::shared_ptr<transport::MediaPort> media, const Clock& clock,
                  OnRendered on_rendered = {});

  void on_connected(std::shared_ptr<transport::MetaConnection> connection);
  void on_closed(const Status& reason);
  void on_bound();
  void on_pose(const transport::SequencedPose& pose);
  void on_key_frame_request();
  Status on_frame(transport::FrameType type, std::span<const uint8_t> payload);
  // FailedPrecondition: a client is connected already. NotFound: close() was called.
  Status admit(const transport::ClientSettings& client);
  // Tells the client, also one that is just connecting; it sends nothing any more.
  void close(const Status& reason);

  // There is something to do: a renderer to make for a client that has come, or a frame, as both connections
  // stand and a pose is there.
  bool ready() const;
  // Since when it has had no client, if it has none.
  std::optional<TimeNs> idle_since() const;
  // When its next frame should start, on the server's clock.
  TimeNs due_ns() const;
  // From the next frame on.
  Status set_rate(double bitrate_bps, double frames_per_second);
  RateSplit rate() const;
  // Makes the renderer; renders and sends a frame, or skips it while the network is behind. An error ends the
  // session.
  Status render();
  // Lets go of all that lies on the device; nothing is rendered afterwards.
  void release();
  StreamedSessionStats stats() const;
  // Of the frames about which the client has reported, the last kMaxRecords; from the `first`-th on, counted
  // from 0 over the session's life. `next` becomes the number to ask for next time.
  std::vector<FrameRecord> records(uint64_t first, uint64_t& next) const;
  const SessionSettings& settings() const { return settings_; }  // as created; see rate()
  transport::SessionId id() const { return id_; }

 private:
  struct Work {  // what the render thread takes along
    std::vector<TimedPose> poses;
    std::shared_ptr<transport::MetaConnection> connection;
    std::optional<vec3> gaze;
    View client_view;
    std::vector<Eye> eyes;
    DurationNs round_trip_ns = 0;
    TimeNs pose_sent_ns = 0, pose_received_ns = 0, due_ns = 0;
    bool bound = false, key_frame = false;
    RateSplit rate;
  };
  void on_unbound();
  Status on_timing(std::span<const uint8_t> payload);
  Status answer_ping(std::span<const uint8_t> payload);
  Work take_work();
  DurationNs interval_ns(TimeNs begin);
  Status prepare(const Work& work);
  Status send(const Work& work, const Frame& frame, FrameRecord record);
  void put_off();
  void count(const Frame& frame);
  void expect_report(const FrameRecord& record);
  void on_sent(FrameNumber frame, TimeNs sent);
  DurationNs period_ns() const { return from_seconds(1.0 / rate_.frames_per_second); }  // under the lock

  const transport::SessionId id_;
  const std::shared_ptr<transport::MediaPort> media_;
  const Clock& clock_;
  const SessionSettings settings_;
  const OnRendered on_rendered_;
  RendererFactory make_renderer_;            // the render thread's, with all of the device
  std::unique_ptr<FrameRenderer> renderer_;  // likewise
  FrameNumber next_frame_ = 1;               // likewise
  TimeNs last_begin_ns_ = 0;                 // likewise

  mutable std::mutex mutex_;  // of all below
  std::shared_ptr<transport::MetaConnection> connection_;
  View client_view_;
  std::vector<Eye> eyes_;
  std::vector<TimedPose> poses_;  // on the client's clock
  std::optional<vec3> gaze_;      // of the newest
  TimeNs newest_pose_sent_ns_ = 0, newest_pose_received_ns_ = 0;
  std::map<FrameNumber, FrameRecord> under_way_;  // sent, and nothing heard of it yet
  std::deque<FrameRecord> records_;
  uint64_t first_record_ = 0;  // number of records_.front()
  bool admitted_ = false, bound_ = false, key_frame_wanted_ = false, restart_ = false, prepared_ = false;
  std::optional<Status> closed_;  // why
  TimeNs due_ns_ = 0, idle_since_ns_ = 0;
  RateSplit rate_;
  std::deque<std::pair<TimeNs, uint64_t>> sent_;  // when, bytes; of the last second
  StreamedSessionStats stats_;
};

}  // namespace tessera::server
