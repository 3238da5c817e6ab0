// The baselines: methods that stream pictures. Plain video shows the newest decoded picture as it is; mesh
// warping (thesis 7.2.2) bends a wider picture to the newest pose by its depth.
#pragma once

#include <memory>

#include "bench/settings.h"
#include "bench/streamer.h"
#include "bench/truth_source.h"

namespace tessera::bench {

enum class PictureMethod { plain_video, mesh_warp };

// Coded by the same encoder at the same bit rate over the same link as ours. Mesh warping's depth travels
// uncoded and uncounted, in its favour.
class PictureStreamer final : public Streamer {
 public:
  static StatusOr<std::unique_ptr<PictureStreamer>> create(PictureMethod method,
                                                           std::shared_ptr<server::SharedScene> scene,
                                                           TruthSource& source,
                                                           const LoopbackSettings& settings);
  ~PictureStreamer() override;

  std::string name() const override;
  StatusOr<std::vector<Packet>> serve(const ServeRequest& request) override;
  Status deliver(Channel channel, std::span<const uint8_t> bytes) override;
  std::optional<FrameNumber> newest_frame() override;
  StatusOr<Image8> draw(const View& view) override;
  bool wants_key_frame() const override;

 private:
  struct Impl;
  explicit PictureStreamer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera::bench
