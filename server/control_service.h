// tessera.v1.Control over a StreamServer and its scenes (proto/tessera/v1/control.proto documents the calls).
#pragma once

#include <atomic>
#include <condition_variable>
#include <map>
#include <mutex>
#include <string>

#include "server/scene_library.h"
#include "server/stream_server.h"
#include "tessera/v1/control.grpc.pb.h"

namespace tessera::server {

// Thread-safe. Both outlive the service.
class ControlService final : public v1::Control::Service {
 public:
  ControlService(StreamServer& server, SceneLibrary& scenes) : server_(server), scenes_(scenes) {}

  // From now on nothing new is let in, and watchers are sent home.
  void drain();

  grpc::Status LoadScene(grpc::ServerContext*, const v1::LoadSceneRequest*, v1::Scene*) override;
  grpc::Status ListScenes(grpc::ServerContext*, const v1::ListScenesRequest*,
                          v1::ListScenesResponse*) override;
  grpc::Status UnloadScene(grpc::ServerContext*, const v1::UnloadSceneRequest*,
                           v1::UnloadSceneResponse*) override;
  grpc::Status CreateSession(grpc::ServerContext*, const v1::CreateSessionRequest*, v1::Ticket*) override;
  grpc::Status GetSession(grpc::ServerContext*, const v1::GetSessionRequest*, v1::Session*) override;
  grpc::Status ListSessions(grpc::ServerContext*, const v1::ListSessionsRequest*,
                            v1::ListSessionsResponse*) override;
  grpc::Status DeleteSession(grpc::ServerContext*, const v1::DeleteSessionRequest*,
                             v1::DeleteSessionResponse*) override;
  grpc::Status WatchSession(grpc::ServerContext*, const v1::WatchSessionRequest*,
                            grpc::ServerWriter<v1::Session>*) override;
  grpc::Status WatchFrames(grpc::ServerContext*, const v1::WatchFramesRequest*,
                           grpc::ServerWriter<v1::FrameRecord>*) override;

 private:
  struct Known {
    std::string scene;
    v1::SessionSettings settings;
  };
  Status check_open() const;
  v1::Scene describe(const SceneInfo& info) const;
  StatusOr<v1::Session> describe(uint64_t session);
  // Or until the daemon drains.
  void wait(std::chrono::milliseconds time);

  StreamServer& server_;
  SceneLibrary& scenes_;
  std::atomic<bool> draining_ = false;
  mutable std::mutex mutex_;
  std::condition_variable drained_;
  std::map<uint64_t, Known> known_;  // sessions that the server may have ended meanwhile
};

// Fills in defaults, checks ranges: InvalidArgument names the field.
StatusOr<SessionSettings> session_settings(v1::SessionSettings& settings);

}  // namespace tessera::server
