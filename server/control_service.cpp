#include "server/control_service.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "base/log.h"
#include "proto/frame_record.h"
#include "server/session.h"

namespace tessera::server {
namespace {

constexpr std::chrono::milliseconds kWatchInterval{50};  // of frame records

grpc::Status to_grpc(const Status& status) {
  // The codes have the same numbers.
  return {static_cast<grpc::StatusCode>(status.code()), std::string(status.message())};
}

template <class T>
Status set_checked(T& value, T otherwise, T low, T high, const char* field) {
  if (value == T{}) value = otherwise;
  if (value >= low && value <= high) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(field, ": is ", value, ", must be ", low, " to ", high));
}

}  // namespace

StatusOr<SessionSettings> session_settings(v1::SessionSettings& s) {
  uint32_t width = s.atlas_width(), height = s.atlas_height();
  double mbps = s.bitrate_mbps(), fps = s.frames_per_second();
  TESSERA_RETURN_IF_ERROR(set_checked(width, 2048u, 64u, 8192u, "settings.atlas_width"));
  TESSERA_RETURN_IF_ERROR(set_checked(height, 1024u, 64u, 8192u, "settings.atlas_height"));
  TESSERA_RETURN_IF_ERROR(set_checked(mbps, 20.0, 0.1, 1000.0, "settings.bitrate_mbps"));
  TESSERA_RETURN_IF_ERROR(set_checked(fps, 30.0, 1.0, 240.0, "settings.frames_per_second"));
  SessionSettings settings;
  settings.layout = atlas::blocks::settings_for(width, height);
  const uint32_t side = 1u << settings.layout.superblock_log;
  if (width % 8 || height % 8 || width % side || height % side) {
    return absl::InvalidArgumentError(absl::StrCat("settings: an atlas of ", width, "x", height,
                                                   " texels; both sides must be multiples of ",
                                                   std::max(side, 8u)));
  }
  settings.rate.bitrate_bps = mbps * 1e6;
  settings.rate.frames_per_second = fps;
  s.set_atlas_width(width);
  s.set_atlas_height(height);
  s.set_bitrate_mbps(mbps);
  s.set_frames_per_second(fps);
  return settings;
}

void ControlService::drain() {
  {
    const std::lock_guard lock(mutex_);
    draining_ = true;
  }
  drained_.notify_all();
}

Status ControlService::check_open() const {
  return draining_ ? absl::UnavailableError("the daemon is shutting down") : absl::OkStatus();
}

v1::Scene ControlService::describe(const SceneInfo& info) const {
  v1::Scene scene;
  scene.set_name(info.name);
  scene.set_source(info.source);
  scene.set_triangles(info.triangles);
  scene.set_materials(info.materials);
  scene.set_device_mib(info.device_mib);
  for (const std::string& note : info.notes) scene.add_notes(note);
  for (const PlannedPass& pass : info.plan.passes) {
    v1::Pass* out = scene.add_plan();
    out->set_name(pass.name);
    out->set_included(pass.included);
    out->set_reason(pass.reason);
  }
  const std::lock_guard lock(mutex_);
  for (const auto& [id, session] : known_)
    if (session.scene == info.name && server_.stats(id).ok()) scene.set_sessions(scene.sessions() + 1);
  return scene;
}

grpc::Status ControlService::LoadScene(grpc::ServerContext*, const v1::LoadSceneRequest* request,
                                       v1::Scene* scene) {
  if (const Status open = check_open(); !open.ok()) return to_grpc(open);
  const StatusOr<SceneInfo> info = scenes_.load(request->name(), request->source());
  if (!info.ok()) return to_grpc(info.status());
  *scene = describe(*info);
  return grpc::Status::OK;
}

grpc::Status ControlService::ListScenes(grpc::ServerContext*, const v1::ListScenesRequest*,
                                        v1::ListScenesResponse* response) {
  for (const SceneInfo& info : scenes_.list()) *response->add_scenes() = describe(info);
  return grpc::Status::OK;
}

grpc::Status ControlService::UnloadScene(grpc::ServerContext*, const v1::UnloadSceneRequest* request,
                                         v1::UnloadSceneResponse*) {
  return to_grpc(scenes_.unload(request->name()));
}

