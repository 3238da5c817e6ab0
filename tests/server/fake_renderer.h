// A renderer without a device. A frame's number lies in its atlas's pixels and in its scene state, so that a
// pair that mixes two frames shows.
#pragma once

#include <optional>

#include "base/yuv.h"
#include "client-sdk/scene_state.h"
#include "server/frame.h"

namespace tessera::server::test {

struct FakeRendererSettings {
  DurationNs render_time_ns = 0;  // that a frame takes beside its encoding
  uint32_t moving_objects = 1;    // at least 1; each is some 40 bytes of every meta packet
};

// The atlas of SessionSettings::layout, at least 256x32.
RendererFactory fake_renders(const FakeRendererSettings& settings = {});

// Settings for a small and fast session.
SessionSettings small_session();

// The number that a decoded picture carries; nullopt: it carries none.
std::optional<FrameNumber> frame_in(const YuvImage& atlas);
// The number that a scene state carries in what was drawn last: its moved objects and its placement.
std::optional<FrameNumber> frame_in(const client::SceneState& state);

}  // namespace tessera::server::test
