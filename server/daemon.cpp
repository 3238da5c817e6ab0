#include "server/daemon.h"

#include <google/protobuf/stubs/logging.h>
#include <grpc/support/log.h>
#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/grpcpp.h>
#include <grpcpp/health_check_service_interface.h>

#include <chrono>
#include <fstream>
#include <iterator>
#include <utility>

#include "absl/strings/str_join.h"
#include "base/log.h"
#include "proto/control_access.h"
#include "server/control_guard.h"
#include "server/control_service.h"
#include "server/doctor.h"
#include "server/http_server.h"
#include "server/metrics.h"
#include "server/status_pages.h"
#include "transport/asio/endpoint.h"

namespace tessera::server {
namespace {

constexpr std::chrono::seconds kDrainTime{2};  // for calls under way
constexpr int kMaxRequestBytes = 64 << 10;
constexpr int kCallThreads = 64;  // of gRPC, beside those of calls that stay open

StatusOr<std::string> read_text(const std::string& file) {
  std::ifstream in(file);
  if (!in) return absl::InvalidArgumentError(absl::StrCat("cannot read ", file));
  return std::string(std::istreambuf_iterator<char>(in), {});
}

StatusOr<std::shared_ptr<grpc::ServerCredentials>> credentials(const DaemonSettings& settings) {
  // Clear text as gRPC has it takes no guard; as what xDS falls back to, without xDS, it does.
  if (settings.tls_certificate.empty()) return grpc::XdsServerCredentials(grpc::InsecureServerCredentials());
  TESSERA_ASSIGN_OR_RETURN(const std::string certificate, read_text(settings.tls_certificate));
  TESSERA_ASSIGN_OR_RETURN(const std::string key, read_text(settings.tls_key));
  grpc::SslServerCredentialsOptions options;
  options.pem_key_cert_pairs.push_back({key, certificate});
  return grpc::SslServerCredentials(options);
}

// An error of gRPC's comes back from the call that met it; its own lines are for whoever looks for its
// faults.
void log_of_grpc(gpr_log_func_args* line) {
  spdlog::debug("grpc: {}:{}: {}", line->file, line->line, line->message);
}
void log_of_protobuf(google::protobuf::LogLevel, const char* file, int line, const std::string& message) {
  spdlog::debug("protobuf: {}:{}: {}", file, line, message);
}

}  // namespace

StatusOr<std::pair<std::string, std::string>> name_and_source(const std::string& scene) {
  const size_t equals = scene.find('=');
  if (equals != std::string::npos) return std::pair(scene.substr(0, equals), scene.substr(equals + 1));
  return absl::InvalidArgumentError(absl::StrCat("--scene ", scene, ": must be NAME=SOURCE"));
}

StatusOr<StreamServerSettings> stream_settings(const DaemonSettings& s) {
  if (s.tls_certificate.empty() != s.tls_key.empty())
    return absl::InvalidArgumentError("--tls-certificate and --tls-key belong together: give both or none");
  StreamServerSettings out;
  out.media.address = out.meta.address = s.address;
  out.media.port = s.media_port;
  out.meta.port = s.meta_port;
  out.idle_timeout_ns = s.idle_timeout * kNsPerSecond;
  out.max_sessions = s.max_sessions;
  out.max_atlas_texels = uint64_t{s.max_atlas_mtexels} << 20;
  out.insecure = s.insecure;
  if (!s.tls_certificate.empty()) {
    TESSERA_ASSIGN_OR_RETURN(out.meta.tls, transport::TlsContext::server({s.tls_certificate, s.tls_key}));
  }
  TESSERA_RETURN_IF_ERROR(check_exposure(out));
  return out;
}

StatusOr<std::string> control_token(const DaemonSettings& s) {
  if (!s.control_token_file.empty()) {
    StatusOr<std::string> token = read_control_token(s.control_token_file);
    if (token.ok()) return token;
    return absl::InvalidArgumentError(absl::StrCat("--control-token-file: ", token.status().message()));
  }
  TESSERA_ASSIGN_OR_RETURN(const auto address, transport::parse_address(s.address));
  if (s.insecure || address.is_loopback()) return std::string();
  return absl::InvalidArgumentError(
      absl::StrCat("binding ", s.address,
                   " would let whoever reaches the control port steer the daemon: give "
                   "--control-token-file, or say --insecure"));
}

Status check(const DaemonSettings& settings) {
  TESSERA_RETURN_IF_ERROR(stream_settings(settings).status());
  TESSERA_RETURN_IF_ERROR(control_token(settings).status());
  for (const std::string& scene : settings.scenes) TESSERA_RETURN_IF_ERROR(name_and_source(scene).status());
  if (!shading::gather_path_named(settings.gather)) {
    const std::vector<std::string> names(std::begin(shading::kGatherPathNames),
                                         std::end(shading::kGatherPathNames));
    return absl::InvalidArgumentError(
        absl::StrCat("--gather ", settings.gather, ": must be one of ", absl::StrJoin(names, ", ")));
  }
  return absl::OkStatus();
}

const char* version() {
  return TESSERA_VERSION;
}

struct Daemon::Impl {
  StatusPages pages;
  std::unique_ptr<HttpServer> http;
  std::shared_ptr<gpu::Device> device;
  std::unique_ptr<Metrics> metrics;
  std::unique_ptr<StreamServer> streams;
  std::unique_ptr<SceneLibrary> scenes;
  std::unique_ptr<ControlService> control;
  std::unique_ptr<grpc::Server> grpc_server;
  int control_port = 0;

