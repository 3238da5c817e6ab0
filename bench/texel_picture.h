// The picture that texel shading shows (TSS section 5): each pixel reads the shaded texels at four points.
// Filters and averages colours as they are encoded, as the client and the reference do.
#pragma once

#include <span>

#include "bench/texel_shader.h"
#include "bench/truth_source.h"

namespace tessera::bench {

struct TexelPicture {
  Image8 image;
  uint64_t samples = 0;        // shaded in the tiles that this picture reads
  uint64_t samples_ahead = 0;  // in these and those that pictures from the predicted views read
};

// Everything as seen at this moment from this view: nothing is stale, no tile is missing. `predicted`: the
// views that a server would shade for, as TSS does (section 5: the set visible from a view cell); may be
// none.
StatusOr<TexelPicture> draw_texels(const UniqueTexture& texture, TexelShader& shader, TruthSource& truth,
                                   const View& view, std::span<const View> predicted, TimeNs scene_time_ns);

}  // namespace tessera::bench
