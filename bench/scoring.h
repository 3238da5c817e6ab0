// Compares what one display frame showed with its truth. Needs no device: it runs beside the rendering of the
// next frame.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/image.h"
#include "bench/masked_edges.h"
#include "bench/metrics.h"
#include "bench/truth_cache.h"

namespace tessera::bench {

// Our method's pictures with causes of error switched off, one more with each.
struct SplitPictures {
  Image8 chroma_only;  // no coding
  Image8 uncoded;      // nor chroma subsampling
  Image8 fresh;        // nor staleness
  Image8 seen;         // nor missing primitives
};

struct FramePictures {
  uint32_t index = 0;  // of the display frame
  RenderedImage truth;
  std::vector<Image8> shown;  // by method
  std::optional<SplitPictures> split;
};

struct SplitErrors {
  ImageError chroma_only, uncoded, fresh, seen;  // mssim and psnr
};

struct FrameScore {
  std::vector<Comparison> methods;    // in the order of the pictures
  std::vector<EdgeSum> near_masked;   // likewise: SSIM near masked edges; empty without masked materials
  std::vector<uint8_t> masked_edges;  // masked_edges(); likewise
  std::optional<SplitErrors> split;
};

FrameScore score(const FramePictures& pictures, const MaskedTriangles& masked);

}  // namespace tessera::bench
