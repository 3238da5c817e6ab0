#include "client-sdk/tools/controlled_session.h"

#include <absl/strings/match.h>
#include <absl/strings/strip.h>
#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <sstream>
#include <thread>

#include "client-sdk/tools/made_ticket.h"
#include "proto/atlas_codec.h"
#include "proto/control_access.h"
#include "transport/asio/endpoint.h"

namespace tessera::client {
namespace {

constexpr std::chrono::seconds kCallTimeout{10};

void limit(grpc::ClientContext& context) {
  context.set_deadline(std::chrono::system_clock::now() + kCallTimeout);
}

// A daemon that was started a moment ago does not listen yet; then it loads its scenes, which may take a
// minute. "No such file": gRPC 1.51 allocates memory before it looks at errno, so that it can give up a
// connection in progress for what malloc left there where /sys is not mounted (seen once in 150 times).
bool is_starting(const Status& status) {
  const auto says = [&](const char* text) { return absl::StrContains(status.message(), text); };
  return absl::IsUnavailable(status) &&
         (says("Connection refused") || says("No such file or directory") || says("still loading"));
}

Status create_session(v1::Control::Stub& control, const std::string& scene, const v1::SessionSettings& wanted,
                      v1::Ticket& ticket) {
  constexpr std::chrono::milliseconds kRetryInterval{250};
  constexpr std::chrono::seconds kLoadTime{120};
  const auto start = std::chrono::steady_clock::now();
  v1::CreateSessionRequest request;
  request.set_scene(scene);
  *request.mutable_settings() = wanted;
  while (true) {
    grpc::ClientContext context;
    limit(context);
    const Status status = to_status(control.CreateSession(&context, request, &ticket), "CreateSession");
    if (!is_starting(status)) return status;
    const bool listens = absl::StrContains(status.message(), "still loading");
    if (std::chrono::steady_clock::now() - start > (listens ? kLoadTime : kCallTimeout))
      return listens ? status
                     : absl::UnavailableError(absl::StrCat(status.message(), "; does tesserad run?"));
    std::this_thread::sleep_for(kRetryInterval);
  }
}

StatusOr<std::shared_ptr<grpc::ChannelCredentials>> credentials(const ControlSettings& settings) {
  if (!settings.authority_file) return grpc::InsecureChannelCredentials();
  grpc::SslCredentialsOptions options;
  if (!settings.authority_file->empty()) {
    std::stringstream pem;
    pem << std::ifstream(*settings.authority_file).rdbuf();
    options.pem_root_certs = pem.str();
    if (options.pem_root_certs.empty())
      return absl::InvalidArgumentError(absl::StrCat("--ca ", *settings.authority_file, ": cannot read it"));
  }
  return grpc::SslCredentials(options);
}

std::string host_of(absl::string_view endpoint) {
  absl::string_view host = endpoint.substr(0, endpoint.rfind(':'));
  if (absl::ConsumePrefix(&host, "[")) absl::ConsumeSuffix(&host, "]");
  return std::string(host);
}

bool is_loopback(const std::string& host) {
  const auto address = transport::parse_address(host);
  return host == "localhost" || (address.ok() && address->is_loopback());
}

// Empty: there is none.
StatusOr<std::string> token(const ControlSettings& settings) {
  if (settings.token_file.empty()) return std::string();
  StatusOr<std::string> token = read_control_token(settings.token_file);
  if (!token.ok())
    return absl::InvalidArgumentError(absl::StrCat("--control-token-file: ", token.status().message()));
  if (!settings.authority_file && !settings.insecure && !is_loopback(host_of(settings.endpoint)))
    return absl::InvalidArgumentError(absl::StrCat("the control token would go to ", settings.endpoint,
                                                   " in clear text: give --ca, or say --insecure"));
  return token;
}

}  // namespace

StatusOr<std::unique_ptr<ControlledSession>> ControlledSession::create(const ControlSettings& settings,
                                                                       const std::string& scene,
                                                                       const v1::SessionSettings& wanted) {
  TESSERA_ASSIGN_OR_RETURN(const auto channel_credentials, credentials(settings));
  std::unique_ptr<ControlledSession> session(new ControlledSession);
  TESSERA_ASSIGN_OR_RETURN(const std::string control_token, token(settings));
  session->stub_ =
      v1::Control::NewStub(control_channel(settings.endpoint, channel_credentials, control_token));
  v1::Ticket made;
  if (const Status status = create_session(*session->stub_, scene, wanted, made); !status.ok())
    return absl::Status(status.code(),
                        absl::StrCat("control at ", settings.endpoint, ": ", status.message()));
  session->id_ = made.session();
  session->scene_ = scene;
  TESSERA_ASSIGN_OR_RETURN(session->ticket_, ticket_of(made, host_of(settings.endpoint)));
  session->ticket_.authority_file = settings.authority_file;
  return session;
}

StatusOr<v1::Box> ControlledSession::bounds() {
  grpc::ClientContext context;
  limit(context);
  v1::ListScenesResponse scenes;
  TESSERA_RETURN_IF_ERROR(to_status(stub_->ListScenes(&context, {}, &scenes), "ListScenes"));
  for (const v1::Scene& scene : scenes.scenes())
    if (scene.name() == scene_) return scene.bounds();
  return absl::NotFoundError(absl::StrCat("the daemon holds no scene ", scene_, " any more"));
}

void ControlledSession::record_frames() {
  reader_ = std::make_unique<FrameReader>(*stub_, id_);
}

StatusOr<std::vector<FrameRecord>> ControlledSession::frames(std::optional<FrameNumber> last) {
  if (!reader_) return std::vector<FrameRecord>();
  return reader_->finish(last);
}

ControlledSession::~ControlledSession() {
  if (id_ == 0 || kept_) return;
  grpc::ClientContext context;
  limit(context);
  v1::DeleteSessionRequest request;
  request.set_session(id_);
  v1::DeleteSessionResponse response;
  stub_->DeleteSession(&context, request, &response);
}

}  // namespace tessera::client
