// Sessions, events, poses and frames in C.
#include <algorithm>
#include <optional>
#include <vector>

#include "base/utf8.h"
#include "client-sdk/c_api/handles.h"
#include "client-sdk/c_api/wall.h"
#include "client-sdk/session.h"
#include "transport/wire_pose.h"

namespace {

using namespace tessera;
using namespace tessera::client;
using namespace tessera::client::c_api;

constexpr DurationNs kDefaultConnectTimeoutNs = 8 * kNsPerSecond, kMaxConnectTimeoutNs = 60 * kNsPerSecond;
constexpr uint32_t kMaxViewSide = 16384;

TesseraResult null_session() {
  return failure(TESSERA_ERROR_HANDLE_INVALID, "the session is NULL");
}

StatusOr<std::vector<Eye>> eyes_of(const TesseraSessionCreateInfo& info) {
  if (info.next == nullptr) {
    TESSERA_ASSIGN_OR_RETURN(const Fov fov, fov_of(info.fov, "info->fov"));
    return std::vector<Eye>{{.fov = fov}};
  }
  const auto* stereo = static_cast<const TesseraStereoInfo*>(info.next);
  TESSERA_RETURN_IF_ERROR(check_struct(stereo, TESSERA_TYPE_STEREO_INFO, "info->next"));
  std::vector<Eye> eyes;
  for (int i = 0; i < TESSERA_MAX_VIEWS; ++i) {
    Eye& eye = eyes.emplace_back();
    const std::string name = absl::StrCat("stereo->eyes[", i, "]");
    TESSERA_ASSIGN_OR_RETURN(eye.in_head, pose_of(stereo->eyes[i], name.c_str()));
    TESSERA_ASSIGN_OR_RETURN(eye.fov, fov_of(stereo->fovs[i], absl::StrCat("stereo->fovs[", i, "]").c_str()));
    for (int axis = 0; axis < 3; ++axis) {
      if (std::abs(eye.in_head.position[axis]) > transport::kMaxEyeOffsetM)
        return absl::InvalidArgumentError(absl::StrCat(name, ".position has ", eye.in_head.position[axis],
                                                       "; eyes lie within ±1 m of the head"));
    }
  }
  return eyes;
}

// None without the struct.
StatusOr<std::optional<vec3>> gaze_of(const TesseraPoseInfo& info) {
  if (info.next == nullptr) return std::optional<vec3>();
  const auto* given = static_cast<const TesseraGaze*>(info.next);
  TESSERA_RETURN_IF_ERROR(check_struct(given, TESSERA_TYPE_GAZE, "info->next"));
  const vec3 gaze(given->direction[0], given->direction[1], given->direction[2]);
  const float length = glm::length(gaze);
  if (!(length >= 0.5f && length <= 2))
    return absl::InvalidArgumentError(
        absl::StrCat("gaze->direction is a vector of length ", length, "; give one of length 1"));
  return std::optional<vec3>(gaze / length);
}

StatusOr<transport::ClientSettings> client_settings(const TesseraSessionCreateInfo& info) {
  if (info.viewWidth - 1 >= kMaxViewSide || info.viewHeight - 1 >= kMaxViewSide)
    return absl::InvalidArgumentError(absl::StrCat("info->viewWidth x viewHeight is ", info.viewWidth, "x",
                                                   info.viewHeight, "; each must be 1..", kMaxViewSide));
  if (!(info.displayRate >= 1 && info.displayRate <= 1000))
    return absl::InvalidArgumentError(
        absl::StrCat("info->displayRate is ", info.displayRate, " Hz; it must be 1..1000"));
  TESSERA_ASSIGN_OR_RETURN(std::vector<Eye> eyes, eyes_of(info));
  const std::string name = info.applicationName == nullptr ? "" : info.applicationName;
  if (name.size() > transport::kMaxNameBytes)
    return absl::InvalidArgumentError(
        absl::StrCat("info->applicationName is longer than ", transport::kMaxNameBytes, " bytes"));
  if (utf8_prefix(name).size() != name.size())
    return absl::InvalidArgumentError("info->applicationName is not UTF-8");
  return transport::ClientSettings{.width = static_cast<uint16_t>(info.viewWidth),
                                   .height = static_cast<uint16_t>(info.viewHeight),
                                   .eyes = std::move(eyes),
                                   .display_hz = info.displayRate,
                                   .name = name};
}

StatusOr<DurationNs> connect_timeout(const TesseraSessionCreateInfo& info) {
  if (info.connectTimeout < 0 || info.connectTimeout > kMaxConnectTimeoutNs)
    return absl::InvalidArgumentError(
        absl::StrCat("info->connectTimeout is ", info.connectTimeout, " ns; it must be 0..60 s"));
  return info.connectTimeout == 0 ? kDefaultConnectTimeoutNs : info.connectTimeout;
}

StatusOr<TesseraSession> create_session(const TesseraSessionCreateInfo* info) {
  TESSERA_RETURN_IF_ERROR(check_type(info, TESSERA_TYPE_SESSION_CREATE_INFO, "info"));
  const uint32_t version = info->apiVersion;
  if (version != TESSERA_API_VERSION)  // while the major version is 0
    return absl::UnimplementedError(absl::StrFormat(
        "info->apiVersion is %u.%u, but this libtessera-client serves %u.%u: build the app with its "
        "tessera/tessera.h",
        version >> 16, version & 0xffff, TESSERA_API_VERSION >> 16, TESSERA_API_VERSION & 0xffff));
  if (info->ticket == nullptr) return absl::InvalidArgumentError("info->ticket is NULL");
  TESSERA_ASSIGN_OR_RETURN(const Ticket ticket, parse_ticket(info->ticket));
  TESSERA_ASSIGN_OR_RETURN(const transport::ClientSettings client, client_settings(*info));
  TESSERA_ASSIGN_OR_RETURN(const DurationNs timeout, connect_timeout(*info));
  return new TesseraSession_T(ticket, client, timeout);
}

// What the wire takes; of the wall clock, nanoseconds are beyond it.
Status check_time(int64_t time, const char* name) {
  if (transport::is_sane(time)) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(name, " is ", time,
                                                 " ns, which is not within ±2^60: give times of the clock "
                                                 "of tesseraGetTime()"));
}

