#include "proto/control_access.h"

#include <grpcpp/support/client_interceptor.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <utility>
#include <vector>

namespace tessera {
namespace {

namespace fs = std::filesystem;
namespace interception = grpc::experimental;

constexpr size_t kMinCharacters = 16;    // of a random one no search finds
constexpr size_t kMaxCharacters = 1024;  // gRPC takes 8 KiB of metadata

class AddToken final : public interception::Interceptor {
 public:
  explicit AddToken(const std::string& value) : value_(value) {}
  void Intercept(interception::InterceptorBatchMethods* methods) override {
    if (methods->QueryInterceptionHookPoint(interception::InterceptionHookPoints::PRE_SEND_INITIAL_METADATA))
      methods->GetSendInitialMetadata()->insert({"authorization", value_});
    methods->Proceed();
  }

 private:
  const std::string& value_;
};

// The channel owns it, and outlives its calls.
class AddTokenToCalls final : public interception::ClientInterceptorFactoryInterface {
 public:
  explicit AddTokenToCalls(const std::string& token) : value_(absl::StrCat("Bearer ", token)) {}
  interception::Interceptor* CreateClientInterceptor(interception::ClientRpcInfo*) override {
    return new AddToken(value_);
  }

 private:
  const std::string value_;
};

}  // namespace

StatusOr<std::string> read_control_token(const std::string& file) {
  std::ifstream in(file);
  if (!in) return absl::InvalidArgumentError(absl::StrCat("cannot read ", file, ": ", std::strerror(errno)));
  std::error_code error;
  const fs::perms permissions = fs::status(file, error).permissions();
  if (error || (permissions & fs::perms::others_all) != fs::perms::none)
    return absl::InvalidArgumentError(
        absl::StrCat(file, " holds a secret, and every user may read or change it: chmod o= ", file));
  std::string line(kMaxCharacters + 1, '\0');  // bounded, whatever the file is
  in.read(line.data(), static_cast<std::streamsize>(line.size()));
  line.resize(static_cast<size_t>(in.gcount()));
  line = line.substr(0, line.find('\n'));
  const auto printable = [](char c) { return c > ' ' && c <= '~'; };
  if (line.size() < kMinCharacters || line.size() > kMaxCharacters || !std::ranges::all_of(line, printable))
    return absl::InvalidArgumentError(
        absl::StrCat(file, ": its first line must have ", kMinCharacters, " to ", kMaxCharacters,
                     " printable characters and no blanks; `openssl rand -hex 32` makes a good one"));
  return line;
}

Status to_status(const grpc::Status& status, const std::string& call) {
  if (status.ok()) return absl::OkStatus();
  return {static_cast<absl::StatusCode>(status.error_code()),
          absl::StrCat(call, ": ", status.error_message())};
}

std::shared_ptr<grpc::Channel> control_channel(const std::string& endpoint,
                                               const std::shared_ptr<grpc::ChannelCredentials>& credentials,
                                               const std::string& token,
                                               const grpc::ChannelArguments& arguments) {
  std::vector<std::unique_ptr<interception::ClientInterceptorFactoryInterface>> interceptors;
  if (!token.empty()) interceptors.push_back(std::make_unique<AddTokenToCalls>(token));
  return interception::CreateCustomChannelWithInterceptors(endpoint, credentials, arguments,
                                                           std::move(interceptors));
}

}  // namespace tessera
