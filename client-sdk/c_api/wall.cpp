#include "client-sdk/c_api/wall.h"

#include <algorithm>
#include <string>

namespace tessera::client::c_api {
namespace {

constexpr double kMaxPositionM = 1e9, kMaxTangent = 60;

std::string& last_error_text() {
  thread_local std::string text;
  return text;
}

}  // namespace

TesseraResult result_of(const Status& status) {
  switch (status.code()) {
    case absl::StatusCode::kOk:
      return TESSERA_SUCCESS;
    case absl::StatusCode::kInvalidArgument:
      return TESSERA_ERROR_VALIDATION;
    case absl::StatusCode::kFailedPrecondition:
      return TESSERA_ERROR_CALL_ORDER;
    case absl::StatusCode::kResourceExhausted:
      return TESSERA_ERROR_OUT_OF_MEMORY;
    case absl::StatusCode::kUnimplemented:
      return TESSERA_ERROR_VERSION_UNSUPPORTED;
    case absl::StatusCode::kUnavailable:
      return TESSERA_ERROR_UNREACHABLE;
    case absl::StatusCode::kDeadlineExceeded:
      return TESSERA_ERROR_TIMEOUT;
    case absl::StatusCode::kUnauthenticated:
      return TESSERA_ERROR_REFUSED;
    case absl::StatusCode::kCancelled:
      return TESSERA_ERROR_SESSION_ENDED;
    default:
      return TESSERA_ERROR_INTERNAL;
  }
}

TesseraResult failure(TesseraResult result, absl::string_view text) {
  last_error_text() = std::string(text);
  return result;
}

StatusOr<Pose> pose_of(const TesseraPose& pose, const char* name) {
  double length = 0;
  for (const double q : pose.orientation) length = std::hypot(length, q);
  if (!(length >= 0.5 && length <= 2)) {
    return absl::InvalidArgumentError(
        absl::StrCat(name, ".orientation is a quaternion of length ", length, "; give one of length 1"));
  }
  for (const double p : pose.position) {
    if (!(std::abs(p) <= kMaxPositionM))
      return absl::InvalidArgumentError(
          absl::StrCat(name, ".position has ", p, ", which is not within ±1e9 m"));
  }
  const double* q = pose.orientation;
  return normalized({{pose.position[0], pose.position[1], pose.position[2]}, dquat(q[3], q[0], q[1], q[2])});
}

StatusOr<Fov> fov_of(const TesseraFov& fov, const char* name) {
  const auto within = [](float t) { return std::abs(t) <= kMaxTangent; };
  if (within(fov.left) && within(fov.right) && within(fov.down) && within(fov.up) && fov.left < fov.right &&
      fov.down < fov.up)
    return Fov{fov.left, fov.right, fov.down, fov.up};
  return absl::InvalidArgumentError(absl::StrCat(name, " has the tangents ", fov.left, "..", fov.right, ", ",
                                                 fov.down, "..", fov.up,
                                                 "; they must grow, and lie within ±60"));
}

}  // namespace tessera::client::c_api

extern "C" {

uint32_t tesseraGetVersion(void) {
  return TESSERA_API_VERSION;
}

const char* tesseraGetLastErrorText(void) {
  return tessera::client::c_api::last_error_text().c_str();
}

const char* tesseraResultToString(TesseraResult result) {
  switch (result) {
#define TESSERA_CASE(name) \
  case name:               \
    return #name;
    TESSERA_CASE(TESSERA_SUCCESS)
    TESSERA_CASE(TESSERA_EVENT_UNAVAILABLE)
    TESSERA_CASE(TESSERA_FRAME_UNCHANGED)
    TESSERA_CASE(TESSERA_FRAME_UNAVAILABLE)
    TESSERA_CASE(TESSERA_NOT_STREAMING)
    TESSERA_CASE(TESSERA_ERROR_INTERNAL)
    TESSERA_CASE(TESSERA_ERROR_OUT_OF_MEMORY)
    TESSERA_CASE(TESSERA_ERROR_VALIDATION)
    TESSERA_CASE(TESSERA_ERROR_HANDLE_INVALID)
    TESSERA_CASE(TESSERA_ERROR_VERSION_UNSUPPORTED)
    TESSERA_CASE(TESSERA_ERROR_CALL_ORDER)
    TESSERA_CASE(TESSERA_ERROR_CONTEXT)
    TESSERA_CASE(TESSERA_ERROR_UNREACHABLE)
    TESSERA_CASE(TESSERA_ERROR_TIMEOUT)
    TESSERA_CASE(TESSERA_ERROR_REFUSED)
    TESSERA_CASE(TESSERA_ERROR_SESSION_ENDED)
    TESSERA_CASE(TESSERA_ERROR_BUSY)
    TESSERA_CASE(TESSERA_RESULT_MAX_ENUM)
#undef TESSERA_CASE
  }
  return "TESSERA_RESULT_UNKNOWN";
}

}  // extern "C"