// False, and nothing happens, if it would not grow.
bool advance(std::atomic<int64_t>& newest, int64_t time) {
  int64_t before = newest.load();
  do {
    if (time <= before) return false;
  } while (!newest.compare_exchange_weak(before, time));
  return true;
}

TesseraSessionState state_of(SessionState state) {
  switch (state) {
    case SessionState::connecting:
      return TESSERA_SESSION_CONNECTING;
    case SessionState::streaming:
      return TESSERA_SESSION_STREAMING;
    case SessionState::lost:
      return TESSERA_SESSION_LOST;
  }
  return TESSERA_SESSION_LOST;
}

TesseraEventKind kind_of(SessionEvent::Kind kind) {
  switch (kind) {
    case SessionEvent::Kind::state_changed:
      return TESSERA_EVENT_STATE_CHANGED;
    case SessionEvent::Kind::first_picture:
      return TESSERA_EVENT_FIRST_PICTURE;
    case SessionEvent::Kind::frame_available:
      return TESSERA_EVENT_FRAME_AVAILABLE;
  }
  return TESSERA_EVENT_STATE_CHANGED;
}

TesseraResult why_lost(const Status& reason) {
  return absl::IsFailedPrecondition(reason) ? TESSERA_ERROR_BUSY : result_of(reason);
}

void fill(TesseraEvent& out, const SessionEvent& event) {
  out.kind = kind_of(event.kind);
  out.state = state_of(event.state);
  out.result = why_lost(event.reason);
  out.frame = event.frame;
  const absl::string_view text = event.reason.message();
  const size_t size = std::min(text.size(), sizeof(out.reason) - 1);
  std::copy_n(text.begin(), size, out.reason);
  out.reason[size] = '\0';
}

}  // namespace

