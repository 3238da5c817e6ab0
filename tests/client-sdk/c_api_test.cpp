// The C interface against a whole daemon: sessions, events, errors, and pictures.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <tessera/tessera.hpp>
#include <thread>

#include "app_context.h"
#include "client-sdk/c_api/handles.h"
#include "codec/yuv.h"
#include "daemon_fixture.h"

namespace tessera::client::test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr uint32_t kSide = 96;
constexpr TesseraFov kFov{-1, 1, -1, 1};
constexpr TesseraPose kHead{{0, 1.6, 0}, {0, 0, 0, 1}};
constexpr DurationNs kPatienceNs = 60 * kNsPerSecond;  // only a hang takes so long

TesseraSessionCreateInfo create_info(const std::string& ticket) {
  auto info = make<TesseraSessionCreateInfo>();
  info.apiVersion = TESSERA_API_VERSION;
  info.ticket = ticket.c_str();
  info.viewWidth = info.viewHeight = kSide;
  info.fov = kFov;
  info.displayRate = 60;
  return info;
}

TesseraView view_at(double x, int32_t viewport_x = 0, uint32_t framebuffer = TESSERA_BOUND_FRAMEBUFFER) {
  auto view = make<TesseraView>();
  view.pose = kHead;
  view.pose.position[0] = x;
  view.fov = kFov;
  view.viewport = {viewport_x, 0, kSide, kSide};
  view.framebuffer = framebuffer;
  return view;
}

std::string last_error() {
  return tesseraGetLastErrorText();
}

// What the display's own loop does, until `done`, or the session's end.
template <typename Done>
bool show_until(tessera::Session& session, std::vector<TesseraEvent>& events, const Done& done) {
  const int64_t give_up = tesseraGetTime() + kPatienceNs;
  while (tesseraGetTime() < give_up) {
    if (done()) return true;
    while (const auto event = session.poll_event()) events.push_back(*event);
    if (!events.empty() && events.back().state == TESSERA_SESSION_LOST) return false;
    auto pose = make<TesseraPoseInfo>();
    pose.pose = kHead;
    pose.predictedDisplayTime = tesseraGetTime();
    (void)tesseraSendPose(session.get(), &pose);  // the next event tells if the session was lost meanwhile
    std::this_thread::sleep_for(std::chrono::milliseconds(5));  // the display's rate
  }
  return false;
}

TEST(CApi, NamesResults) {
  EXPECT_STREQ(tesseraResultToString(TESSERA_SUCCESS), "TESSERA_SUCCESS");
  EXPECT_STREQ(tesseraResultToString(TESSERA_ERROR_SESSION_ENDED), "TESSERA_ERROR_SESSION_ENDED");
  EXPECT_STREQ(tesseraResultToString(static_cast<TesseraResult>(-12345)), "TESSERA_RESULT_UNKNOWN");
}

TEST(CApi, NullIsAnErrorWithAName) {
  auto event = make<TesseraEvent>();
  auto pose = make<TesseraPoseInfo>();
  auto frame = make<TesseraFrameInfo>();
  auto statistics = make<TesseraStatistics>();
  auto renderer_info = make<TesseraRendererCreateInfo>();
  auto draw = make<TesseraDrawInfo>();
  TesseraRenderer renderer = nullptr;
  EXPECT_EQ(tesseraPollEvent(nullptr, &event), TESSERA_ERROR_HANDLE_INVALID);
  EXPECT_EQ(tesseraSendPose(nullptr, &pose), TESSERA_ERROR_HANDLE_INVALID);
  EXPECT_EQ(tesseraAcquireFrame(nullptr, &frame), TESSERA_ERROR_HANDLE_INVALID);
  EXPECT_EQ(tesseraReportDisplayed(nullptr, 1, 1), TESSERA_ERROR_HANDLE_INVALID);
  EXPECT_EQ(tesseraGetStatistics(nullptr, &statistics), TESSERA_ERROR_HANDLE_INVALID);
  EXPECT_EQ(tesseraCreateRenderer(nullptr, &renderer_info, &renderer), TESSERA_ERROR_HANDLE_INVALID);
  EXPECT_THAT(last_error(), HasSubstr("session is NULL"));
  EXPECT_EQ(tesseraDraw(nullptr, &draw), TESSERA_ERROR_HANDLE_INVALID);
  EXPECT_THAT(last_error(), HasSubstr("renderer is NULL"));
  EXPECT_EQ(tesseraCreateSession(nullptr, nullptr), TESSERA_ERROR_VALIDATION);
  EXPECT_EQ(tesseraDestroySession(nullptr), TESSERA_SUCCESS);
  EXPECT_EQ(tesseraDestroyRenderer(nullptr), TESSERA_SUCCESS);
}

