// Who may steer a daemon that has a control token, over sockets.
#include <gmock/gmock.h>
#include <google/protobuf/descriptor.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/impl/codegen/proto_utils.h>

#include <filesystem>
#include <future>

#include "../transport/certificate.h"
#include "daemon_fixture.h"
#include "http_client.h"
#include "server/doctor.h"

namespace tessera::server {
namespace {

using grpc::StatusCode;
using testing::HasSubstr;
using transport::test::Certificate;
namespace fs = std::filesystem;

constexpr char kToken[] = "0123456789abcdef";
constexpr char kWrongToken[] = "0123456789abcdeg";

class Access : public DaemonTest {
 protected:
  Access() {
    transport::test::write_file(token_file_, absl::StrCat(kToken, "\n"));
    fs::permissions(token_file_, fs::perms::owner_read);
  }
  // A call with an empty request, which is all that the guard needs to see.
  static grpc::Status call(const std::shared_ptr<grpc::Channel>& channel, const std::string& method) {
    grpc::GenericStub stub(channel);
    grpc::ClientContext context;
    const grpc::Slice nothing;
    const grpc::ByteBuffer request(&nothing, 1);
    grpc::ByteBuffer response;
    std::promise<grpc::Status> done;
    stub.UnaryCall(&context, method, {}, &request, &response,
                   [&](const grpc::Status& status) { done.set_value(status); });
    return done.get_future().get();
  }

  transport::test::TemporaryFolder folder_;
  const std::string token_file_ = folder_.file("token");
};

TEST_F(Access, EveryCallButHealthNeedsTheToken) {
  start({.control_token_file = token_file_});
  const auto none = channel(""), wrong = channel("", kWrongToken), right = channel("", kToken);
  const auto* service = v1::ServerInfo::descriptor()->file()->FindServiceByName("Control");
  std::vector<std::string> methods{"/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo"};
  for (int i = 0; i < service->method_count(); ++i)
    methods.push_back(absl::StrCat("/", service->full_name(), "/", service->method(i)->name()));
  EXPECT_GT(methods.size(), 10u);
  for (const std::string& method : methods) {
    expect_refused(call(none, method), StatusCode::UNAUTHENTICATED, "no control token");
    expect_refused(call(wrong, method), StatusCode::UNAUTHENTICATED, "wrong control token");
    EXPECT_NE(call(right, method).error_code(), StatusCode::UNAUTHENTICATED) << method;
  }
  for (const auto& anyone : {none, wrong, right})
    EXPECT_TRUE(call(anyone, "/grpc.health.v1.Health/Check").ok());
}

TEST_F(Access, WithTheTokenScenesLoadAndSessionsAreMade) {
  start({.control_token_file = token_file_});
  v1::Ticket ticket;
  expect_refused(load("hall", "gallery:0"), StatusCode::UNAUTHENTICATED, "--control-token-file");
  control_ = v1::Control::NewStub(channel("", kToken));
  EXPECT_TRUE(load("hall", "gallery:0").ok()) << "and was not loaded before";
  ASSERT_TRUE(create("hall", &ticket).ok());
  control_ = v1::Control::NewStub(channel(""));
  expect_refused(create("hall", &ticket), StatusCode::UNAUTHENTICATED, "--control-token-file");
  expect_refused(remove(ticket.session()), StatusCode::UNAUTHENTICATED, "--control-token-file");
}

TEST_F(Access, TlsDoesNotStandInForTheToken) {
  const Certificate certificate("localhost");
  start({.tls_certificate = certificate.certificate_file(),
         .tls_key = certificate.key_file(),
         .control_token_file = token_file_});
  const std::string method = "/tessera.v1.Control/GetServerInfo";
  const std::string trusted = certificate.certificate_file();
  expect_refused(call(channel(trusted), method), StatusCode::UNAUTHENTICATED, "no control token");
  expect_refused(call(channel(trusted, kWrongToken), method), StatusCode::UNAUTHENTICATED, "wrong");
  EXPECT_TRUE(call(channel(trusted, kToken), method).ok());
  EXPECT_EQ(call(channel("", kToken), method).error_code(), StatusCode::UNAVAILABLE) << "in clear text";
}

TEST_F(Access, RefusalsAreCounted) {
  start({.control_token_file = token_file_});
  v1::Ticket ticket;
  for (int i = 0; i < 20; ++i) EXPECT_FALSE(create("hall", &ticket).ok());
  EXPECT_THAT(test::get(daemon_->http_port(), "/metrics"),
              HasSubstr("tesserad_refusals_total{call=\"control\",reason=\"UNAUTHENTICATED\"} 20\n"));
}

TEST_F(Access, BeyondLoopbackATokenIsNeededOrTheWord) {
  const Certificate certificate("localhost");
  for (const char* address : {"0.0.0.0", "::", "192.0.2.1"}) {
    DaemonSettings settings{.address = address,
                            .tls_certificate = certificate.certificate_file(),
                            .tls_key = certificate.key_file()};
    const Status refused = check(settings);
    EXPECT_TRUE(absl::IsInvalidArgument(refused)) << refused;
    EXPECT_THAT(std::string(refused.message()),
                AllOf(HasSubstr("--control-token-file"), HasSubstr("--insecure"), HasSubstr(address)));
    EXPECT_EQ(Daemon::start(settings, clock_).status(), refused);
    settings.control_token_file = token_file_;
    EXPECT_TRUE(check(settings).ok()) << check(settings);
    settings.control_token_file.clear();
    settings.insecure = true;
    EXPECT_TRUE(check(settings).ok()) << check(settings);
  }
  EXPECT_TRUE(check({.address = "::1"}).ok());
}

// A file that was asked for and is unfit is an error even where none is needed.
TEST_F(Access, AnUnfitFileIsRefusedByTheDaemonAndByTheDoctor) {
  const auto finding = [](const DaemonSettings& settings) {
    for (Finding& finding : examine(settings))
      if (finding.check == "control token") return finding;
    return Finding{"missing", absl::InternalError("there is no such line"), ""};
  };
  const DaemonSettings settings{.control_token_file = token_file_, .insecure = true};
  EXPECT_THAT(finding(settings).detail, HasSubstr(token_file_));
  fs::permissions(token_file_, fs::perms::others_read, fs::perm_options::add);
  const Status readable = check(settings);
  EXPECT_THAT(std::string(readable.message()),
              AllOf(HasSubstr("--control-token-file"), HasSubstr("chmod o=")));
  EXPECT_EQ(finding(settings).status, readable);
  EXPECT_EQ(Daemon::start(settings, clock_).status(), readable);
  fs::remove(token_file_);
  EXPECT_THAT(std::string(check(settings).message()),
              AllOf(HasSubstr("--control-token-file"), HasSubstr("No such file")));
  EXPECT_THAT(finding({}).detail, HasSubstr("none"));
}

}  // namespace
}  // namespace tessera::server
