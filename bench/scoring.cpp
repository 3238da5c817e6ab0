#include "bench/scoring.h"

namespace tessera::bench {

FrameScore score(const FramePictures& pictures, const MaskedTriangles& masked) {
  const shading::ReferenceImage& truth = *pictures.truth;
  FrameScore result;
  if (!masked.empty()) {
    result.masked_edges =
        masked_edges(truth.triangle_plus_one, truth.color.width, truth.color.height, masked);
  }
  for (const Image8& shown : pictures.shown) {
    const Comparison& c =
        result.methods.emplace_back(compare_images(truth.color, shown, truth.triangle_plus_one));
    if (!masked.empty()) result.near_masked.push_back(sum_near(result.masked_edges, c.ssim));
  }
  if (const auto& split = pictures.split) {
    result.split = {compare_luma(truth.color, split->chroma_only), compare_luma(truth.color, split->uncoded),
                    compare_luma(truth.color, split->fresh), compare_luma(truth.color, split->seen)};
  }
  return result;
}

}  // namespace tessera::bench
