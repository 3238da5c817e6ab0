// tessera.v1.Control over a StreamServer and its scenes (proto/tessera/v1/control.proto documents the calls).
#pragma once

#include <atomic>
#include <condition_variable>
#include <map>
#include <mutex>
#include <string>
#include <utility>

#include "server/scene_library.h"
#include "server/stream_server.h"
#include "tessera/v1/control.grpc.pb.h"

namespace tessera::server {

// Thread-safe. Both outlive the service.
class ControlService final : public v1::Control::Service {
 public:
  // `info` is what GetServerInfo answers; its max_watchers holds here.
  ControlService(StreamServer& server, SceneLibrary& scenes, v1::ServerInfo info)
      : server_(server), scenes_(scenes), info_(std::move(info)) {}

  // From the call to the end: UNAVAILABLE before.
  void open();
  // From now on nothing new is let in, and watchers are sent home.
  void drain();

  // Calls that were refused, by name and code.
  using Refusals = std::map<std::pair<std::string, grpc::StatusCode>, uint64_t>;
  Refusals refusals() const;
  // Of a call that did not get as far as this service, too.
  void count_refusal(const char* call, grpc::StatusCode code);

  grpc::Status GetServerInfo(grpc::ServerContext*, const v1::GetServerInfoRequest*, v1::ServerInfo*) override;
  grpc::Status LoadScene(grpc::ServerContext*, const v1::LoadSceneRequest*, v1::Scene*) override;
  grpc::Status ListScenes(grpc::ServerContext*, const v1::ListScenesRequest*,
                          v1::ListScenesResponse*) override;
  grpc::Status UnloadScene(grpc::ServerContext*, const v1::UnloadSceneRequest*,
                           v1::UnloadSceneResponse*) override;
  grpc::Status CreateSession(grpc::ServerContext*, const v1::CreateSessionRequest*, v1::Ticket*) override;
  grpc::Status GetSession(grpc::ServerContext*, const v1::GetSessionRequest*, v1::Session*) override;
  grpc::Status ListSessions(grpc::ServerContext*, const v1::ListSessionsRequest*,
                            v1::ListSessionsResponse*) override;
  grpc::Status UpdateSession(grpc::ServerContext*, const v1::UpdateSessionRequest*, v1::Session*) override;
  grpc::Status DeleteSession(grpc::ServerContext*, const v1::DeleteSessionRequest*,
                             v1::DeleteSessionResponse*) override;
  grpc::Status WatchSession(grpc::ServerContext*, const v1::WatchSessionRequest*,
                            grpc::ServerWriter<v1::Session>*) override;
  grpc::Status WatchFrames(grpc::ServerContext*, const v1::WatchFramesRequest*,
                           grpc::ServerWriter<v1::FrameRecord>*) override;
  grpc::Status ForwardStream(grpc::ServerContext*, const v1::ForwardStreamRequest*,
                             grpc::ServerWriter<v1::Forwarding>*) override;

 private:
  struct Known {
    std::string scene;
    v1::SessionSettings settings;
  };
  class Watcher;
  // What a call answers: counts refusals.
  grpc::Status answer(const char* call, const Status& status);
  Status check_open() const;
  Status update(uint64_t session, const v1::SessionSettings& wanted);
  Status watch(grpc::ServerContext* context, const v1::WatchSessionRequest& request,
               grpc::ServerWriter<v1::Session>& writer);
  Status watch_frames(grpc::ServerContext* context, const v1::WatchFramesRequest& request,
                      grpc::ServerWriter<v1::FrameRecord>& writer);
  Status forward(grpc::ServerContext* context, const v1::ForwardStreamRequest& request,
                 grpc::ServerWriter<v1::Forwarding>& writer);
  // False: the daemon drains.
  bool wait(uint32_t ms);
  v1::Scene describe(const SceneInfo& info) const;
  StatusOr<v1::Session> describe(uint64_t session);

  StreamServer& server_;
  SceneLibrary& scenes_;
  const v1::ServerInfo info_;
  enum class State { starting, open, draining };
  std::atomic<State> state_ = State::starting;
  std::mutex updating_;  // taken before mutex_
  mutable std::mutex mutex_;
  std::condition_variable drained_;
  uint32_t watchers_ = 0;
  Refusals refusals_;
  std::map<uint64_t, Known> known_;  // sessions that the server may have ended meanwhile
};

// Fills in defaults, checks ranges: InvalidArgument names the field.
StatusOr<SessionSettings> session_settings(v1::SessionSettings& settings);
// What `wanted` names replaces what is in `current`, or nothing does: InvalidArgument as above;
// FailedPrecondition: another atlas.
StatusOr<SessionSettings> updated_settings(v1::SessionSettings& current, const v1::SessionSettings& wanted);

}  // namespace tessera::server
