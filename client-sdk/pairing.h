// Brings decoded atlas pictures and meta frames together by frame number, and hands over complete pairs only.
//
// A meta frame changes the scene for good, so it waits until the atlas of its own frame has come, or is known
// to be lost: otherwise frame N would be drawn with the placements of frame N+1. Both queues are bounded:
// - held meta frames: when there are too many, the oldest is applied and its frame can no longer be shown;
// - waiting pictures: when there are too many, one is dropped from where they lie closest, never the oldest
// (the next
//   that can be completed) nor the newest (what the viewer wants). So a late meta channel lowers the rate of
//   pairs evenly, but never stops them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/yuv.h"
#include "client-sdk/client_core.h"
#include "client-sdk/meta_checker.h"
#include "client-sdk/scene_store.h"
#include "client-sdk/triple_buffer.h"

namespace tessera::client {

// Belongs to the receiving thread; `pairs` is where the drawing thread picks them up.
class Pairing {
 public:
  static constexpr size_t kMaxHeldMetas = 8;
  static constexpr size_t kMaxWaitingAtlases = 8;

  explicit Pairing(TripleBuffer<Pair>& pairs) : pairs_(pairs) {}

  // A decoded picture whose reference chain is intact (the decoder sees to that). Errors: its size is not
  // what its meta frame says.
  Status on_atlas(FrameNumber frame, const YuvView& picture);
  // A decoded meta frame, in order. Errors: see MetaChecker, and as above.
  Status on_meta(const geometry_compression::MetaFrame& meta);
  // A meta packet that could not be decoded.
  void on_damaged_meta() { checker_.on_missing_frame(); }

  uint64_t published() const { return published_; }
  uint64_t skipped() const { return skipped_; }
  FrameNumber newest() const { return newest_; }

 private:
  struct WaitingAtlas {
    FrameNumber frame;
    YuvImage picture;
  };

  void keep(FrameNumber frame, const YuvView& picture);
  void drop(size_t waiting_index);
  void drop_where_closest();
  Status advance();
  Status complete_front();

  TripleBuffer<Pair>& pairs_;
  MetaChecker checker_;
  SceneStore store_;
  std::vector<geometry_compression::MetaFrame> held_, spare_metas_;
  std::vector<WaitingAtlas> waiting_;  // by frame number
  std::vector<YuvImage> spare_pictures_;
  uint64_t published_ = 0, skipped_ = 0;
  FrameNumber newest_ = 0;
};

}  // namespace tessera::client
