#include "bench/stream_simulation.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <utility>

#include "server/rate_split.h"

namespace tessera::bench {
namespace {

constexpr DurationNs kPatience = 60 * kNsPerSecond;
constexpr size_t kPoseHistory = 32;

// What the client sends with every display frame.
struct PoseMessage {
  TimedPose pose;
  DurationNs round_trip_ns;
  bool key_frame;
};

std::vector<uint8_t> to_bytes(const PoseMessage& message) {
  std::vector<uint8_t> bytes(sizeof message);
  std::memcpy(bytes.data(), &message, sizeof message);
  return bytes;
}

PoseMessage from_bytes(const std::vector<uint8_t>& bytes) {
  PoseMessage message;
  std::memcpy(&message, bytes.data(), sizeof message);
  return message;
}

LinkSettings uplink(const LoopbackSettings& s) {
  return {.delay_ns = from_ms(s.delay_ms), .jitter_ns = from_ms(s.jitter_ms), .loss = s.loss, .seed = s.seed};
}

LinkSettings downlink(const LoopbackSettings& s) {
  LinkSettings link = uplink(s);
  link.rate_bps = s.bitrate_mbps * 1e6;
  link.seed = s.seed + 1;
  return link;
}

TimeNs tick(uint64_t index, double rate) {
  return from_seconds(static_cast<double>(index) / rate);
}

}  // namespace

struct StreamSimulation::Impl {
  Streamer& streamer;
  const CameraPath& path;
  LoopbackSettings settings;
  server::RateSplit rate;
  Link up, down;

  uint64_t display_ticks = 0, server_ticks = 0;
  std::optional<TimeNs> started;  // when the path began to run
  uint32_t scored = 0;

  // Server.
  std::vector<TimedPose> poses;
  std::optional<TimeNs> newest_pose_received;
  DurationNs known_round_trip = 0;
  bool key_frame_wanted = false;
  FrameNumber next_frame = 0;
  uint64_t rendered = 0, skipped = 0;
  struct Finished {
    TimeNs at;
    std::vector<Packet> packets;
    FrameNumber number;
  };
  std::deque<Finished> rendering;  // at most one in practice: the server finishes before its next period

  // Client.
  std::map<uint64_t, FrameNumber> in_flight;   // link message → frame
  std::map<FrameNumber, FrameRecord> records;  // under way
  std::vector<FrameRecord> shown;
  std::optional<FrameNumber> current;
  DurationNs measured_round_trip = 0;
  std::array<uint64_t, 2> bytes{};  // by channel, since the start

  Impl(Streamer& s, const CameraPath& p, const LoopbackSettings& l)
      : streamer(s),
        path(p),
        settings(l),
        rate{.bitrate_bps = l.bitrate_mbps * 1e6, .frames_per_second = l.server_fps},
        up(uplink(l)),
        down(downlink(l)) {
    measured_round_trip = 2 * from_ms(l.delay_ms) + 2 * from_ms(l.jitter_ms) + from_ms(l.server_ms) +
                          from_seconds(1.0 / l.server_fps);
    known_round_trip = measured_round_trip;
  }

  TimeNs path_time(TimeNs now) const {
    const TimeNs since_start = started ? std::max<TimeNs>(now - *started, 0) : 0;
    return from_seconds(settings.start_s) + since_start;
  }
  // Counted in display frames, so that all methods meet the same poses to the last bit, whenever they
  // started.
  TimeNs display_path_time() const {
    return from_seconds(settings.start_s) + (started ? tick(scored, settings.fps) : 0);
  }
  Pose pose_on_path(TimeNs path_time_ns) const { return path.at(path_time_ns); }
  Pose pose_at(TimeNs now) const { return pose_on_path(path_time(now)); }

  // Earliest thing that happens after the last one, and what it is; ties in this order.
  enum class Event { delivery, pose, rendered, serve, display };
  std::pair<TimeNs, Event> next_event() const {
    std::pair<TimeNs, Event> first{tick(display_ticks, settings.fps), Event::display};
    const auto consider = [&](std::optional<TimeNs> at, Event event) {
      if (at && std::pair(*at, event) < first) first = {*at, event};
    };
    consider(down.next_event_ns(), Event::delivery);
    consider(up.next_event_ns(), Event::pose);
    if (!rendering.empty()) consider(rendering.front().at, Event::rendered);
    consider(tick(server_ticks, settings.server_fps), Event::serve);
    return first;
  }

  Status deliver(TimeNs now) {
    for (Delivery& d : down.poll(now)) {
      note_delivered(records[in_flight.extract(d.id).mapped()].client, d);
      TESSERA_RETURN_IF_ERROR(streamer.deliver(d.channel, d.payload));
    }
    return absl::OkStatus();
  }

  static void note_delivered(ClientFrameTimes& times, const Delivery& d) {
    if (d.channel == Channel::atlas) {
      times.atlas_first_packet = times.atlas_complete = times.atlas_decode_begin = times.atlas_decoded =
          d.delivered_ns;
    } else {
      times.meta_complete = times.meta_decode_begin = times.meta_decoded = d.delivered_ns;
    }
  }

