#include "base/frame_record.h"

#include <algorithm>

namespace tessera {

DurationNs FrameDurations::sum() const {
  return pose_uplink + server_wait + server_render + downlink + (atlas_last ? decode_atlas : decode_meta) +
         client_wait + display;
}

std::array<std::pair<std::string_view, DurationNs>, 8> FrameDurations::named() const {
  return {{{"pose_uplink", pose_uplink},
           {"server_wait", server_wait},
           {"server_render", server_render},
           {"downlink", downlink},
           {"decode_atlas", decode_atlas},
           {"decode_meta", decode_meta},
           {"client_wait", client_wait},
           {"display", display}}};
}

std::optional<FrameDurations> durations(const FrameRecord& record) {
  const ServerFrameTimes& s = record.server;
  const ClientFrameTimes& c = record.client;
  if (!c.displayed || !c.atlas_decoded || !c.meta_decoded || c.clock_error < 0) return std::nullopt;
  FrameDurations d;
  d.atlas_last = c.atlas_decoded >= c.meta_decoded;
  const TimeNs complete = d.atlas_last ? c.atlas_complete : c.meta_complete;
  const TimeNs decode_begin = d.atlas_last ? c.atlas_decode_begin : c.meta_decode_begin;
  const TimeNs decoded = d.atlas_last ? c.atlas_decoded : c.meta_decoded;

  d.pose_uplink = s.pose_received - (record.pose_sent + c.clock_offset);
  d.server_wait = s.render_begin - s.pose_received;
  d.server_render = s.stages();
  d.downlink = complete + c.clock_offset - s.render_end;
  d.decode_atlas = c.atlas_decoded - c.atlas_complete;
  d.decode_meta = c.meta_decoded - c.meta_complete;
  d.client_wait = c.draw_begin - decoded;
  d.display = c.displayed - c.draw_begin;
  d.end_to_end = c.displayed - record.pose_sent;

  const DurationNs late = s.render_begin - std::max(s.due, s.pose_received);
  d.overhead = std::max<DurationNs>(late, 0) + (s.render_end - s.render_begin - s.stages()) +
               (s.sent - s.render_end) + (decode_begin - complete);
  return d;
}

}  // namespace tessera