TEST(CApi, WrongCreateInfosAreNamed) {
  const std::string ticket = "tessera://127.0.0.1:1/00112233445566778899aabbccddeeff";
  const auto expect = [&](TesseraResult result, const std::string& word, const auto& change) {
    auto info = create_info(ticket);
    change(info);
    TesseraSession session = nullptr;
    EXPECT_EQ(tesseraCreateSession(&info, &session), result) << word;
    EXPECT_EQ(session, nullptr);
    EXPECT_THAT(last_error(), HasSubstr(word));
    EXPECT_THAT(last_error(), Not(HasSubstr("00112233")));
  };
  using Info = TesseraSessionCreateInfo;
  constexpr TesseraResult kWrong = TESSERA_ERROR_VALIDATION;
  expect(kWrong, "info->type is 2 instead of 1", [](Info& i) { i.type = TESSERA_TYPE_POSE_INFO; });
  expect(kWrong, "info->next", [](Info& i) { i.next = &i; });
  expect(TESSERA_ERROR_VERSION_UNSUPPORTED, "0.2",
         [](Info& i) { i.apiVersion = TESSERA_MAKE_VERSION(0, 2); });
  expect(kWrong, "info->ticket is NULL", [](Info& i) { i.ticket = nullptr; });
  expect(kWrong, "ticket: ", [](Info& i) { i.ticket = "tessera://127.0.0.1:1/0011223344"; });
  expect(kWrong, "viewWidth", [](Info& i) { i.viewWidth = 0; });
  expect(kWrong, "viewHeight", [](Info& i) { i.viewHeight = 16385; });
  expect(kWrong, "info->fov", [](Info& i) { i.fov.up = -2; });
  expect(kWrong, "displayRate", [](Info& i) { i.displayRate = NAN; });
  expect(kWrong, "connectTimeout", [](Info& i) { i.connectTimeout = -1; });
  const std::string long_name(65, 'x');
  expect(kWrong, "applicationName", [&](Info& i) { i.applicationName = long_name.c_str(); });
  expect(kWrong, "not UTF-8", [](Info& i) { i.applicationName = "caf\xe9"; });
}

TEST(CApi, WrongEyesAreNamed) {
  const std::string ticket = "tessera://127.0.0.1:1/00112233445566778899aabbccddeeff";
  const auto expect = [&](const std::string& word, const auto& change) {
    auto info = create_info(ticket);
    auto stereo = make<TesseraStereoInfo>();
    for (int i = 0; i < 2; ++i) {
      stereo.eyes[i] = {{0.03, 0, 0}, {0, 0, 0, 1}};
      stereo.fovs[i] = kFov;
    }
    info.next = &stereo;
    change(stereo);
    TesseraSession session = nullptr;
    EXPECT_EQ(tesseraCreateSession(&info, &session), TESSERA_ERROR_VALIDATION) << word;
    EXPECT_EQ(session, nullptr);
    EXPECT_THAT(last_error(), HasSubstr(word));
  };
  using Stereo = TesseraStereoInfo;
  expect("info->next->type is 2 instead of 10", [](Stereo& s) { s.type = TESSERA_TYPE_POSE_INFO; });
  expect("info->next->next", [](Stereo& s) { s.next = &s; });
  expect("stereo->eyes[1].orientation", [](Stereo& s) { s.eyes[1].orientation[3] = 0; });
  expect("stereo->eyes[0].position", [](Stereo& s) { s.eyes[0].position[2] = 1.5; });
  expect("stereo->eyes[1].position", [](Stereo& s) { s.eyes[1].position[1] = NAN; });
  expect("stereo->fovs[1]", [](Stereo& s) { s.fovs[1].right = -2; });
}

