#include "server/control_service.h"

#include <google/protobuf/util/message_differencer.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_replace.h"
#include "base/log.h"
#include "proto/atlas_codec.h"
#include "proto/frame_record.h"
#include "server/session.h"
#include "transport/asio/endpoint.h"

namespace tessera::server {
namespace {

using google::protobuf::util::MessageDifferencer;

constexpr uint32_t kFramesIntervalMs = 50;  // of frame records

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

StatusOr<AtlasCodec> checked_codec(v1::SessionSettings& s, uint32_t width, uint32_t height) {
  constexpr uint64_t kMaxRawTexels = 2u << 20;  // a frame must fit into the network's queues
  if (s.codec() == v1::ATLAS_CODEC_UNSPECIFIED) s.set_codec(to_proto(AtlasCodec::h264));
  const std::optional<AtlasCodec> codec = from_proto(s.codec());
  if (!codec)
    return absl::InvalidArgumentError(
        absl::StrCat("settings.codec: is ", static_cast<int>(s.codec()), ", must be H264, JPEG or RAW"));
  if (codec == AtlasCodec::raw && uint64_t{width} * height > kMaxRawTexels)
    return absl::InvalidArgumentError(absl::StrCat("settings.codec: RAW takes an atlas of up to ",
                                                   kMaxRawTexels, " texels, not ", width, "x", height));
  return *codec;
}

// gRPC writes "ipv4:127.0.0.1:40000" or "ipv6:%5B::1%5D:40000".
StatusOr<transport::PeerAddress> caller_address(const std::string& peer, uint16_t port) {
  const std::string text = absl::StrReplaceAll(peer, {{"%5B", ""}, {"%5D", ""}, {"[", ""}, {"]", ""}});
  const size_t scheme = text.find(':'), end = text.rfind(':');
  const auto address = scheme < end ? transport::parse_address(text.substr(scheme + 1, end - scheme - 1))
                                    : absl::InvalidArgumentError(peer);
  if (!address.ok())
    return absl::FailedPreconditionError(
        absl::StrCat("call by IP: `", peer, "` has no address to forward to"));
  return transport::peer_address({*address, port});
}

Status read(const v1::Density& density, SessionSettings& settings) {
  constexpr int kMaxPriorities = 256;
  settings.density.foveation = static_cast<float>(density.foveation());
  settings.density.barrel = density.barrel_distortion();
  atlas::LevelSettings& levels = settings.layout.levels;
  if (density.has_bias()) {
    const auto bias = static_cast<float>(density.bias());
    if (!(bias >= levels.min_bias && bias <= levels.max_bias))
      return absl::InvalidArgumentError(absl::StrCat("settings.density.bias: is ", bias, ", must be ",
                                                     levels.min_bias, " to ", levels.max_bias));
    levels.min_bias = levels.max_bias = bias;
  }
  if (density.priorities_size() > kMaxPriorities)
    return absl::InvalidArgumentError(absl::StrCat("settings.density.priorities: ", density.priorities_size(),
                                                   " of them, the limit is ", kMaxPriorities));
  for (const v1::ObjectPriority& priority : density.priorities())
    settings.density.priorities.push_back({priority.node(), static_cast<float>(priority.density())});
  return absl::OkStatus();
}

// Writes the default into `s`.
StatusOr<atlas::LayoutKind> layout_kind(v1::SessionSettings& s) {
  switch (s.layout()) {
    case v1::LAYOUT_UNSPECIFIED:
      static_assert(atlas::kDefaultLayout == atlas::LayoutKind::coherent);
      s.set_layout(v1::LAYOUT_COHERENT);
      return atlas::kDefaultLayout;
    case v1::LAYOUT_BLOCKS:
      return atlas::LayoutKind::blocks;
    case v1::LAYOUT_COHERENT:
      return atlas::LayoutKind::coherent;
    case v1::LAYOUT_TESSELLATED:
      return atlas::LayoutKind::tessellated;
    default:
      return absl::InvalidArgumentError(
          absl::StrCat("settings.layout: ", static_cast<int>(s.layout()), " is none that this server knows"));
  }
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
  TESSERA_ASSIGN_OR_RETURN(const atlas::LayoutKind kind, layout_kind(s));
  settings.layout = atlas::layout_settings(kind, width, height);
  const uint32_t side = kind == atlas::LayoutKind::blocks ? 1u << settings.layout.superblock_log : 2;
  if (width % 8 || height % 8 || width % side || height % side) {
    return absl::InvalidArgumentError(absl::StrCat("settings: an atlas of ", width, "x", height,
                                                   " texels; both sides must be multiples of ",
                                                   std::max(side, 8u)));
  }
  TESSERA_RETURN_IF_ERROR(read(s.density(), settings));
  TESSERA_ASSIGN_OR_RETURN(settings.codec, checked_codec(s, width, height));
  settings.rate.bitrate_bps = mbps * 1e6;
  settings.rate.frames_per_second = fps;
  s.set_atlas_width(width);
  s.set_atlas_height(height);
  s.set_bitrate_mbps(mbps);
  s.set_frames_per_second(fps);
  return settings;
}

// A call that stays open takes a thread.
class ControlService::Watcher {
 public:
  static StatusOr<std::unique_ptr<Watcher>> admit(ControlService& service) {
    const std::lock_guard lock(service.mutex_);
    const uint32_t limit = service.info_.limits().max_watchers();
    if (service.watchers_ >= limit)
      return absl::ResourceExhaustedError(
          absl::StrCat(limit, " calls watch or forward already; end one or raise --max-watchers"));
    ++service.watchers_;
    return std::unique_ptr<Watcher>(new Watcher(service));
  }
  ~Watcher() {
    const std::lock_guard lock(service_.mutex_);
    --service_.watchers_;
  }

