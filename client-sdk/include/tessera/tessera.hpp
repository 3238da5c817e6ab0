// tessera.h for C++17: handles that destroy themselves, structs that know their type, errors as exceptions.
// Nothing but the C interface behind it; what a function does, and on which thread it may be called, is said
// there.
#pragma once

#include <tessera/tessera.h>

#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

namespace tessera {

class Error : public std::runtime_error {
 public:
  Error(TesseraResult result, const std::string& text)
      : std::runtime_error(std::string(tesseraResultToString(result)) + ": " + text), result_(result) {}
  TesseraResult result() const noexcept { return result_; }

 private:
  TesseraResult result_;
};

// Throws for results below 0, and gives back the others.
inline TesseraResult check(TesseraResult result) {
  if (result < 0) throw Error(result, tesseraGetLastErrorText());
  return result;
}

// A struct of the C interface, zeroed but for its type: auto view = make<TesseraView>();
template <typename Struct>
Struct make() noexcept;
#define TESSERA_MAKE(Struct, structure_type) \
  template <>                                \
  inline Struct make<Struct>() noexcept {    \
    Struct made{};                           \
    made.type = structure_type;              \
    return made;                             \
  }
TESSERA_MAKE(TesseraSessionCreateInfo, TESSERA_TYPE_SESSION_CREATE_INFO)
TESSERA_MAKE(TesseraPoseInfo, TESSERA_TYPE_POSE_INFO)
TESSERA_MAKE(TesseraEvent, TESSERA_TYPE_EVENT)
TESSERA_MAKE(TesseraFrameInfo, TESSERA_TYPE_FRAME_INFO)
TESSERA_MAKE(TesseraRendererCreateInfo, TESSERA_TYPE_RENDERER_CREATE_INFO)
TESSERA_MAKE(TesseraDrawInfo, TESSERA_TYPE_DRAW_INFO)
TESSERA_MAKE(TesseraView, TESSERA_TYPE_VIEW)
TESSERA_MAKE(TesseraLensDistortion, TESSERA_TYPE_LENS_DISTORTION)
TESSERA_MAKE(TesseraStatistics, TESSERA_TYPE_STATISTICS)
TESSERA_MAKE(TesseraStereoInfo, TESSERA_TYPE_STEREO_INFO)
TESSERA_MAKE(TesseraGaze, TESSERA_TYPE_GAZE)
#undef TESSERA_MAKE

// Owns a handle.
template <typename Handle, TesseraResult (*Destroy)(Handle)>
class Owner {
 public:
  Owner(Owner&& other) noexcept : handle_(std::exchange(other.handle_, nullptr)) {}
  Owner& operator=(Owner&& other) noexcept {
    std::swap(handle_, other.handle_);
    return *this;
  }
  ~Owner() { Destroy(handle_); }
  Handle get() const noexcept { return handle_; }

 protected:
  Owner() = default;
  Handle handle_ = nullptr;
};

// Destroy its renderers first.
class Session : public Owner<TesseraSession, tesseraDestroySession> {
 public:
  explicit Session(const TesseraSessionCreateInfo& info) { check(tesseraCreateSession(&info, &handle_)); }

  std::optional<TesseraEvent> poll_event() {
    auto event = make<TesseraEvent>();
    if (check(tesseraPollEvent(handle_, &event)) == TESSERA_EVENT_UNAVAILABLE) return std::nullopt;
    return event;
  }
  TesseraResult send_pose(const TesseraPose& pose, int64_t predicted_display_time,
                          const TesseraGaze* gaze = nullptr) {
    auto info = make<TesseraPoseInfo>();
    info.next = gaze;
    info.pose = pose;
    info.predictedDisplayTime = predicted_display_time;
    return check(tesseraSendPose(handle_, &info));
  }
  // A new frame, or none.
  std::optional<TesseraFrameInfo> acquire_frame() {
    auto info = make<TesseraFrameInfo>();
    if (check(tesseraAcquireFrame(handle_, &info)) != TESSERA_SUCCESS) return std::nullopt;
    return info;
  }
  void report_displayed(uint32_t frame, int64_t display_time) {
    check(tesseraReportDisplayed(handle_, frame, display_time));
  }
  TesseraStatistics statistics() const {
    auto statistics = make<TesseraStatistics>();
    check(tesseraGetStatistics(handle_, &statistics));
    return statistics;
  }
};

// Lives and dies with its context current.
class Renderer : public Owner<TesseraRenderer, tesseraDestroyRenderer> {
 public:
  Renderer(const Session& session,
           const TesseraRendererCreateInfo& info = make<TesseraRendererCreateInfo>()) {
    check(tesseraCreateRenderer(session.get(), &info, &handle_));
  }

  TesseraResult draw(const TesseraView* views, uint32_t count) {
    auto info = make<TesseraDrawInfo>();
    info.viewCount = count;
    info.views = views;
    return check(tesseraDraw(handle_, &info));
  }
  TesseraResult draw(const TesseraView& view) { return draw(&view, 1); }
};

}  // namespace tessera