TEST(CApi, ARefusedConnectionIsLostAndNamesTheStep) {
  const std::string ticket = "tessera://127.0.0.1:1/00112233445566778899aabbccddeeff";
  tessera::Session session(create_info(ticket));
  EXPECT_FALSE(session.acquire_frame().has_value());
  std::vector<TesseraEvent> events;
  const int64_t give_up = tesseraGetTime() + kPatienceNs;
  while (tesseraGetTime() < give_up && (events.empty() || events.back().state != TESSERA_SESSION_LOST)) {
    if (const auto event = session.poll_event()) events.push_back(*event);
  }
  ASSERT_EQ(events.size(), 2u);
  EXPECT_EQ(events[0].state, TESSERA_SESSION_CONNECTING);
  EXPECT_EQ(events[1].result, TESSERA_ERROR_UNREACHABLE);
  EXPECT_THAT(events[1].reason, HasSubstr("127.0.0.1:1: connect: "));
  EXPECT_FALSE(session.poll_event().has_value()) << "nothing follows the end";
  try {
    session.send_pose(kHead, 1);
    ADD_FAILURE() << "a pose for a lost session";
  } catch (const Error& e) {
    EXPECT_EQ(e.result(), TESSERA_ERROR_UNREACHABLE);
    EXPECT_THAT(e.what(), HasSubstr("TESSERA_ERROR_UNREACHABLE: TCP 127.0.0.1:1: connect"));
  }
}

class CApiSession : public DaemonFixture {
 protected:
  std::string ticket_text() { return to_string(new_ticket()); }
};

TEST_F(CApiSession, AnUnknownTokenIsRefused) {
  Ticket ticket = new_ticket();
  ticket.token[3] ^= 1;
  tessera::Session session(create_info(to_string(ticket)));
  std::vector<TesseraEvent> events;
  show_until(session, events, [] { return false; });
  ASSERT_FALSE(events.empty());
  EXPECT_EQ(events.back().result, TESSERA_ERROR_REFUSED);
  EXPECT_THAT(events.back().reason, HasSubstr("hello"));
}

TEST_F(CApiSession, ASecondAppIsToldThatTheSessionIsBusy) {
  const std::string ticket = ticket_text();
  tessera::Session first(create_info(ticket));
  std::vector<TesseraEvent> events;
  ASSERT_TRUE(show_until(first, events, [&] { return first.statistics().frames > 0; }));
  tessera::Session second(create_info(ticket));
  events.clear();
  show_until(second, events, [] { return false; });
  ASSERT_FALSE(events.empty());
  EXPECT_EQ(events.back().state, TESSERA_SESSION_LOST);
  EXPECT_EQ(events.back().result, TESSERA_ERROR_BUSY);
  EXPECT_THAT(events.back().reason, HasSubstr("has a client already"));
  auto pose = make<TesseraPoseInfo>();
  pose.pose = kHead;
  EXPECT_EQ(tesseraSendPose(second.get(), &pose), TESSERA_ERROR_BUSY);
}

TEST_F(CApiSession, EventsComeInOrderFromConnectingToTheServersReason) {
  const std::string ticket = ticket_text();
  tessera::Session session(create_info(ticket));
  std::vector<TesseraEvent> events;
  ASSERT_TRUE(show_until(session, events, [&] { return session.statistics().frames >= 3; }));
  EXPECT_TRUE(session.acquire_frame().has_value());
  auto again = make<TesseraFrameInfo>();
  TesseraResult result = tesseraAcquireFrame(session.get(), &again);
  EXPECT_TRUE(result == TESSERA_FRAME_UNCHANGED || result == TESSERA_SUCCESS);
  EXPECT_EQ(again.atlasWidth, 512u);
  EXPECT_EQ(again.atlasHeight, 256u);
  EXPECT_GT(again.triangles, 0u);
  session.report_displayed(again.frame, tesseraGetTime());

  end_session("the lesson is over");
  show_until(session, events, [] { return false; });
  ASSERT_GE(events.size(), 5u);
  EXPECT_EQ(events[0].state, TESSERA_SESSION_CONNECTING);
  EXPECT_EQ(events[1].state, TESSERA_SESSION_STREAMING);
  EXPECT_EQ(events[1].kind, TESSERA_EVENT_STATE_CHANGED);
  EXPECT_EQ(events[2].kind, TESSERA_EVENT_FIRST_PICTURE);
  uint32_t newest = 0;
  for (size_t i = 3; i + 1 < events.size(); ++i) {
    EXPECT_EQ(events[i].kind, TESSERA_EVENT_FRAME_AVAILABLE) << i;
    EXPECT_GE(events[i].frame, newest);
    newest = events[i].frame;
  }
  EXPECT_EQ(events.back().kind, TESSERA_EVENT_STATE_CHANGED);
  EXPECT_EQ(events.back().state, TESSERA_SESSION_LOST);
  EXPECT_EQ(events.back().result, TESSERA_ERROR_SESSION_ENDED);
  EXPECT_THAT(events.back().reason, HasSubstr("the lesson is over"));
}