grpc::Status ControlService::CreateSession(grpc::ServerContext*, const v1::CreateSessionRequest* request,
                                           v1::Ticket* out) {
  if (const Status open = check_open(); !open.ok()) return to_grpc(open);
  Known known{request->scene(), request->settings()};
  const StatusOr<SessionSettings> settings = session_settings(known.settings);
  if (!settings.ok()) return to_grpc(settings.status());
  StatusOr<std::shared_ptr<SharedScene>> scene = scenes_.find(request->scene());
  if (!scene.ok()) return to_grpc(scene.status());
  const StatusOr<SessionTicket> ticket = server_.create_session(renders(*std::move(scene)), *settings);
  if (!ticket.ok()) return to_grpc(ticket.status());
  {
    const std::lock_guard lock(mutex_);
    known_[ticket->session] = std::move(known);
  }
  out->set_session(ticket->session);
  out->set_token(ticket->token.data(), ticket->token.size());
  out->set_meta_port(ticket->meta_port);
  out->set_media_port(ticket->media_port);
  spdlog::info("session {}: created for scene {}", ticket->session, request->scene());
  return grpc::Status::OK;
}

StatusOr<v1::Session> ControlService::describe(uint64_t id) {
  const StatusOr<StreamedSessionStats> stats = server_.stats(id);
  const std::lock_guard lock(mutex_);
  if (!stats.ok()) {
    known_.erase(id);
    return stats.status();
  }
  v1::Session session;
  session.set_session(id);
  if (const auto known = known_.find(id); known != known_.end()) {
    session.set_scene(known->second.scene);
    *session.mutable_settings() = known->second.settings;
  }
  session.set_connected(stats->connected);
  session.set_frames_sent(stats->frames_sent);
  session.set_frames_skipped(stats->frames_skipped);
  session.set_round_trip_ms(to_ms(stats->round_trip_ns));
  if (!stats->ended.ok()) session.set_last_client_end(std::string(stats->ended.message()));
  return session;
}

grpc::Status ControlService::GetSession(grpc::ServerContext*, const v1::GetSessionRequest* request,
                                        v1::Session* session) {
  StatusOr<v1::Session> found = describe(request->session());
  if (found.ok()) *session = *std::move(found);
  return to_grpc(found.status());
}

grpc::Status ControlService::ListSessions(grpc::ServerContext*, const v1::ListSessionsRequest*,
                                          v1::ListSessionsResponse* response) {
  std::vector<uint64_t> ids;
  {
    const std::lock_guard lock(mutex_);
    for (const auto& [id, known] : known_) ids.push_back(id);
  }
  for (const uint64_t id : ids) {
    StatusOr<v1::Session> session = describe(id);
    if (session.ok()) *response->add_sessions() = *std::move(session);
  }
  return grpc::Status::OK;
}

grpc::Status ControlService::DeleteSession(grpc::ServerContext*, const v1::DeleteSessionRequest* request,
                                           v1::DeleteSessionResponse*) {
  const Status ended = server_.end_session(request->session(), request->reason());
  const std::lock_guard lock(mutex_);
  known_.erase(request->session());
  return to_grpc(ended);
}

grpc::Status ControlService::WatchSession(grpc::ServerContext* context,
                                          const v1::WatchSessionRequest* request,
                                          grpc::ServerWriter<v1::Session>* writer) {
  uint32_t interval_ms = request->interval_ms();
  if (const Status fits = set_checked(interval_ms, 1000u, 10u, 60'000u, "interval_ms"); !fits.ok())
    return to_grpc(fits);
  while (!context->IsCancelled() && !draining_) {
    const StatusOr<v1::Session> session = describe(request->session());
    if (!session.ok()) return to_grpc(session.status());
    if (!writer->Write(*session)) break;
    wait(std::chrono::milliseconds(interval_ms));
  }
  return grpc::Status::OK;
}

void ControlService::wait(std::chrono::milliseconds time) {
  std::unique_lock lock(mutex_);
  drained_.wait_for(lock, time, [this] { return draining_.load(); });
}

grpc::Status ControlService::WatchFrames(grpc::ServerContext* context, const v1::WatchFramesRequest* request,
                                         grpc::ServerWriter<v1::FrameRecord>* writer) {
  uint64_t next = request->first();
  while (!context->IsCancelled() && !draining_) {
    const auto records = server_.records(request->session(), next, next);
    if (!records.ok()) return to_grpc(records.status());
    uint64_t index = next - records->size();
    for (const FrameRecord& record : *records) {
      v1::FrameRecord message;
      write(record, message);
      message.set_index(index++);
      if (!writer->Write(message)) return grpc::Status::OK;
    }
    if (request->once()) break;
    wait(kWatchInterval);
  }
  return grpc::Status::OK;
}

}  // namespace tessera::server
