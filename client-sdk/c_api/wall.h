// The wall between C++ and C: statuses become results, the last error's text is kept a thread, no exception
// passes.
#pragma once

#include <cmath>
#include <exception>
#include <new>
#include <utility>

#include "base/status.h"
#include "base/view.h"
#include "tessera/tessera.h"

namespace tessera::client::c_api {

TesseraResult result_of(const Status& status);
// Keeps the text for tesseraGetLastErrorText().
TesseraResult failure(TesseraResult result, absl::string_view text);
inline TesseraResult failure(const Status& status) {
  return failure(result_of(status), status.message());
}

// `body` returns TesseraResult.
template <typename Body>
TesseraResult guarded(const Body& body) noexcept {
  try {
    return body();
  } catch (const std::bad_alloc&) {
    return failure(TESSERA_ERROR_OUT_OF_MEMORY, "out of memory");
  } catch (const std::exception& e) {
    return failure(TESSERA_ERROR_INTERNAL, e.what());
  } catch (...) {
    return failure(TESSERA_ERROR_INTERNAL, "an exception of unknown type");
  }
}

// A struct that an app gave: not null and of its type; of check_struct(), also without an extension.
template <typename Struct>
Status check_type(const Struct* given, TesseraStructureType type, const char* name) {
  if (given == nullptr) return absl::InvalidArgumentError(absl::StrCat(name, " is NULL"));
  if (given->type == type) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(name, "->type is ", static_cast<int>(given->type),
                                                 " instead of ", static_cast<int>(type)));
}
template <typename Struct>
Status check_struct(const Struct* given, TesseraStructureType type, const char* name) {
  TESSERA_RETURN_IF_ERROR(check_type(given, type, name));
  if (given->next == nullptr) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(name, "->next must be NULL: nothing extends this struct"));
}

StatusOr<Pose> pose_of(const TesseraPose& pose, const char* name);
StatusOr<Fov> fov_of(const TesseraFov& fov, const char* name);

}  // namespace tessera::client::c_api

// Returns from a function of type TesseraResult when `expr` (a Status) is an error.
#define TESSERA_FAIL_IF_ERROR(expr)                           \
  do {                                                        \
    if (const ::absl::Status status_ = (expr); !status_.ok()) \
      return ::tessera::client::c_api::failure(status_);      \
  } while (false)
