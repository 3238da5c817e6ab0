// Any bytes as the requests of tessera.v1.Control, to the service with a stream server, without a device.
#include <google/protobuf/stubs/logging.h>

#include <cstdlib>
#include <memory>
#include <string>

#include "base/log.h"
#include "scene/procedural.h"
#include "server/control_service.h"
#include "tests/server/fake_renderer.h"
#include "transport/messages.h"

using namespace tessera;
using namespace tessera::server;

namespace {

void require(bool condition) {
  if (!condition) std::abort();
}

// Scenes need a device, so none is ever loaded; the session was made beside the service.
class Bench {
 public:
  Bench() {
    init_logging("off");
    google::protobuf::SetLogHandler(nullptr);
    service_.open();
    renew();
  }

  void feed(uint8_t call, const std::string& bytes) {
    switch (call % 8) {
      case 0:
        return load(bytes);
      case 1:
        return ask<v1::UnloadSceneRequest, v1::UnloadSceneResponse>(&ControlService::UnloadScene, bytes);
      case 2:
        return ask<v1::CreateSessionRequest, v1::Ticket>(&ControlService::CreateSession, bytes);
      case 3:
        return ask<v1::GetSessionRequest, v1::Session>(&ControlService::GetSession, bytes);
      case 4:
        return update(bytes);
      case 5:
        return remove(bytes);
      case 6:
        return settings(bytes);
      default:
        ask<v1::ListScenesRequest, v1::ListScenesResponse>(&ControlService::ListScenes, bytes);
        return ask<v1::ListSessionsRequest, v1::ListSessionsResponse>(&ControlService::ListSessions, bytes);
    }
  }

 private:
  template <class Request, class Response>
  using Call = grpc::Status (ControlService::*)(grpc::ServerContext*, const Request*, Response*);

  template <class Request>
  bool parse(const std::string& bytes, Request& request) {
    if (!request.ParseFromString(bytes)) return false;
    // Even ids stand for the session that there is.
    if constexpr (requires { request.session(); }) {
      if (request.session() % 2 == 0) request.set_session(session_);
    }
    return true;
  }
  template <class Request, class Response>
  void ask(Call<Request, Response> call, const std::string& bytes) {
    Request request;
    Response response;
    if (parse(bytes, request)) (void)(service_.*call)(nullptr, &request, &response);
  }

  void load(const std::string& bytes) {
    v1::LoadSceneRequest request;
    v1::Scene scene;
    if (!parse(bytes, request) || scene::is_procedural(request.source())) return;
    require(!service_.LoadScene(nullptr, &request, &scene).ok());  // there is no --scene-root
  }
  void update(const std::string& bytes) {
    v1::UpdateSessionRequest request;
    v1::Session session;
    if (!parse(bytes, request)) return;
    require(!service_.UpdateSession(nullptr, &request, &session).ok());  // the service made none
    v1::SessionSettings before, after;
    require(session_settings(before).ok());
    after = before;
    if (!updated_settings(after, request.settings()).ok()) {
      require(after.SerializeAsString() == before.SerializeAsString());
      return;
    }
    require(after.bitrate_mbps() >= 0.1 && after.bitrate_mbps() <= 1000);
    require(after.frames_per_second() >= 1 && after.frames_per_second() <= 240);
    require(after.atlas_width() == before.atlas_width() && after.atlas_height() == before.atlas_height());
  }
  void remove(const std::string& bytes) {
    v1::DeleteSessionRequest request;
    v1::DeleteSessionResponse response;
    if (!parse(bytes, request)) return;
    // Whatever the reason, the client must be able to read it.
    const auto told = transport::encode(transport::ErrorMessage{{}, request.reason()});
    require(transport::decode_error(told).ok());
    if (service_.DeleteSession(nullptr, &request, &response).ok()) renew();
  }
  // What was filled in is taken as it is.
  void settings(const std::string& bytes) {
    v1::SessionSettings wanted;
    if (!wanted.ParseFromString(bytes) || !session_settings(wanted).ok()) return;
    v1::SessionSettings applied = wanted;
    require(session_settings(applied).ok());
    require(applied.SerializeAsString() == wanted.SerializeAsString());
  }
  void renew() { session_ = server_->create_session(test::fake_renders(), test::small_session())->session; }

  const SteadyClock clock_;
  const std::unique_ptr<StreamServer> server_ = StreamServer::create({}, clock_).value();
  SceneLibrary scenes_{nullptr, *server_, "", 0};
  ControlService service_{*server_, scenes_, {}};
  uint64_t session_ = 0;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static Bench bench;
  if (size == 0) return 0;
  bench.feed(data[0], {reinterpret_cast<const char*>(data) + 1, size - 1});
  return 0;
}
