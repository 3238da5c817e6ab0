// What the C handles point to.
#pragma once

#include <EGL/egl.h>

#include <atomic>
#include <memory>

#include "client-sdk/drawer.h"
#include "client-sdk/session.h"
#include "tessera/tessera.h"

struct TesseraSession_T {
  TesseraSession_T(const tessera::client::Ticket& ticket, const tessera::transport::ClientSettings& client,
                   tessera::DurationNs connect_timeout_ns)
      : session(ticket, client, connect_timeout_ns) {}

  tessera::client::Session session;
  std::atomic<int> renderers{0};
  std::atomic<int64_t> newest_pose_time{INT64_MIN};
  uint64_t acquired = 0;  // how often a new pair was; the drawing thread's
};

struct TesseraRenderer_T {
  TesseraSession session;
  EGLContext context;
  std::unique_ptr<tessera::client::Drawer> drawer;
  uint64_t uploaded = 0;  // the value of TesseraSession_T::acquired whose pair the drawer has
};
