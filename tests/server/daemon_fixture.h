// A daemon in the test's process, on free ports of loopback, with what a client needs to talk to it.
#pragma once

#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <string>
#include <thread>

#include "../transport/child_process.h"
#include "client-sdk/connection.h"
#include "proto/control_access.h"
#include "server/daemon.h"
#include "tessera/v1/control.grpc.pb.h"

namespace tessera::server {

constexpr DurationNs kPatienceNs = 60 * kNsPerSecond;  // only a hang takes so long

inline void expect_refused(const grpc::Status& status, grpc::StatusCode code, const std::string& word) {
  EXPECT_EQ(status.error_code(), code) << status.error_message();
  EXPECT_NE(status.error_message().find(word), std::string::npos) << status.error_message();
}

class DaemonTest : public testing::Test {
 protected:
  void start(DaemonSettings settings = {}) {
    settings.control_port = settings.meta_port = settings.media_port = settings.http_port = 0;
    auto daemon = Daemon::start(settings, clock_);
    ASSERT_TRUE(daemon.ok()) << daemon.status();
    daemon_ = *std::move(daemon);
    control_ = connected(channel(settings.tls_certificate));
  }
  // gRPC 1.51 may give up its first connection (is_starting() in client-sdk/tools/controlled_session.cpp).
  static std::unique_ptr<v1::Control::Stub> connected(const std::shared_ptr<grpc::Channel>& channel) {
    const std::chrono::nanoseconds patience(kPatienceNs);
    EXPECT_TRUE(channel->WaitForConnected(std::chrono::system_clock::now() + patience));
    return v1::Control::NewStub(channel);
  }

  // `certificate`: what the daemon must show, made for "localhost"; empty: clear text. `token`: what calls
  // show.
  std::shared_ptr<grpc::Channel> channel(const std::string& certificate,
                                         const std::string& token = "") const {
    const std::string where = "127.0.0.1:" + std::to_string(daemon_->control_port());
    if (certificate.empty()) return control_channel(where, grpc::InsecureChannelCredentials(), token);
    const std::vector<uint8_t> pem = transport::test::read_file(certificate);
    grpc::SslCredentialsOptions options;
    options.pem_root_certs.assign(pem.begin(), pem.end());
    grpc::ChannelArguments arguments;
    arguments.SetSslTargetNameOverride("localhost");
    return control_channel(where, grpc::SslCredentials(options), token, arguments);
  }

  grpc::Status load(const std::string& name, const std::string& source, v1::Scene* scene = nullptr) {
    grpc::ClientContext context;
    v1::LoadSceneRequest request;
    request.set_name(name);
    request.set_source(source);
    v1::Scene ignored;
    return control_->LoadScene(&context, request, scene ? scene : &ignored);
  }
  grpc::Status unload(const std::string& name) {
    grpc::ClientContext context;
    v1::UnloadSceneRequest request;
    request.set_name(name);
    v1::UnloadSceneResponse response;
    return control_->UnloadScene(&context, request, &response);
  }
  grpc::Status create(const std::string& scene, v1::Ticket* ticket, uint32_t atlas_width = 512,
                      const v1::Density& density = {}) {
    grpc::ClientContext context;
    v1::CreateSessionRequest request;
    request.set_scene(scene);
    request.mutable_settings()->set_atlas_width(atlas_width);
    request.mutable_settings()->set_atlas_height(256);
    *request.mutable_settings()->mutable_density() = density;
    return control_->CreateSession(&context, request, ticket);
  }
  grpc::Status update(uint64_t session, const v1::SessionSettings& settings, v1::Session* out = nullptr) {
    grpc::ClientContext context;
    v1::UpdateSessionRequest request;
    request.set_session(session);
    *request.mutable_settings() = settings;
    v1::Session ignored;
    return control_->UpdateSession(&context, request, out ? out : &ignored);
  }
  grpc::Status remove(uint64_t session) {
    grpc::ClientContext context;
    v1::DeleteSessionRequest request;
    request.set_session(session);
    request.set_reason("deleted by hand");
    v1::DeleteSessionResponse response;
    return control_->DeleteSession(&context, request, &response);
  }
  v1::Session get(uint64_t session) {
    grpc::ClientContext context;
    v1::GetSessionRequest request;
    request.set_session(session);
    v1::Session found;
    EXPECT_TRUE(control_->GetSession(&context, request, &found).ok());
    return found;
  }

  client::ConnectionSettings connection_settings(const v1::Ticket& ticket) {
    client::ConnectionSettings settings{.meta_port = static_cast<uint16_t>(ticket.meta_port())};
    EXPECT_EQ(ticket.token().size(), settings.token.size());
    std::copy(ticket.token().begin(), ticket.token().end(), settings.token.begin());
    settings.client = {
        .width = 160, .height = 90, .eyes = {{.fov = Fov::symmetric(1.0f, 16.0f / 9.0f)}}, .display_hz = 60};
    return settings;
  }
  StatusOr<std::unique_ptr<client::Connection>> connect(const v1::Ticket& ticket) {
    return client::Connection::connect(connection_settings(ticket), clock_);
  }
  // Polls: what is awaited has no event to wait for.
  template <class Condition>
  bool eventually(Condition condition) {
    const TimeNs give_up = clock_.now() + kPatienceNs;
    while (!condition()) {
      if (clock_.now() > give_up) return false;
      std::this_thread::yield();
    }
    return true;
  }
  // A display loop until the first pair; null if the session ended before.
  const client::Pair* first_pair(client::Connection& client) {
    const TimeNs give_up = clock_.now() + kPatienceNs;
    while (clock_.now() < give_up && client.status().ok()) {
      client.send_pose({clock_.now(), {dvec3(0, 1.6, 0), {1, 0, 0, 0}}});
      if (const client::Pair* pair = client.take_newest()) return pair;
      std::this_thread::sleep_for(std::chrono::milliseconds(5));  // the display's rate
    }
    return nullptr;
  }

  SteadyClock clock_;
  std::unique_ptr<Daemon> daemon_;
  std::unique_ptr<v1::Control::Stub> control_;
};

}  // namespace tessera::server
