#include "base/frame_trace.h"

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>
#include <string>

namespace tessera {
namespace {

struct ServerColumn {
  const char* name;
  TimeNs ServerFrameTimes::*value;
};
constexpr ServerColumn kServerColumns[] = {{"pose_received_ns", &ServerFrameTimes::pose_received},
                                           {"due_ns", &ServerFrameTimes::due},
                                           {"render_begin_ns", &ServerFrameTimes::render_begin},
                                           {"render_end_ns", &ServerFrameTimes::render_end},
                                           {"sent_ns", &ServerFrameTimes::sent},
                                           {"visibility_ns", &ServerFrameTimes::visibility},
                                           {"layout_ns", &ServerFrameTimes::layout},
                                           {"shading_ns", &ServerFrameTimes::shading},
                                           {"encode_ns", &ServerFrameTimes::encode}};

struct ClientColumn {
  const char* name;
  TimeNs ClientFrameTimes::*value;
};
constexpr ClientColumn kClientColumns[] = {{"atlas_first_packet_ns", &ClientFrameTimes::atlas_first_packet},
                                           {"atlas_complete_ns", &ClientFrameTimes::atlas_complete},
                                           {"atlas_decode_begin_ns", &ClientFrameTimes::atlas_decode_begin},
                                           {"atlas_decoded_ns", &ClientFrameTimes::atlas_decoded},
                                           {"meta_complete_ns", &ClientFrameTimes::meta_complete},
                                           {"meta_decode_begin_ns", &ClientFrameTimes::meta_decode_begin},
                                           {"meta_decoded_ns", &ClientFrameTimes::meta_decoded},
                                           {"draw_begin_ns", &ClientFrameTimes::draw_begin},
                                           {"displayed_ns", &ClientFrameTimes::displayed},
                                           {"clock_offset_ns", &ClientFrameTimes::clock_offset},
                                           {"clock_error_ns", &ClientFrameTimes::clock_error}};

// A track of a trace; its number orders the tracks.
enum class Track { network_up, server, network_atlas, network_meta, decode_atlas, decode_meta, client };
constexpr const char* kTrackNames[] = {
    "network: pose",        "server: frame",           "network: atlas",       "network: geometry",
    "client: decode atlas", "client: decode geometry", "client: wait and draw"};

class Trace {
 public:
  explicit Trace(TimeNs origin) : origin_(origin) {}

  void span(const FrameRecord& record, Track track, const std::string& name, TimeNs begin, TimeNs end) {
    events_.push_back({{"ph", "X"},
                       {"pid", record.session},
                       {"tid", static_cast<int>(track)},
                       {"name", name},
                       {"ts", 1e-3 * static_cast<double>(begin - origin_)},
                       {"dur", 1e-3 * static_cast<double>(std::max<DurationNs>(end - begin, 0))},
                       {"args", {{"frame", record.frame}, {"key_frame", record.key_frame}}}});
  }
  void name_tracks(uint64_t session) {
    name("process_name", session, 0, "session " + std::to_string(session));
    for (int track = 0; track < static_cast<int>(std::size(kTrackNames)); ++track)
      name("thread_name", session, track, kTrackNames[track]);
  }
  nlohmann::json take() { return {{"traceEvents", std::move(events_)}, {"displayTimeUnit", "ms"}}; }

 private:
  void name(const char* what, uint64_t session, int track, const std::string& value) {
    events_.push_back(
        {{"ph", "M"}, {"pid", session}, {"tid", track}, {"name", what}, {"args", {{"name", value}}}});
  }

  TimeNs origin_;
  nlohmann::json events_ = nlohmann::json::array();
};

void add_server(Trace& trace, const FrameRecord& r) {
  const ServerFrameTimes& s = r.server;
  TimeNs at = s.render_begin;
  trace.span(r, Track::server, "frame " + std::to_string(r.frame), s.render_begin, s.sent);
  for (const auto& [name, duration] : {std::pair("visibility", s.visibility),
                                       {"layout", s.layout},
                                       {"shading", s.shading},
                                       {"encode", s.encode}}) {
    trace.span(r, Track::server, name, at, at + duration);
    at += duration;
  }
}

void add_client(Trace& trace, const FrameRecord& r) {
  const ClientFrameTimes& c = r.client;
  if (c.clock_error < 0) return;
  const auto span = [&](Track track, const char* name, TimeNs begin, TimeNs end) {
    if (begin != 0 && end != 0) trace.span(r, track, name, begin + c.clock_offset, end + c.clock_offset);
  };
  span(Track::network_up, "pose", r.pose_sent, r.server.pose_received - c.clock_offset);
  span(Track::network_atlas, "atlas", r.server.sent - c.clock_offset, c.atlas_complete);
  span(Track::network_meta, "geometry", r.server.sent - c.clock_offset, c.meta_complete);
  span(Track::decode_atlas, "decode", c.atlas_decode_begin, c.atlas_decoded);
  span(Track::decode_meta, "decode", c.meta_decode_begin, c.meta_decoded);
  if (c.atlas_decoded && c.meta_decoded)
    span(Track::client, "wait", std::max(c.atlas_decoded, c.meta_decoded), c.draw_begin);
  span(Track::client, "draw", c.draw_begin, c.displayed);
}

TimeNs first_time(std::span<const FrameRecord> records) {
  TimeNs first = std::numeric_limits<TimeNs>::max();
  for (const FrameRecord& r : records)
    first = std::min({first, r.server.pose_received, r.pose_sent + r.client.clock_offset});
  return first;
}

}  // namespace

void write_csv(std::span<const FrameRecord> records, std::ostream& out) {
  out << "session,frame,key_frame,atlas_bytes,meta_bytes,scene_time_ns,pose_time_ns,pose_sent_ns";
  for (const ServerColumn& column : kServerColumns) out << ',' << column.name;
  for (const ClientColumn& column : kClientColumns) out << ',' << column.name;
  for (const auto& [name, duration] : FrameDurations().named()) out << ',' << name << "_ms";
  out << ",sum_ms,end_to_end_ms,overhead_ms\n";
  for (const FrameRecord& r : records) {
    out << r.session << ',' << r.frame << ',' << r.key_frame << ',' << r.atlas_bytes << ',' << r.meta_bytes
        << ',' << r.scene_time << ',' << r.pose_time << ',' << r.pose_sent;
    for (const ServerColumn& column : kServerColumns) out << ',' << r.server.*column.value;
    for (const ClientColumn& column : kClientColumns) out << ',' << r.client.*column.value;
    const auto d = durations(r);
    if (!d) {
      out << ",,,,,,,,,,,\n";
      continue;
    }
    for (const auto& [name, duration] : d->named()) out << ',' << to_ms(duration);
    out << ',' << to_ms(d->sum()) << ',' << to_ms(d->end_to_end) << ',' << to_ms(d->overhead) << '\n';
  }
}

void write_chrome_trace(std::span<const FrameRecord> records, std::ostream& out) {
  Trace trace(first_time(records));
  std::set<uint64_t> sessions;
  for (const FrameRecord& r : records) {
    if (sessions.insert(r.session).second) trace.name_tracks(r.session);
    add_server(trace, r);
    add_client(trace, r);
  }
  out << trace.take().dump() << '\n';
}

}  // namespace tessera
