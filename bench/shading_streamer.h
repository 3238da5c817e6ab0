// Our method as a Streamer: the server's session and the client's core and display, in one process. For the
// error split it also keeps what the server had for each frame in flight, so that one cause of error after
// another can be turned off.
#pragma once

#include <functional>
#include <memory>

#include "bench/coverage_meter.h"
#include "bench/settings.h"
#include "bench/streamer.h"
#include "client-sdk/client_core.h"
#include "client-sdk/display.h"
#include "server/session.h"

namespace tessera::bench {

// What a server makes of the settings.
server::SessionSettings session_settings(const LoopbackSettings& settings);

class ShadingStreamer final : public Streamer {
 public:
  static StatusOr<std::unique_ptr<ShadingStreamer>> create(std::shared_ptr<server::SharedScene> scene,
                                                           const LoopbackSettings& settings);
  // With a session other than session_settings() has it; its atlas and view have the settings' sizes.
  static StatusOr<std::unique_ptr<ShadingStreamer>> create(std::shared_ptr<server::SharedScene> scene,
                                                           const LoopbackSettings& settings,
                                                           const server::SessionSettings& session);
  ~ShadingStreamer() override;

  std::string name() const override { return "tessera"; }
  StatusOr<std::vector<Packet>> serve(const ServeRequest& request) override;
  Status deliver(Channel channel, std::span<const uint8_t> bytes) override;
  std::optional<FrameNumber> newest_frame() override;
  StatusOr<Image8> draw(const View& view) override;
  bool wants_key_frame() const override;

  // From now on measures every served frame's visible set against the poses that really come. `meter` must
  // outlive this.
  Status meter_coverage(CoverageMeter& meter, std::function<Pose(TimeNs)> true_pose);

  // The picture of the current frame with causes of error turned off, one more with each:
  StatusOr<Image8> draw_uncoded_420(const View& view);  // no lossy codec
  StatusOr<Image8> draw_uncoded(const View& view);      // nor chroma subsampling
  // nor staleness: the placed samples are shaded again as seen from this view. `instant` is the scene at the
  // view's time.
  StatusOr<Image8> draw_fresh(const View& view, const scene::SceneInstant& instant);
  // Of the current frame's geometry with another atlas, such as one coded otherwise.
  StatusOr<Image8> draw_atlas(const YuvView& atlas, const View& view);
  // Whether the current frame has samples for this patch.
  bool has_patch(scene::PatchId patch) const;

  // How often the client broke a pairing rule: its records differ from the server's placements of the same
  // frame, or an older frame followed a newer one.
  uint64_t violations() const;
  const server::FrameStats& last_stats() const;  // of the last served frame
  const Image8& uncoded_atlas() const;           // of the current frame; empty without the split
  client::Display& display();                    // as the last picture left it
  server::Session& session();

 private:
  struct Impl;
  explicit ShadingStreamer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera::bench
