// Watches a Tessera session with two eyes, and writes what they saw last:
//   TESSERA_TICKET=tessera://... embed PICTURE.ppm
// The ticket is a secret; everybody on a machine sees the arguments of its programs.
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <tessera/tessera.hpp>
#include <thread>

#include "offscreen.h"

constexpr int kWidth = 160, kHeight = 120, kFrames = 30;  // of one eye; the eyes lie side by side
constexpr double kEyeOffset = 0.032;                      // metres, from the middle of the head
constexpr TesseraFov kFov = {-1, 1, -0.75f, 0.75f};

// At an eye `right` of the head's middle (metres), turned to the left by `angle`.
TesseraPose pose(double right, double angle) {
  return {{right * std::cos(angle), 1.6, -right * std::sin(angle)},
          {0, std::sin(angle / 2), 0, std::cos(angle / 2)}};
}

int main(int argc, char** argv) try {
  const char* ticket = std::getenv("TESSERA_TICKET");
  if (argc != 2 || !ticket) throw std::runtime_error("usage: TESSERA_TICKET=tessera://... embed PICTURE.ppm");
  Offscreen window(2 * kWidth, kHeight);
  auto info = tessera::make<TesseraSessionCreateInfo>();
  info.apiVersion = TESSERA_API_VERSION;
  info.ticket = ticket;
  info.viewWidth = kWidth;
  info.viewHeight = kHeight;
  info.displayRate = 60;
  auto stereo = tessera::make<TesseraStereoInfo>();
  for (int i = 0; i < 2; ++i) {
    stereo.eyes[i] = {{i == 0 ? -kEyeOffset : kEyeOffset, 0, 0}, {0, 0, 0, 1}};
    stereo.fovs[i] = kFov;
  }
  info.next = &stereo;
  tessera::Session session(info);
  tessera::Renderer renderer(session);

  for (int drawn = 0; drawn < kFrames; std::this_thread::sleep_for(std::chrono::milliseconds(16))) {
    while (const auto event = session.poll_event()) {
      if (event->state == TESSERA_SESSION_LOST) throw std::runtime_error(event->reason);
      if (event->kind == TESSERA_EVENT_FIRST_PICTURE) std::cout << "first: frame " << event->frame << "\n";
    }
    session.send_pose(pose(0, 0.01 * drawn), tesseraGetTime() + 16'000'000);

    TesseraView eyes[2];
    for (int i = 0; i < 2; ++i) {
      eyes[i] = tessera::make<TesseraView>();
      eyes[i].pose = pose(i == 0 ? -kEyeOffset : kEyeOffset, 0.01 * drawn);
      eyes[i].fov = kFov;
      eyes[i].viewport = {i * kWidth, 0, kWidth, kHeight};
      eyes[i].framebuffer = TESSERA_BOUND_FRAMEBUFFER;
    }
    const auto frame = session.acquire_frame();
    if (renderer.draw(eyes, 2) == TESSERA_SUCCESS) ++drawn;
    glFinish();  // an app with a window: eglSwapBuffers()
    if (frame) session.report_displayed(frame->frame, tesseraGetTime());
  }
  window.write_ppm(argv[1]);
  std::cout << kFrames << " frames drawn, " << session.statistics().frames << " received\n";
} catch (const std::exception& e) {
  std::cerr << "embed: " << e.what() << "\n";
  return 1;
}
