// The client without its windows and sockets: access units and meta packets in, complete pairs out. The same
// code runs over sockets and in virtual time.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "base/atlas_codec.h"
#include "base/frame_number.h"
#include "base/status.h"
#include "base/time.h"
#include "base/yuv.h"
#include "client-sdk/scene_state.h"

namespace tessera::client {

struct ClientStats {
  uint64_t pairs = 0;  // complete pairs handed to the display side
  uint64_t atlas_frames = 0, meta_frames = 0;
  uint64_t orphans = 0;        // atlases that came whole, but build on one that did not
  uint64_t decode_errors = 0;  // damaged atlases and metas
  uint64_t pairs_skipped = 0;  // replaced by a newer pair before they were drawn
  FrameNumber newest_pair = 0;
};

// A complete pair, ready to draw: the pixels and the scene state of the same frame.
struct Pair {
  FrameNumber frame = 0;
  YuvImage atlas;
  SceneState state;
};

// Thread-safety: on_* belong to one receiving thread (the network's), take_newest() and the pair that it gave
// to one drawing thread. The two meet in a triple buffer and never wait for each other. wants_key_frame() and
// stats() may be called from any thread; each number is up to date by itself, but they need not be of the
// same moment.
//
// Rules (docs/architecture.md): only complete pairs are shown, newest first. Meta frames apply in order and
// each exactly once. An atlas whose decoding chain is broken is never part of a pair; the core then wants a
// key frame.
class ClientCore {
 public:
  // Larger atlases are refused: the session's welcome names its size.
  static StatusOr<std::unique_ptr<ClientCore>> create(AtlasCodec codec = AtlasCodec::h264,
                                                      uint32_t max_width = 8192, uint32_t max_height = 8192);
  ~ClientCore();

  // One whole access unit, or picture packet; the frame that it belongs to. An error is counted and returned,
  // and leaves the core usable.
  StatusOr<FrameNumber> on_atlas(std::span<const uint8_t> access_unit);
  // One whole meta packet. Packets must come in frame order (the channel is reliable); a damaged one is an
  // error that ends the session's state until a packet with full_state.
  StatusOr<FrameNumber> on_meta(std::span<const uint8_t> packet);
  // True from a picture that could not be decoded until one that could.
  bool wants_key_frame() const;

  // The newest complete pair if there is one that was not taken yet, else nullptr. Valid until the next call.
  const Pair* take_newest();
  ClientStats stats() const;

 private:
  struct Impl;
  explicit ClientCore(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera::client