extern "C" {

int64_t tesseraGetTime(void) {
  return SteadyClock().now();
}

TesseraResult tesseraCreateSession(const TesseraSessionCreateInfo* info, TesseraSession* session) {
  return guarded([&] {
    if (session == nullptr) return failure(TESSERA_ERROR_VALIDATION, "session is NULL");
    const auto created = create_session(info);
    TESSERA_FAIL_IF_ERROR(created.status());
    *session = *created;
    return TESSERA_SUCCESS;
  });
}

TesseraResult tesseraDestroySession(TesseraSession session) {
  return guarded([&] {
    if (session == nullptr) return TESSERA_SUCCESS;
    if (session->renderers > 0)
      return failure(TESSERA_ERROR_CALL_ORDER, "destroy the session's renderers before the session");
    delete session;
    return TESSERA_SUCCESS;
  });
}

TesseraResult tesseraPollEvent(TesseraSession session, TesseraEvent* event) {
  return guarded([&] {
    if (session == nullptr) return null_session();
    TESSERA_FAIL_IF_ERROR(check_struct(event, TESSERA_TYPE_EVENT, "event"));
    const auto next = session->session.poll_event();
    if (!next) return TESSERA_EVENT_UNAVAILABLE;
    fill(*event, *next);
    return TESSERA_SUCCESS;
  });
}

TesseraResult tesseraSendPose(TesseraSession session, const TesseraPoseInfo* info) {
  return guarded([&] {
    if (session == nullptr) return null_session();
    TESSERA_FAIL_IF_ERROR(check_type(info, TESSERA_TYPE_POSE_INFO, "info"));
    const auto pose = pose_of(info->pose, "info->pose");
    TESSERA_FAIL_IF_ERROR(pose.status());
    const auto gaze = gaze_of(*info);
    TESSERA_FAIL_IF_ERROR(gaze.status());
    TESSERA_FAIL_IF_ERROR(check_time(info->predictedDisplayTime, "info->predictedDisplayTime"));
    if (const Status lost = session->session.status(); !lost.ok())
      return failure(why_lost(lost), lost.message());
    if (!advance(session->newest_pose_time, info->predictedDisplayTime))
      return failure(TESSERA_ERROR_VALIDATION,
                     "info->predictedDisplayTime is not later than that of the pose before");
    return session->session.send_pose({info->predictedDisplayTime, *pose}, *gaze) ? TESSERA_SUCCESS
                                                                                  : TESSERA_NOT_STREAMING;
  });
}

TesseraResult tesseraGetStatistics(TesseraSession session, TesseraStatistics* statistics) {
  return guarded([&] {
    if (session == nullptr) return null_session();
    TESSERA_FAIL_IF_ERROR(check_struct(statistics, TESSERA_TYPE_STATISTICS, "statistics"));
    const ConnectionStats stats = session->session.stats().value_or(ConnectionStats{});
    statistics->frames = stats.core.pairs;
    statistics->framesSkipped = stats.core.pairs_skipped;
    statistics->packets = stats.media.packets;
    statistics->packetsRecovered = stats.media.recovered;
    statistics->packetsLost = stats.media.given_up;
    statistics->framesOrphaned = stats.core.orphans;
    statistics->decodeErrors = stats.core.decode_errors;
    statistics->networkRoundTrip = stats.round_trip_ns.value_or(0);
    return TESSERA_SUCCESS;
  });
}

TesseraResult tesseraAcquireFrame(TesseraSession session, TesseraFrameInfo* info) {
  return guarded([&] {
    if (session == nullptr) return null_session();
    TESSERA_FAIL_IF_ERROR(check_struct(info, TESSERA_TYPE_FRAME_INFO, "info"));
    const Session::Acquired acquired = session->session.acquire();
    if (acquired.pair == nullptr) return TESSERA_FRAME_UNAVAILABLE;
    const SceneState& state = acquired.pair->state;
    info->frame = acquired.pair->frame;
    info->atlasWidth = state.atlas_width;
    info->atlasHeight = state.atlas_height;
    info->triangles = 0;
    for (const auto& group : state.records) info->triangles += group.size();
    if (!acquired.is_new) return TESSERA_FRAME_UNCHANGED;
    ++session->acquired;
    return TESSERA_SUCCESS;
  });
}

TesseraResult tesseraReportDisplayed(TesseraSession session, uint32_t frame, int64_t displayTime) {
  return guarded([&] {
    if (session == nullptr) return null_session();
    TESSERA_FAIL_IF_ERROR(check_time(displayTime, "displayTime"));
    session->session.report_displayed(frame, displayTime);
    return TESSERA_SUCCESS;
  });
}

}  // extern "C"
