// Decides whether a decoded meta frame makes sense after those before it. The packets come from the network:
// what passes here can be applied and drawn without further tests.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "base/frame_number.h"
#include "base/status.h"
#include "geometry-compression/meta_frame.h"

namespace tessera::client {

// Knows only what has been announced so far, not the scene itself, so a frame is judged when it arrives even
// if it is applied later.
class MetaChecker {
 public:
  // InvalidArgument names the field, the value and the limit; the frame then counts as missing, and until a
  // frame with full_state every further one is refused with DataLoss.
  Status check(const geometry_compression::MetaFrame& frame);
  // A packet that could not even be decoded.
  void on_missing_frame() { complete_ = false; }

 private:
  struct PatchTraits {
    uint8_t triangles;
    bool masked;
  };
  // What the client holds after a frame.
  struct Holdings {
    std::vector<geometry_compression::NewMesh> meshes;
    size_t vertices = 0;
    std::vector<bool> masked;  // by object
    std::vector<PatchTraits> patches;
    uint16_t atlas_width = 0, atlas_height = 0;
  };
  static Status check_placement(size_t entry, const geometry_compression::PatchPlacement& placement,
                                const Holdings& holdings);
  static Status check_content(const geometry_compression::MetaFrame& frame, Holdings& holdings);

  Holdings holdings_;
  std::optional<FrameNumber> newest_;
  bool complete_ = false;  // holdings_ is what the server believes it to be; from the first full state on
};

}  // namespace tessera::client
