// Who may steer the daemon: every call to the control port must carry the operator's token, health checking
// excepted.
#pragma once

#include <grpcpp/security/auth_metadata_processor.h>

#include <array>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string_view>

#include "base/time.h"
#include "transport/session_binding.h"

namespace tessera::server {

// Thread-safe.
class ControlGuard final : public grpc::AuthMetadataProcessor {
 public:
  // `on_refused`: once for each call that was refused, on gRPC's threads. `clock` outlives the guard.
  ControlGuard(std::string_view token, std::function<void()> on_refused, const Clock& clock);

  bool IsBlocking() const override { return false; }
  // UNAUTHENTICATED says what the call lacks.
  grpc::Status Process(const InputMetadata& metadata, grpc::AuthContext* context, OutputMetadata* consumed,
                       OutputMetadata* response) override;

 private:
  using Digest = std::array<uint8_t, 32>;
  static Digest digest(std::string_view text);
  grpc::Status refuse(const char* why);

  const Digest token_;
  const std::function<void()> on_refused_;
  const Clock& clock_;
  std::mutex mutex_;
  transport::LogLimiter log_;
};

}  // namespace tessera::server