 private:
  explicit Watcher(ControlService& service) : service_(service) {}
  ControlService& service_;
};

void ControlService::open() {
  state_ = State::open;
}

StatusOr<SessionSettings> updated_settings(v1::SessionSettings& current, const v1::SessionSettings& wanted) {
  v1::SessionSettings merged = current, changes = wanted;
  if (wanted.has_density() && !MessageDifferencer::Equals(wanted.density(), current.density()))
    return absl::FailedPreconditionError(
        "settings.density: a session keeps its own; create a session with another one and move the client to "
        "it");
  changes.clear_density();
  merged.MergeFrom(changes);  // what is 0 stays
  TESSERA_ASSIGN_OR_RETURN(const SessionSettings settings, session_settings(merged));
  if (merged.atlas_width() != current.atlas_width() || merged.atlas_height() != current.atlas_height())
    return absl::FailedPreconditionError(absl::StrCat(
        "settings: a session's atlas keeps its ", current.atlas_width(), "x", current.atlas_height(),
        " texels; create a session with another one and move the client to it"));
  if (merged.layout() != current.layout())
    return absl::FailedPreconditionError(
        "settings.layout: a session keeps its own; create a session with another one and move the client to "
        "it");
  if (merged.codec() != current.codec())
    return absl::FailedPreconditionError(
        absl::StrCat("settings.codec: a session keeps its ", v1::AtlasCodec_Name(current.codec()),
                     "; create a session with another one and move the client to it"));
  current = std::move(merged);
  return settings;
}

void ControlService::drain() {
  {
    const std::lock_guard lock(mutex_);
    state_ = State::draining;
  }
  drained_.notify_all();
}

Status ControlService::check_open() const {
  switch (state_.load()) {
    case State::starting:
      return absl::UnavailableError("the daemon is still loading its scenes; try again");
    case State::draining:
      return absl::UnavailableError("the daemon is shutting down");
    case State::open:
      break;
  }
  return absl::OkStatus();
}

bool ControlService::wait(uint32_t ms) {
  std::unique_lock lock(mutex_);
  return !drained_.wait_for(lock, std::chrono::milliseconds(ms),
                            [this] { return state_ == State::draining; });
}

grpc::Status ControlService::answer(const char* call, const Status& status) {
  if (status.ok()) return grpc::Status::OK;
  const grpc::Status out = to_grpc(status);
  count_refusal(call, out.error_code());
  return out;
}

void ControlService::count_refusal(const char* call, grpc::StatusCode code) {
  const std::lock_guard lock(mutex_);
  ++refusals_[{call, code}];
}

ControlService::Refusals ControlService::refusals() const {
  const std::lock_guard lock(mutex_);
  return refusals_;
}

grpc::Status ControlService::GetServerInfo(grpc::ServerContext*, const v1::GetServerInfoRequest*,
                                           v1::ServerInfo* info) {
  *info = info_;
  return grpc::Status::OK;
}

v1::Scene ControlService::describe(const SceneInfo& info) const {
  v1::Scene scene;
  scene.set_name(info.name);
  scene.set_source(info.source);
  scene.set_triangles(info.triangles);
  scene.set_materials(info.materials);
  scene.set_device_mib(info.device_mib);
  v1::Box* box = scene.mutable_bounds();
  box->set_min_x(info.bounds.min.x);
  box->set_min_y(info.bounds.min.y);
  box->set_min_z(info.bounds.min.z);
  box->set_max_x(info.bounds.max.x);
  box->set_max_y(info.bounds.max.y);
  box->set_max_z(info.bounds.max.z);
  for (const std::string& note : info.notes) scene.add_notes(note);
  for (const PlannedPass& pass : info.plan.passes) {
    v1::Pass* out = scene.add_plan();
    out->set_name(pass.name);
    out->set_included(pass.included);
    out->set_reason(pass.reason);
  }
  const std::lock_guard lock(mutex_);
  for (const auto& [id, session] : known_)
    if (session.scene == info.name && server_.has(id)) scene.set_sessions(scene.sessions() + 1);
  return scene;
}

grpc::Status ControlService::LoadScene(grpc::ServerContext*, const v1::LoadSceneRequest* request,
                                       v1::Scene* scene) {
  if (const Status open = check_open(); !open.ok()) return answer("LoadScene", open);
  const StatusOr<SceneInfo> info = scenes_.load(request->name(), request->source());
  if (!info.ok()) return answer("LoadScene", info.status());
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
  return answer("UnloadScene", scenes_.unload(request->name()));
}

grpc::Status ControlService::CreateSession(grpc::ServerContext*, const v1::CreateSessionRequest* request,
                                           v1::Ticket* out) {
  if (const Status open = check_open(); !open.ok()) return answer("CreateSession", open);
  Known known{request->scene(), request->settings()};
  const StatusOr<SessionSettings> settings = session_settings(known.settings);
  if (!settings.ok()) return answer("CreateSession", settings.status());
  StatusOr<std::shared_ptr<SharedScene>> scene = scenes_.find(request->scene());
  if (!scene.ok()) return answer("CreateSession", scene.status());
  const Status fits = atlas::Density::check((*scene)->scene(), settings->density);
  if (!fits.ok()) return answer("CreateSession", fits);
  const StatusOr<SessionTicket> ticket = server_.create_session(renders(*std::move(scene)), *settings);
  if (!ticket.ok()) return answer("CreateSession", ticket.status());
  {
    const std::lock_guard lock(mutex_);
    std::erase_if(known_, [this](const auto& entry) { return !server_.has(entry.first); });
    known_[ticket->session] = std::move(known);
  }
  out->set_session(ticket->session);
  out->set_token(ticket->token.data(), ticket->token.size());
  out->set_meta_port(ticket->meta_port);
  out->set_media_port(ticket->media_port);
  log_event(spdlog::level::info, "session created",
            {{"session", ticket->session}, {"scene", request->scene()}});
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
  session.set_key_frames(stats->key_frames);
  session.set_bitrate_mbps(stats->bitrate_bps / 1e6);
  session.set_packets_sent(stats->media.packets);
  session.set_packets_retransmitted(stats->media.retransmitted);
  if (stats->peer) {
    session.set_loss(stats->peer->loss);
    session.set_jitter_ms(to_ms(stats->peer->jitter_ns));
  }
  session.set_encoder(stats->encoder);
  session.set_round_trip_ms(to_ms(stats->round_trip_ns));
  v1::AtlasUse& atlas = *session.mutable_atlas();
  atlas.set_used(stats->share(stats->layout.used_texels));
  atlas.set_fragmented(stats->share(stats->layout.fragmented_texels));
  atlas.set_bias(stats->layout.bias);
  atlas.set_without_place(stats->layout.colors_out_of_memory);
  if (!stats->ended.ok()) session.set_last_client_end(std::string(stats->ended.message()));
  return session;
}

grpc::Status ControlService::GetSession(grpc::ServerContext*, const v1::GetSessionRequest* request,
                                        v1::Session* session) {
  StatusOr<v1::Session> found = describe(request->session());
  if (found.ok()) *session = *std::move(found);
  return answer("GetSession", found.status());
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

Status ControlService::update(uint64_t session, const v1::SessionSettings& wanted) {
  const std::lock_guard one_at_a_time(updating_);
  v1::SessionSettings merged;
  {
    const std::lock_guard lock(mutex_);
    const auto known = known_.find(session);
    if (known == known_.end()) return absl::NotFoundError(absl::StrCat("there is no session ", session));
    merged = known->second.settings;
  }
  TESSERA_ASSIGN_OR_RETURN(const SessionSettings settings, updated_settings(merged, wanted));
  TESSERA_RETURN_IF_ERROR(
      server_.set_rate(session, settings.rate.bitrate_bps, settings.rate.frames_per_second));
  log_event(spdlog::level::info, "session updated",
            {{"session", session},
             {"bitrate_mbps", merged.bitrate_mbps()},
             {"frames_per_second", merged.frames_per_second()}});
  const std::lock_guard lock(mutex_);
  if (const auto known = known_.find(session); known != known_.end()) known->second.settings = merged;
  return absl::OkStatus();
}

grpc::Status ControlService::UpdateSession(grpc::ServerContext*, const v1::UpdateSessionRequest* request,
                                           v1::Session* session) {
  if (const Status updated = update(request->session(), request->settings()); !updated.ok())
    return answer("UpdateSession", updated);
  StatusOr<v1::Session> found = describe(request->session());
  if (found.ok()) *session = *std::move(found);
  return answer("UpdateSession", found.status());
}

grpc::Status ControlService::DeleteSession(grpc::ServerContext*, const v1::DeleteSessionRequest* request,
                                           v1::DeleteSessionResponse*) {
  const Status ended = server_.end_session(request->session(), request->reason());
  {
    const std::lock_guard lock(mutex_);
    known_.erase(request->session());
  }
  return answer("DeleteSession", ended);
}

Status ControlService::watch(grpc::ServerContext* context, const v1::WatchSessionRequest& request,
                             grpc::ServerWriter<v1::Session>& writer) {
  uint32_t interval_ms = request.interval_ms();
  TESSERA_RETURN_IF_ERROR(set_checked(interval_ms, 1000u, 10u, 60'000u, "interval_ms"));
  TESSERA_ASSIGN_OR_RETURN(const auto watcher, Watcher::admit(*this));
  do {
    TESSERA_ASSIGN_OR_RETURN(const v1::Session session, describe(request.session()));
    if (!writer.Write(session)) break;
  } while (wait(interval_ms) && !context->IsCancelled());
  return absl::OkStatus();
}

grpc::Status ControlService::WatchSession(grpc::ServerContext* context,
                                          const v1::WatchSessionRequest* request,
                                          grpc::ServerWriter<v1::Session>* writer) {
  return answer("WatchSession", watch(context, *request, *writer));
}

Status ControlService::watch_frames(grpc::ServerContext* context, const v1::WatchFramesRequest& request,
                                    grpc::ServerWriter<v1::FrameRecord>& writer) {
  TESSERA_ASSIGN_OR_RETURN(const auto watcher, Watcher::admit(*this));
  uint64_t next = request.first();
  do {
    TESSERA_ASSIGN_OR_RETURN(const std::vector<FrameRecord> records,
                             server_.records(request.session(), next, next));
    uint64_t index = next - records.size();
    for (const FrameRecord& record : records) {
      v1::FrameRecord message;
      write(record, message);
      message.set_index(index++);
      if (!writer.Write(message)) return absl::OkStatus();
    }
  } while (!request.once() && wait(kFramesIntervalMs) && !context->IsCancelled());
  return absl::OkStatus();
}

grpc::Status ControlService::WatchFrames(grpc::ServerContext* context, const v1::WatchFramesRequest* request,
                                         grpc::ServerWriter<v1::FrameRecord>* writer) {
  return answer("WatchFrames", watch_frames(context, *request, *writer));
}

// To nowhere but the caller's own address: else whoever reaches this port could flood any other.
Status ControlService::forward(grpc::ServerContext* context, const v1::ForwardStreamRequest& request,
                               grpc::ServerWriter<v1::Forwarding>& writer) {
  constexpr uint32_t kIntervalMs = 1000;
  if (request.port() < 1024 || request.port() > 65535)
    return absl::InvalidArgumentError(absl::StrCat("port: is ", request.port(), ", must be 1024 to 65535"));
  TESSERA_ASSIGN_OR_RETURN(const transport::PeerAddress to,
                           caller_address(context->peer(), static_cast<uint16_t>(request.port())));
  TESSERA_ASSIGN_OR_RETURN(const auto watcher, Watcher::admit(*this));
  TESSERA_ASSIGN_OR_RETURN(const Forwarding forwarding, server_.forward(request.session(), to));
  const absl::Cleanup end = [&] { server_.end_forward(forwarding); };
  log_event(spdlog::level::info, "stream forwarded",
            {{"session", request.session()}, {"to", transport::to_string(to)}, {"port", to.port}});
  v1::Forwarding message;
  message.set_sdp(forwarding.sdp);
  do {
    TESSERA_ASSIGN_OR_RETURN(const uint64_t packets, server_.forwarded_packets(forwarding));
    message.set_packets(packets);
    if (!writer.Write(message)) break;
    message.clear_sdp();
  } while (wait(kIntervalMs) && !context->IsCancelled());
  return absl::OkStatus();
}

grpc::Status ControlService::ForwardStream(grpc::ServerContext* context,
                                           const v1::ForwardStreamRequest* request,
                                           grpc::ServerWriter<v1::Forwarding>* writer) {
  return answer("ForwardStream", forward(context, *request, *writer));
}

}  // namespace tessera::server
