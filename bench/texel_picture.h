// The picture that texel shading shows (TSS section 5): each pixel reads the shaded texels at four points.
// Filters and averages colours as they are encoded, as the client and the reference do.
#pragma once

#include "bench/texel_shader.h"
#include "bench/truth_source.h"

namespace tessera::bench {

struct TexelPicture {
  Image8 image;
  uint64_t samples = 0;  // shaded, in the tiles that this picture reads; those of other views not counted
};

// Everything as seen at this moment from this view: nothing is stale, no tile is missing.
StatusOr<TexelPicture> draw_texels(const UniqueTexture& texture, TexelShader& shader, TruthSource& truth,
                                   const View& view, TimeNs scene_time_ns);

}  // namespace tessera::bench
