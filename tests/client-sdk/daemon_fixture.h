// A daemon in this process with a small scene, and tickets for it.
#pragma once

#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <string>

#include "client-sdk/ticket.h"
#include "server/daemon.h"
#include "tessera/v1/control.grpc.pb.h"

namespace tessera::client::test {

class DaemonFixture : public testing::Test {
 protected:
  void SetUp() override { start({}); }
  // With free ports.
  void start(server::DaemonSettings settings) {
    daemon_.reset();
    settings.scenes = {"hall=gallery:0"};
    settings.control_port = settings.meta_port = settings.media_port = 0;
    settings.no_http = true;
    auto daemon = server::Daemon::start(settings, clock_);
    ASSERT_TRUE(daemon.ok()) << daemon.status();
    daemon_ = *std::move(daemon);
    const auto channel = grpc::CreateChannel("127.0.0.1:" + std::to_string(daemon_->control_port()),
                                             grpc::InsecureChannelCredentials());
    // gRPC 1.51 may give up its first connection (is_starting() in tools/controlled_session.cpp). With TLS
    // this channel is not used.
    const auto give_up = std::chrono::system_clock::now() + std::chrono::minutes(1);
    ASSERT_TRUE(!settings.tls_certificate.empty() || channel->WaitForConnected(give_up));
    control_ = v1::Control::NewStub(channel);
  }

  Ticket new_ticket() {
    grpc::ClientContext context;
    v1::CreateSessionRequest request;
    request.set_scene("hall");
    request.mutable_settings()->set_atlas_width(512);
    request.mutable_settings()->set_atlas_height(256);
    v1::Ticket made;
    const grpc::Status status = control_->CreateSession(&context, request, &made);
    EXPECT_TRUE(status.ok()) << status.error_message();
    session_ = made.session();
    Ticket ticket{.host = "127.0.0.1", .meta_port = static_cast<uint16_t>(made.meta_port())};
    EXPECT_EQ(made.token().size(), ticket.token.size());
    std::ranges::copy(made.token(), ticket.token.begin());
    return ticket;
  }
  // Ends the session of the newest ticket.
  void end_session(const std::string& reason) {
    grpc::ClientContext context;
    v1::DeleteSessionRequest request;
    request.set_session(session_);
    request.set_reason(reason);
    v1::DeleteSessionResponse response;
    EXPECT_TRUE(control_->DeleteSession(&context, request, &response).ok());
  }

  SteadyClock clock_;
  std::unique_ptr<server::Daemon> daemon_;
  std::unique_ptr<v1::Control::Stub> control_;
  uint64_t session_ = 0;
};

}  // namespace tessera::client::test
