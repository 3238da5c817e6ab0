#include "bench/texel_picture.h"

#include <algorithm>

#include "client-sdk/drawer.h"

namespace tessera::bench {
namespace {

// Points of a pixel, from its centre, in pixels.
constexpr vec2 kPoints[] = {{-0.25f, -0.25f}, {0.25f, -0.25f}, {-0.25f, 0.25f}, {0.25f, 0.25f}};

// The view whose pixel centres are those points of the view's pixels; y counts down.
View shifted(View view, vec2 pixels) {
  const float dx = pixels.x * (view.fov.right - view.fov.left) / static_cast<float>(view.width);
  const float dy = -pixels.y * (view.fov.up - view.fov.down) / static_cast<float>(view.height);
  view.fov.left += dx;
  view.fov.right += dx;
  view.fov.up += dy;
  view.fov.down += dy;
  return view;
}

vec3 color_of(const uint8_t* rgb) {
  return {rgb[0], rgb[1], rgb[2]};
}

void sort_uniquely(std::vector<TexelTile>& tiles) {
  std::ranges::sort(tiles);
  const auto repeated = std::ranges::unique(tiles);
  tiles.erase(repeated.begin(), repeated.end());
}

// The shaded texels of a picture.
class Texels {
 public:
  explicit Texels(const UniqueTexture& texture) : texture_(texture) {}

  void add(std::span<const TexelTile> tiles) {
    tiles_.insert(tiles_.end(), tiles.begin(), tiles.end());
    sort_uniquely(tiles_);
  }

  StatusOr<uint64_t> shade(TexelShader& shader, const scene::SceneInstant& instant, const View& viewer) {
    uint64_t samples = 0;
    for (size_t i = 0; i < tiles_.size(); i += TexelShader::kMaxTiles) {
      const std::span part = std::span(tiles_).subspan(i);
      TESSERA_ASSIGN_OR_RETURN(
          const ShadedTexels shaded,
          shader.shade(instant, viewer, part.first(std::min<size_t>(part.size(), TexelShader::kMaxTiles))));
      colors_.insert(colors_.end(), shaded.colors.begin(), shaded.colors.end());
      samples += shaded.samples;
    }
    return samples;
  }

  // With tiles that are not shaded.
  uint64_t samples_with(std::vector<TexelTile> others) const {
    others.insert(others.end(), tiles_.begin(), tiles_.end());
    sort_uniquely(others);
    uint64_t samples = 0;
    for (const TexelTile& tile : others) samples += texture_.samples(tile);
    return samples;
  }

  // Bilinear among the texels that show something.
  vec3 read(const TexelLookup& at) const {
    const vec2 base = glm::floor(at.position), part = at.position - base;
    const ivec2 last = ivec2(texture_.size(at.instance, at.level)) - 1;
    vec3 sum(0);
    float weights = 0;
    for (int corner = 0; corner < 4; ++corner) {
      const ivec2 step(corner & 1, corner >> 1);
      const float weight = (step.x ? part.x : 1 - part.x) * (step.y ? part.y : 1 - part.y);
      const uint32_t color = at_texel(at, glm::clamp(ivec2(base) + step, ivec2(0), last));
      if (color == 0) continue;
      sum += weight * color_of(reinterpret_cast<const uint8_t*>(&color));
      weights += weight;
    }
    return weights > 0 ? sum / weights : vec3(0);
  }

 private:
  uint32_t at_texel(const TexelLookup& at, uvec2 texel) const {
    const TexelTile tile{at.instance, at.level, texel.x / kTexelTile, texel.y / kTexelTile};
    const auto found = std::ranges::lower_bound(tiles_, tile);
    if (found == tiles_.end() || *found != tile) return 0;
    const uvec2 in_tile = texel % kTexelTile;
    return colors_[static_cast<size_t>(found - tiles_.begin()) * kTexelTileTexels + in_tile.y * kTexelTile +
                   in_tile.x];
  }

  const UniqueTexture& texture_;
  std::vector<TexelTile> tiles_;  // sorted
  std::vector<uint32_t> colors_;
};

Image8 rounded(const View& view, std::span<const vec3> colors) {
  Image8 image(view.width, view.height);
  for (size_t i = 0; i < colors.size(); ++i) {
    for (int c = 0; c < 3; ++c) image.rgba[4 * i + c] = static_cast<uint8_t>(colors[i][c] + 0.5f);
    image.rgba[4 * i + 3] = 255;
  }
  return image;
}

}  // namespace

StatusOr<TexelPicture> draw_texels(const UniqueTexture& texture, TexelShader& shader, TruthSource& truth,
                                   const View& view, std::span<const View> predicted, TimeNs scene_time_ns) {
  Texels texels(texture);
  std::array<RenderedImage, std::size(kPoints)> ids;
  std::vector<dmat4> transforms;
  for (size_t i = 0; i < ids.size(); ++i) {
    const View at = shifted(view, kPoints[i]);
    TESSERA_ASSIGN_OR_RETURN(ids[i], truth.render(at, scene_time_ns, {.samples = 1, .ids = true}));
    transforms = truth.instant().instance_transforms();
    texels.add(texture.visible_tiles(ids[i]->triangle_plus_one, at, transforms));
  }
  TexelPicture out;
  TESSERA_ASSIGN_OR_RETURN(out.samples, texels.shade(shader, truth.instant(), view));
  std::vector<TexelTile> ahead;
  for (const View& other : predicted) {
    TESSERA_ASSIGN_OR_RETURN(const RenderedImage seen,
                             truth.render(other, scene_time_ns, {.samples = 1, .ids = true}));
    const std::vector<TexelTile> tiles = texture.visible_tiles(seen->triangle_plus_one, other, transforms);
    ahead.insert(ahead.end(), tiles.begin(), tiles.end());
  }
  out.samples_ahead = texels.samples_with(std::move(ahead));

  const vec3 background = color_of(client::kDefaultBackground.data());
  std::vector<vec3> sum(size_t{view.width} * view.height, vec3(0));
  for (size_t i = 0; i < ids.size(); ++i) {
    const View at = shifted(view, kPoints[i]);
    for (size_t p = 0; p < sum.size(); ++p) {
      const uint32_t triangle = ids[i]->triangle_plus_one[p];
      const uvec2 pixel(p % view.width, p / view.width);
      const vec3 color =
          triangle == 0 ? background : texels.read(texture.lookup(triangle - 1, at, pixel, transforms));
      sum[p] += color / static_cast<float>(ids.size());
    }
  }
  out.image = rounded(view, sum);
  return out;
}

}  // namespace tessera::bench
