#include "server/daemon.h"

#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/grpcpp.h>
#include <grpcpp/health_check_service_interface.h>

#include <chrono>
#include <fstream>
#include <iterator>
#include <utility>

#include "base/log.h"
#include "server/control_service.h"
#include "transport/asio/endpoint.h"

namespace tessera::server {
namespace {

constexpr std::chrono::seconds kDrainTime{2};  // for calls under way

StatusOr<std::string> read_text(const std::string& file) {
  std::ifstream in(file);
  if (!in) return absl::InvalidArgumentError(absl::StrCat("cannot read ", file));
  return std::string(std::istreambuf_iterator<char>(in), {});
}

StatusOr<std::shared_ptr<grpc::ServerCredentials>> credentials(const DaemonSettings& settings) {
  if (settings.tls_certificate.empty()) return grpc::InsecureServerCredentials();
  TESSERA_ASSIGN_OR_RETURN(const std::string certificate, read_text(settings.tls_certificate));
  TESSERA_ASSIGN_OR_RETURN(const std::string key, read_text(settings.tls_key));
  grpc::SslServerCredentialsOptions options;
  options.pem_key_cert_pairs.push_back({key, certificate});
  return grpc::SslServerCredentials(options);
}

StatusOr<StreamServerSettings> stream_settings(const DaemonSettings& s) {
  if (s.tls_certificate.empty() != s.tls_key.empty())
    return absl::InvalidArgumentError("--tls-certificate and --tls-key belong together: give both or none");
  StreamServerSettings out;
  out.media.address = out.meta.address = s.address;
  out.media.port = s.media_port;
  out.meta.port = s.meta_port;
  out.max_sessions = s.max_sessions;
  out.insecure = s.insecure;
  if (!s.tls_certificate.empty()) {
    TESSERA_ASSIGN_OR_RETURN(out.meta.tls, transport::TlsContext::server({s.tls_certificate, s.tls_key}));
  }
  return out;
}

}  // namespace

struct Daemon::Impl {
  std::shared_ptr<gpu::Device> device;
  std::unique_ptr<StreamServer> streams;
  std::unique_ptr<SceneLibrary> scenes;
  std::unique_ptr<ControlService> control;
  std::unique_ptr<grpc::Server> grpc_server;
  int control_port = 0;

  Status start(const DaemonSettings& settings, const Clock& clock);
  Status load_scenes(const std::vector<std::string>& scenes);
  Status serve_control(const DaemonSettings& settings);
};

Status Daemon::Impl::start(const DaemonSettings& settings, const Clock& clock) {
  TESSERA_ASSIGN_OR_RETURN(const StreamServerSettings stream, stream_settings(settings));
  TESSERA_ASSIGN_OR_RETURN(device, gpu::Device::create({.select = settings.device}));
  TESSERA_ASSIGN_OR_RETURN(streams, StreamServer::create(stream, clock));
  scenes = std::make_unique<SceneLibrary>(device, *streams, settings.scene_root);
  control = std::make_unique<ControlService>(*streams, *scenes);
  TESSERA_RETURN_IF_ERROR(load_scenes(settings.scenes));
  return serve_control(settings);
}

Status Daemon::Impl::load_scenes(const std::vector<std::string>& list) {
  for (const std::string& text : list) {
    const size_t equals = text.find('=');
    if (equals == std::string::npos)
      return absl::InvalidArgumentError(absl::StrCat("--scene ", text, ": must be NAME=SOURCE"));
    TESSERA_ASSIGN_OR_RETURN(const SceneInfo info,
                             scenes->load_trusted(text.substr(0, equals), text.substr(equals + 1)));
    spdlog::info("scene {}: {} triangles, {:.1f} MiB on the device", info.name, info.triangles,
                 info.device_mib);
  }
  return absl::OkStatus();
}

Status Daemon::Impl::serve_control(const DaemonSettings& settings) {
  TESSERA_ASSIGN_OR_RETURN(const auto secret, credentials(settings));
  TESSERA_ASSIGN_OR_RETURN(const auto address, transport::parse_address(settings.address));
  const std::string where = transport::to_string(address, settings.control_port);
  grpc::EnableDefaultHealthCheckService(true);
  grpc::reflection::InitProtoReflectionServerBuilderPlugin();
  grpc::ServerBuilder builder;
  builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);  // a second daemon must not share the port unseen
  builder.AddListeningPort(where, secret, &control_port);
  builder.RegisterService(control.get());
  grpc_server = builder.BuildAndStart();
  if (!grpc_server || control_port == 0) {
    return absl::UnavailableError(absl::StrCat(
        "cannot open gRPC ", where, ": stop the other program or choose another port (0 takes a free one)"));
  }
  return absl::OkStatus();
}

Daemon::Daemon(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

StatusOr<std::unique_ptr<Daemon>> Daemon::start(const DaemonSettings& settings, const Clock& clock) {
  std::unique_ptr<Daemon> daemon(new Daemon(std::make_unique<Impl>()));
  TESSERA_RETURN_IF_ERROR(daemon->impl_->start(settings, clock));
  return daemon;
}

Daemon::~Daemon() {
  if (impl_->control) impl_->control->drain();
  if (impl_->streams) impl_->streams->end_all("the daemon is shutting down");  // calls may take their time
  if (impl_->grpc_server) impl_->grpc_server->Shutdown(std::chrono::system_clock::now() + kDrainTime);
  impl_->grpc_server.reset();
  impl_->control.reset();
  if (impl_->streams) impl_->streams->end_all("the daemon is shutting down");
  impl_->scenes.reset();  // by the render thread, which the stream server takes with it
  impl_->streams.reset();
}

uint16_t Daemon::control_port() const {
  return static_cast<uint16_t>(impl_->control_port);
}
uint16_t Daemon::meta_port() const {
  return impl_->streams->meta_port();
}
uint16_t Daemon::media_port() const {
  return impl_->streams->media_port();
}

}  // namespace tessera::server
