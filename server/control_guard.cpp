#include "server/control_guard.h"

#include <openssl/crypto.h>
#include <openssl/sha.h>

#include <optional>
#include <string>
#include <utility>

#include "absl/strings/match.h"
#include "base/log.h"

namespace tessera::server {
namespace {

constexpr absl::string_view kScheme = "Bearer ";
constexpr absl::string_view kHealthService = "/grpc.health.v1.Health/";

// Empty: there is none, or more than one.
absl::string_view single(const grpc::AuthMetadataProcessor::InputMetadata& metadata, const char* key) {
  if (metadata.count(key) != 1) return {};
  const grpc::string_ref value = metadata.find(key)->second;
  return {value.data(), value.size()};
}

}  // namespace

ControlGuard::ControlGuard(std::string_view token, std::function<void()> on_refused, const Clock& clock)
    : token_(digest(token)), on_refused_(std::move(on_refused)), clock_(clock) {}

// Of equal length whatever the text's, so that their comparison tells nothing of it.
ControlGuard::Digest ControlGuard::digest(std::string_view text) {
  Digest out;
  SHA256(reinterpret_cast<const uint8_t*>(text.data()), text.size(), out.data());
  return out;
}

grpc::Status ControlGuard::Process(const InputMetadata& metadata, grpc::AuthContext*, OutputMetadata*,
                                   OutputMetadata*) {
  if (absl::StartsWith(single(metadata, ":path"), kHealthService)) return grpc::Status::OK;
  const absl::string_view authorization = single(metadata, "authorization");
  if (!absl::StartsWithIgnoreCase(authorization, kScheme)) return refuse("no control token");
  const absl::string_view shown = authorization.substr(kScheme.size());
  if (CRYPTO_memcmp(digest({shown.data(), shown.size()}).data(), token_.data(), token_.size()) != 0)
    return refuse("wrong control token");
  return grpc::Status::OK;
}

grpc::Status ControlGuard::refuse(const char* why) {
  on_refused_();
  std::optional<uint64_t> count;
  {
    const std::lock_guard lock(mutex_);
    count = log_.event(clock_.now());
  }
  if (count)
    log_event(spdlog::level::warn, "control calls refused", {{"count", *count}, {"last_reason", why}});
  return {grpc::StatusCode::UNAUTHENTICATED,
          absl::StrCat(why,
                       ": send the token of the daemon's --control-token-file as metadata "
                       "`authorization: Bearer TOKEN` (tessera-client: --control-token-file FILE)")};
}

}  // namespace tessera::server
