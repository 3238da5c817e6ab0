#include "proto/frame_record.h"

namespace tessera {
namespace {

void write(const ServerFrameTimes& s, v1::ServerFrameTimes& server) {
  server.set_pose_received_ns(s.pose_received);
  server.set_due_ns(s.due);
  server.set_render_begin_ns(s.render_begin);
  server.set_render_end_ns(s.render_end);
  server.set_sent_ns(s.sent);
  server.set_visibility_ns(s.visibility);
  server.set_layout_ns(s.layout);
  server.set_shading_ns(s.shading);
  server.set_encode_ns(s.encode);
}

void write(const ClientFrameTimes& c, v1::ClientFrameTimes& client) {
  client.set_atlas_first_packet_ns(c.atlas_first_packet);
  client.set_atlas_complete_ns(c.atlas_complete);
  client.set_atlas_decode_begin_ns(c.atlas_decode_begin);
  client.set_atlas_decoded_ns(c.atlas_decoded);
  client.set_meta_complete_ns(c.meta_complete);
  client.set_meta_decode_begin_ns(c.meta_decode_begin);
  client.set_meta_decoded_ns(c.meta_decoded);
  client.set_draw_begin_ns(c.draw_begin);
  client.set_displayed_ns(c.displayed);
  client.set_clock_offset_ns(c.clock_offset);
  client.set_clock_error_ns(c.clock_error);
}

ServerFrameTimes read(const v1::ServerFrameTimes& server) {
  ServerFrameTimes s;
  s.pose_received = server.pose_received_ns();
  s.due = server.due_ns();
  s.render_begin = server.render_begin_ns();
  s.render_end = server.render_end_ns();
  s.sent = server.sent_ns();
  s.visibility = server.visibility_ns();
  s.layout = server.layout_ns();
  s.shading = server.shading_ns();
  s.encode = server.encode_ns();
  return s;
}

ClientFrameTimes read(const v1::ClientFrameTimes& client) {
  ClientFrameTimes c;
  c.atlas_first_packet = client.atlas_first_packet_ns();
  c.atlas_complete = client.atlas_complete_ns();
  c.atlas_decode_begin = client.atlas_decode_begin_ns();
  c.atlas_decoded = client.atlas_decoded_ns();
  c.meta_complete = client.meta_complete_ns();
  c.meta_decode_begin = client.meta_decode_begin_ns();
  c.meta_decoded = client.meta_decoded_ns();
  c.draw_begin = client.draw_begin_ns();
  c.displayed = client.displayed_ns();
  c.clock_offset = client.clock_offset_ns();
  c.clock_error = client.clock_error_ns();
  return c;
}

}  // namespace

void write(const FrameRecord& record, v1::FrameRecord& out) {
  out.set_session(record.session);
  out.set_frame(record.frame);
  out.set_key_frame(record.key_frame);
  out.set_atlas_bytes(record.atlas_bytes);
  out.set_meta_bytes(record.meta_bytes);
  out.set_scene_time_ns(record.scene_time);
  out.set_pose_time_ns(record.pose_time);
  out.set_pose_sent_ns(record.pose_sent);
  write(record.server, *out.mutable_server());
  write(record.client, *out.mutable_client());
}

FrameRecord read(const v1::FrameRecord& message) {
  FrameRecord record;
  record.session = message.session();
  record.frame = message.frame();
  record.key_frame = message.key_frame();
  record.atlas_bytes = message.atlas_bytes();
  record.meta_bytes = message.meta_bytes();
  record.scene_time = message.scene_time_ns();
  record.pose_time = message.pose_time_ns();
  record.pose_sent = message.pose_sent_ns();
  record.server = read(message.server());
  record.client = read(message.client());
  record.client.frame = record.frame;
  return record;
}

}  // namespace tessera