TEST_F(CApiSession, WrongPosesAreNamedAndChangeNothing) {
  const std::string ticket = ticket_text();
  tessera::Session session(create_info(ticket));
  std::vector<TesseraEvent> events;
  ASSERT_TRUE(show_until(session, events, [&] { return session.statistics().frames > 0; }));
  const auto expect = [&](const std::string& word, const TesseraPose& pose, int64_t time) {
    auto info = make<TesseraPoseInfo>();
    info.pose = pose;
    info.predictedDisplayTime = time;
    EXPECT_EQ(tesseraSendPose(session.get(), &info), TESSERA_ERROR_VALIDATION);
    EXPECT_THAT(last_error(), HasSubstr(word));
  };
  const int64_t now = tesseraGetTime();
  EXPECT_EQ(session.send_pose(kHead, now), TESSERA_SUCCESS);
  expect("orientation", {{0, 0, 0}, {0, 0, 0, 0}}, now + 100);
  expect("orientation", {{0, 0, 0}, {0, NAN, 0, 1}}, now + 100);
  expect("position", {{0, 2e9, 0}, {0, 0, 0, 1}}, now + 100);
  expect("position", {{0, NAN, 0}, {0, 0, 0, 1}}, now + 100);
  expect("predictedDisplayTime", kHead, now);
  constexpr int64_t kWallClock = 1'800'000'000'000'000'000;
  for (const int64_t time : {kWallClock, -kWallClock, (int64_t{1} << 60) + 1, INT64_MAX, INT64_MIN}) {
    expect("info->predictedDisplayTime is " + std::to_string(time), kHead, time);
    EXPECT_THAT(last_error(), HasSubstr("tesseraGetTime()"));
    EXPECT_EQ(tesseraReportDisplayed(session.get(), 1, time), TESSERA_ERROR_VALIDATION);
    EXPECT_THAT(last_error(), HasSubstr("displayTime is " + std::to_string(time)));
  }
  EXPECT_EQ(session.send_pose(kHead, now + 1), TESSERA_SUCCESS);

  const auto gaze_fails = [&](const std::string& word, const TesseraGaze& gaze) {
    auto info = make<TesseraPoseInfo>();
    info.next = &gaze;
    info.pose = kHead;
    info.predictedDisplayTime = now + 100;
    EXPECT_EQ(tesseraSendPose(session.get(), &info), TESSERA_ERROR_VALIDATION);
    EXPECT_THAT(last_error(), HasSubstr(word));
  };
  auto gaze = make<TesseraGaze>();
  gaze_fails("gaze->direction is a vector of length 0", gaze);
  gaze.direction[1] = NAN;
  gaze_fails("gaze->direction", gaze);
  gaze.direction[1] = 0.7f;
  gaze.type = TESSERA_TYPE_EVENT;
  gaze_fails("info->next->type is 3 instead of 11", gaze);
  gaze.type = TESSERA_TYPE_GAZE;
  EXPECT_EQ(session.send_pose(kHead, now + 2, &gaze), TESSERA_SUCCESS);
}

TEST_F(CApiSession, DrawsWhatADisplayDrawsOfTheSamePair) {
  const std::string ticket = ticket_text();
  const auto context = make_app_context();
  tessera::Session session(create_info(ticket));
  auto renderer_info = make<TesseraRendererCreateInfo>();
  renderer_info.background[2] = 60;
  tessera::Renderer renderer(session, renderer_info);
  const AppFramebuffer mono(kSide, kSide, {.depth = GL_DEPTH_COMPONENT32F, .samples = 4});
  const AppFramebuffer stereo(2 * kSide, kSide, {.depth = GL_DEPTH_COMPONENT32F, .samples = 4});
  const AppFramebuffer lens(kSide, kSide);

  EXPECT_EQ(renderer.draw(view_at(0, 0, mono.id())), TESSERA_FRAME_UNAVAILABLE);
  EXPECT_TRUE(near(pixel(mono.picture(), 5, 5), kBackground, 0));
  std::vector<TesseraEvent> events;
  std::optional<TesseraFrameInfo> frame;
  ASSERT_TRUE(show_until(session, events, [&] { return (frame = session.acquire_frame()).has_value(); }));

  glBindFramebuffer(GL_FRAMEBUFFER, mono.id());
  EXPECT_EQ(renderer.draw(view_at(0.2)), TESSERA_SUCCESS);
  const TesseraView eyes[2] = {view_at(-0.03, 0, stereo.id()), view_at(0.03, kSide, stereo.id())};
  EXPECT_EQ(renderer.draw(eyes, 2), TESSERA_SUCCESS);
  auto distortion = make<TesseraLensDistortion>();
  TesseraView bent = view_at(0.2, 0, lens.id());
  bent.next = &distortion;
  EXPECT_EQ(renderer.draw(bent), TESSERA_SUCCESS);
  const Image8 one = mono.picture(), both = stereo.picture(), through_lens = lens.picture();

  const Pair& pair = *session.get()->session.pair();
  EXPECT_EQ(pair.frame, frame->frame);
  auto display = make_display(kSide);
  const auto expected = [&](double x) {
    return picture_of(*display, pair.state, codec::view_of(pair.atlas), square_view(kSide, dvec3(x, 1.6, 0)));
  };
  const Image8 from_right = expected(0.2);
  EXPECT_EQ(largest_difference(one, from_right), 0);
  EXPECT_LE(largest_difference(through_lens, from_right), 1);
  EXPECT_EQ(largest_difference(cut(both, 0, 0, kSide, kSide), expected(-0.03)), 0);
  EXPECT_LE(largest_difference(cut(both, kSide, 0, kSide, kSide), expected(0.03)), 1)
      << "at another place of the framebuffer, interpolation rounds otherwise";
  EXPECT_GT(largest_difference(one, cut(both, 0, 0, kSide, kSide)), 20) << "different eyes";
  display.reset();
  ASSERT_TRUE(context->make_current().ok());
}

