// What the guard lets through, and what it tells of the rest.
#include "server/control_guard.h"

#include <gmock/gmock.h>

#include "base/log.h"

namespace tessera::server {
namespace {

using testing::HasSubstr;

const std::string kToken = "0123456789abcdef0123456789abcdef";
const std::string kCall = "/tessera.v1.Control/CreateSession";

class Guard : public testing::Test {
 protected:
  grpc::Status call(const std::vector<std::string>& authorizations, const std::string& path = kCall) {
    grpc::AuthMetadataProcessor::InputMetadata metadata{{":path", path}};
    for (const std::string& value : authorizations) metadata.insert({"authorization", value});
    grpc::AuthMetadataProcessor::OutputMetadata consumed, response;
    return guard_.Process(metadata, nullptr, &consumed, &response);
  }
  void expect_refused(const std::vector<std::string>& authorizations, const std::string& path = kCall) {
    const int before = refused_;
    const grpc::Status status = call(authorizations, path);
    EXPECT_EQ(status.error_code(), grpc::StatusCode::UNAUTHENTICATED)
        << path << " " << testing::PrintToString(authorizations);
    EXPECT_THAT(status.error_message(), AllOf(HasSubstr("--control-token-file"), HasSubstr("authorization")));
    EXPECT_EQ(refused_, before + 1);
  }

  VirtualClock clock_;
  int refused_ = 0;
  ControlGuard guard_{kToken, [this] { ++refused_; }, clock_};
};

TEST_F(Guard, TheTokenLetsThrough) {
  EXPECT_TRUE(call({"Bearer " + kToken}).ok());
  EXPECT_TRUE(call({"bearer " + kToken}).ok()) << "RFC 9110: schemes have no case";
  EXPECT_EQ(refused_, 0);
}

TEST_F(Guard, NothingElseDoes) {
  expect_refused({});
  expect_refused({""});
  expect_refused({kToken});
  expect_refused({"Basic " + kToken});
  expect_refused({"Bearer"});
  expect_refused({"Bearer "});
  expect_refused({"Bearer " + kToken.substr(1)});
  expect_refused({"Bearer " + kToken + "0"});
  expect_refused({"Bearer  " + kToken});
  expect_refused({"Bearer " + kToken, "Bearer " + kToken});
  for (size_t i = 0; i < kToken.size(); ++i) {
    std::string wrong = kToken;
    wrong[i] ^= 1;
    expect_refused({"Bearer " + wrong});
  }
}

TEST_F(Guard, HealthAloneIsForEveryone) {
  EXPECT_TRUE(call({}, "/grpc.health.v1.Health/Check").ok());
  EXPECT_TRUE(call({}, "/grpc.health.v1.Health/Watch").ok());
  for (const char* path : {"", "/", "/grpc.health.v1.Healthy/Check", "/x/grpc.health.v1.Health/Check",
                           "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo"})
    expect_refused({}, path);
}

TEST_F(Guard, RefusalsAreALineInTenSecondsWithoutWhatWasShown) {
  init_logging("trace");
  const auto logged = [&](int calls) {
    testing::internal::CaptureStderr();
    for (int i = 0; i < calls; ++i) (void)call({"Bearer wrong-" + kToken});
    return testing::internal::GetCapturedStderr();
  };
  const std::string first = logged(100);
  EXPECT_EQ(std::ranges::count(first, '\n'), 1) << first;
  EXPECT_THAT(first, HasSubstr("control calls refused count=1 last_reason=\"wrong control token\""));
  clock_.advance_to(9 * kNsPerSecond);
  EXPECT_EQ(logged(1), "");
  clock_.advance_to(10 * kNsPerSecond);
  const std::string second = logged(1);
  EXPECT_THAT(second, HasSubstr("count=101 "));
  for (const std::string& line : {first, second})
    EXPECT_THAT(line, Not(testing::AnyOf(HasSubstr("0123"), HasSubstr("wrong-"))));
}

}  // namespace
}  // namespace tessera::server