  Status start(const DaemonSettings& settings, const Clock& clock);
  Status serve_pages(const DaemonSettings& settings, const StreamServerSettings& stream);
  StatusOr<v1::ServerInfo> server_info(const DaemonSettings& settings) const;
  Status load_scenes(const std::vector<std::string>& scenes);
  Status serve_control(const DaemonSettings& settings, const Clock& clock);
  void set_serving(bool serving);
};

Status Daemon::Impl::start(const DaemonSettings& settings, const Clock& clock) {
  gpr_set_log_function(log_of_grpc);
  google::protobuf::SetLogHandler(log_of_protobuf);
  TESSERA_RETURN_IF_ERROR(check(settings));  // before scenes take their time
  TESSERA_ASSIGN_OR_RETURN(StreamServerSettings stream, stream_settings(settings));
  TESSERA_RETURN_IF_ERROR(serve_pages(settings, stream));
  TESSERA_ASSIGN_OR_RETURN(device, gpu::Device::create({.select = settings.device}));
  TESSERA_ASSIGN_OR_RETURN(const v1::ServerInfo info, server_info(settings));
  log_event(spdlog::level::info, "rendering",
            {{"device", info.device()}, {"driver", info.driver()}, {"encoder", info.encoder()}});
  metrics = std::make_unique<Metrics>(info);
  stream.on_rendered = [this](const FrameStats& frame) { metrics->on_rendered(frame); };
  TESSERA_ASSIGN_OR_RETURN(streams, StreamServer::create(stream, clock));
  scenes = std::make_unique<SceneLibrary>(device, *streams, settings.scene_root, settings.max_scene_mib,
                                          *shading::gather_path_named(settings.gather));
  control = std::make_unique<ControlService>(*streams, *scenes, info);
  pages.set_metrics([this] { return metrics->text(*streams, *scenes, *control); });
  TESSERA_RETURN_IF_ERROR(serve_control(settings, clock));
  TESSERA_RETURN_IF_ERROR(load_scenes(settings.scenes));
  set_serving(true);
  return absl::OkStatus();
}

Status Daemon::Impl::serve_pages(const DaemonSettings& settings, const StreamServerSettings& stream) {
  if (settings.no_http) return absl::OkStatus();
  const HttpServerSettings http_settings{
      .address = settings.address, .port = settings.http_port, .tls = stream.meta.tls};
  TESSERA_ASSIGN_OR_RETURN(
      http, HttpServer::open(http_settings, [this](std::string_view path) { return pages.get(path); }));
  return absl::OkStatus();
}

StatusOr<v1::ServerInfo> Daemon::Impl::server_info(const DaemonSettings& settings) const {
  v1::ServerInfo info;
  info.set_version(version());
  info.set_device(device->info().name);
  info.set_driver(device->info().driver);
  info.set_software_rendering(device->info().software);
  TESSERA_ASSIGN_OR_RETURN(*info.mutable_encoder(), choose_encoder());
  v1::Limits& limits = *info.mutable_limits();
  limits.set_max_sessions(settings.max_sessions);
  limits.set_max_atlas_mtexels(settings.max_atlas_mtexels);
  limits.set_max_scene_mib(settings.max_scene_mib);
  limits.set_max_watchers(settings.max_watchers);
  return info;
}

Status Daemon::Impl::load_scenes(const std::vector<std::string>& list) {
  for (const std::string& text : list) {
    TESSERA_ASSIGN_OR_RETURN(const auto scene, name_and_source(text));
    TESSERA_ASSIGN_OR_RETURN(const SceneInfo info, scenes->load_trusted(scene.first, scene.second));
    log_event(spdlog::level::info, "scene loaded",
              {{"scene", info.name}, {"triangles", info.triangles}, {"device_mib", info.device_mib}});
  }
  return absl::OkStatus();
}

void Daemon::Impl::set_serving(bool serving) {
  pages.set_state(serving ? StatusPages::State::serving : StatusPages::State::draining);
  if (control) serving ? control->open() : control->drain();
  if (grpc_server) grpc_server->GetHealthCheckService()->SetServingStatus(serving);
}

Status Daemon::Impl::serve_control(const DaemonSettings& settings, const Clock& clock) {
  TESSERA_ASSIGN_OR_RETURN(const auto secret, credentials(settings));
  TESSERA_ASSIGN_OR_RETURN(const std::string token, control_token(settings));
  if (!token.empty()) {
    const auto count = [this] { control->count_refusal("control", grpc::StatusCode::UNAUTHENTICATED); };
    secret->SetAuthMetadataProcessor(std::make_shared<ControlGuard>(token, count, clock));
  }
  TESSERA_ASSIGN_OR_RETURN(const auto address, transport::parse_address(settings.address));
  TESSERA_RETURN_IF_ERROR(transport::check_tcp_port("gRPC", address, settings.control_port));
  const std::string where = transport::to_string(address, settings.control_port);
  grpc::EnableDefaultHealthCheckService(true);
  grpc::reflection::InitProtoReflectionServerBuilderPlugin();
  grpc::ServerBuilder builder;
  builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);  // a second daemon must not share the port unseen
  builder.AddListeningPort(where, secret, &control_port);
  builder.SetMaxReceiveMessageSize(kMaxRequestBytes);
  grpc::ResourceQuota quota("control");
  quota.SetMaxThreads(static_cast<int>(settings.max_watchers) + kCallThreads);
  builder.SetResourceQuota(quota);
  builder.RegisterService(control.get());
  grpc_server = builder.BuildAndStart();
  if (!grpc_server || control_port == 0)
    return absl::UnavailableError(absl::StrCat("cannot open gRPC ", where));
  grpc_server->GetHealthCheckService()->SetServingStatus(false);
  return absl::OkStatus();
}

Daemon::Daemon(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

StatusOr<std::unique_ptr<Daemon>> Daemon::start(const DaemonSettings& settings, const Clock& clock) {
  std::unique_ptr<Daemon> daemon(new Daemon(std::make_unique<Impl>()));
  TESSERA_RETURN_IF_ERROR(daemon->impl_->start(settings, clock));
  return daemon;
}

void Daemon::drain() {
  impl_->set_serving(false);
}

Daemon::~Daemon() {
  drain();
  if (impl_->streams) impl_->streams->end_all("the daemon is shutting down");  // calls may take their time
  if (impl_->grpc_server) impl_->grpc_server->Shutdown(std::chrono::system_clock::now() + kDrainTime);
  impl_->grpc_server.reset();
  impl_->pages.set_metrics({});
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
uint16_t Daemon::http_port() const {
  return impl_->http ? impl_->http->port() : 0;
}

}  // namespace tessera::server