TEST_F(CApiSession, WrongDrawsAreNamed) {
  const std::string ticket = ticket_text();
  tessera::Session session(create_info(ticket));
  auto info = make<TesseraRendererCreateInfo>();
  TesseraRenderer none = nullptr;
  EXPECT_EQ(tesseraCreateRenderer(session.get(), &info, &none), TESSERA_ERROR_CONTEXT);

  const auto context = make_app_context();
  tessera::Renderer renderer(session);
  const AppFramebuffer framebuffer(kSide, kSide), flat(kSide, kSide, {.depth = GL_NONE});
  const auto expect = [&](TesseraResult result, const std::string& word, const auto& change) {
    TesseraView view = view_at(0, 0, framebuffer.id());
    auto draw = make<TesseraDrawInfo>();
    draw.viewCount = 1;
    draw.views = &view;
    change(draw, view);
    EXPECT_EQ(tesseraDraw(renderer.get(), &draw), result) << word;
    EXPECT_THAT(last_error(), HasSubstr(word));
  };
  using Draw = TesseraDrawInfo;
  using View = TesseraView;
  constexpr TesseraResult kWrong = TESSERA_ERROR_VALIDATION;
  auto lens = make<TesseraLensDistortion>();
  expect(kWrong, "not 0", [](Draw& d, View&) { d.viewCount = 0; });
  expect(kWrong, "not 3", [](Draw& d, View&) { d.viewCount = 3; });
  expect(kWrong, "views", [](Draw& d, View&) { d.views = nullptr; });
  expect(kWrong, "info->type", [](Draw& d, View&) { d.type = TESSERA_TYPE_VIEW; });
  expect(kWrong, "view->type", [](Draw&, View& v) { v.type = TESSERA_TYPE_UNKNOWN; });
  expect(kWrong, "view->fov", [](Draw&, View& v) { v.fov.left = INFINITY; });
  expect(kWrong, "view->pose", [](Draw&, View& v) { v.pose.position[2] = NAN; });
  expect(kWrong, "view->viewport", [](Draw&, View& v) { v.viewport.width = 0; });
  expect(kWrong, "lens->type", [](Draw& d, View& v) { v.next = &d; });
  lens.red[2] = NAN;
  expect(kWrong, "coefficient", [&](Draw&, View& v) { v.next = &lens; });
  lens.red[2] = 0;
  lens.next = &lens;
  expect(kWrong, "lens->next", [&](Draw&, View& v) { v.next = &lens; });
  expect(TESSERA_ERROR_CALL_ORDER, "no depth", [&](Draw&, View& v) { v.framebuffer = flat.id(); });

  EXPECT_EQ(tesseraDestroySession(session.get()), TESSERA_ERROR_CALL_ORDER);
  EXPECT_THAT(last_error(), HasSubstr("renderers"));
  const auto other = make_app_context();
  expect(TESSERA_ERROR_CONTEXT, "not current", [](Draw&, View&) {});
  EXPECT_EQ(tesseraDestroyRenderer(renderer.get()), TESSERA_ERROR_CONTEXT);
  ASSERT_TRUE(context->make_current().ok());
}

}  // namespace
}  // namespace tessera::client::test