  void receive_poses(TimeNs now) {
    for (const Delivery& d : up.poll(now)) {
      const PoseMessage message = from_bytes(d.payload);
      // Newest wins: a pose that a later one overtook is of no use.
      if (!poses.empty() && message.pose.time_ns <= poses.back().time_ns) continue;
      if (poses.size() == kPoseHistory) poses.erase(poses.begin());
      poses.push_back(message.pose);
      newest_pose_received = d.delivered_ns;
      known_round_trip = message.round_trip_ns;
      key_frame_wanted |= message.key_frame;
    }
  }

  Status serve(TimeNs now) {
    ++server_ticks;
    if (poses.empty()) return absl::OkStatus();
    const TimeNs ready = now + from_ms(settings.server_ms);
    if (!rate.may_render(std::max<DurationNs>(down.queued_ns(now) - from_ms(settings.server_ms), 0))) {
      ++skipped;
      return absl::OkStatus();
    }
    const FrameNumber number = next_frame++;
    const ServeRequest request{.number = number,
                               .poses = poses,
                               .round_trip_ns = known_round_trip,
                               .scene_time_ns = path_time(now),
                               .key_frame = std::exchange(key_frame_wanted, false)};
    TESSERA_ASSIGN_OR_RETURN(std::vector<Packet> packets, streamer.serve(request));
    records[number] = {.frame = number,
                       .scene_time = request.scene_time_ns,
                       .pose_time = poses.back().time_ns,
                       .pose_sent = poses.back().time_ns,
                       .server = {.pose_received = *newest_pose_received,
                                  .due = now,
                                  .render_begin = now,
                                  .render_end = ready,
                                  .sent = ready,
                                  .shading = ready - now},
                       .client = {.frame = number, .clock_error = 0}};
    rendering.push_back({ready, std::move(packets), number});
    ++rendered;
    return absl::OkStatus();
  }

  void send_rendered(TimeNs now) {
    Finished finished = std::move(rendering.front());
    rendering.pop_front();
    FrameRecord& record = records[finished.number];
    for (Packet& packet : finished.packets) {
      const uint64_t size = packet.bytes.size();
      (packet.channel == Channel::atlas ? record.atlas_bytes : record.meta_bytes) += size;
      if (started) bytes[static_cast<size_t>(packet.channel)] += size;
      in_flight[down.send(now, packet.channel, std::move(packet.bytes))] = finished.number;
    }
  }

  void note_shown(TimeNs now, FrameNumber frame) {
    FrameRecord record = records.at(frame);
    record.client.draw_begin = record.client.displayed = now;
    measured_round_trip = now - record.pose_sent;
    shown.push_back(record);
    std::erase_if(records, [&](const auto& entry) { return is_newer(frame, entry.first); });
  }

  std::optional<DisplayMoment> display(TimeNs now) {
    ++display_ticks;
    const std::optional<FrameNumber> frame = streamer.newest_frame();
    if (frame && !started) started = now;
    const bool fresh = frame && frame != current;
    if (fresh) note_shown(now, *frame);
    current = frame;

    const TimeNs on_path = display_path_time();
    const Pose pose = pose_on_path(on_path);
    up.send(now, Channel::meta, to_bytes({{now, pose}, measured_round_trip, streamer.wants_key_frame()}));
    if (!frame) return std::nullopt;
    DisplayMoment moment{
        .index = scored++, .now_ns = now, .path_time_ns = on_path, .frame = *frame, .fresh = fresh};
    moment.view = client_view(settings);
    moment.view.pose = pose;
    return moment;
  }

  StatusOr<std::optional<DisplayMoment>> step() {
    const auto [now, event] = next_event();
    if (!started && now > kPatience) {
      return absl::DeadlineExceededError(
          absl::StrCat(streamer.name(), ": no complete frame within 60 s of virtual time"));
    }
    switch (event) {
      case Event::delivery:
        TESSERA_RETURN_IF_ERROR(deliver(now));
        break;
      case Event::pose:
        receive_poses(now);
        break;
      case Event::rendered:
        send_rendered(now);
        break;
      case Event::serve:
        TESSERA_RETURN_IF_ERROR(serve(now));
        break;
      case Event::display:
        return display(now);
    }
    return std::nullopt;
  }
};

StreamSimulation::StreamSimulation(Streamer& streamer, const CameraPath& path,
                                   const LoopbackSettings& settings)
    : impl_(std::make_unique<Impl>(streamer, path, settings)) {}
StreamSimulation::~StreamSimulation() = default;

StatusOr<DisplayMoment> StreamSimulation::next_display() {
  while (true) {
    TESSERA_ASSIGN_OR_RETURN(std::optional<DisplayMoment> moment, impl_->step());
    if (moment) return *moment;
  }
}

const std::vector<FrameRecord>& StreamSimulation::shown_frames() const {
  return impl_->shown;
}
Pose StreamSimulation::pose_at(TimeNs now_ns) const {
  return impl_->pose_at(now_ns);
}
uint64_t StreamSimulation::frames_rendered() const {
  return impl_->rendered;
}
uint64_t StreamSimulation::frames_skipped() const {
  return impl_->skipped;
}

double StreamSimulation::megabits_per_second(Channel channel) const {
  const double seconds = static_cast<double>(impl_->scored) / impl_->settings.fps;
  return seconds > 0 ? 8e-6 * static_cast<double>(impl_->bytes[static_cast<size_t>(channel)]) / seconds : 0;
}

}  // namespace tessera::bench
