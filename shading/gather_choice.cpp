#include "shading/gather_choice.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "absl/strings/str_cat.h"

namespace tessera::shading {

std::optional<GatherPath> gather_path_named(std::string_view name) {
  const auto found = std::ranges::find(kGatherPathNames, name);
  if (found == std::end(kGatherPathNames)) return std::nullopt;
  return static_cast<GatherPath>(found - std::begin(kGatherPathNames));
}

size_t size_class(uint64_t samples) {
  return std::min<size_t>(samples > 0 ? std::bit_width(samples) - 1 : 0, kSizeClasses - 1);
}

bool GatherChoice::uses(GatherPath path) const {
  return std::ranges::any_of(paths,
                             [&](const auto& by_size) { return std::ranges::count(by_size, path) > 0; });
}

GatherChoice only(GatherPath path) {
  GatherChoice choice;
  for (size_t shape = 0; shape < kGatherShapes; ++shape)
    choice.paths[shape].fill(can_shade(path, static_cast<GatherShape>(shape)) ? path : GatherPath::compute);
  return choice;
}

GatherChoice cheapest(const GatherCosts& costs) {
  GatherChoice choice = only(kGatherPaths[0]);
  const auto number = [](double ns) { return std::isnan(ns) ? std::numeric_limits<double>::infinity() : ns; };
  for (size_t shape = 0; shape < kGatherShapes; ++shape)
    for (size_t size = 0; size < kSizeClasses; ++size) {
      const auto& ns = costs.ns[shape][size];
      size_t best = 0;
      for (size_t path = 1; path < ns.size(); ++path)
        if (can_shade(kGatherPaths[path], static_cast<GatherShape>(shape)) &&
            number(ns[path]) < (1 - kLeastGain) * number(ns[best]))
          best = path;
      choice.paths[shape][size] = kGatherPaths[best];
    }
  return choice;
}

// Raster wins where it shades no texel in vain. An L's or a half's rectangle also has others', and many small
// rectangles cost the rasteriser more than samples do.
GatherChoice software_choice() {
  GatherChoice choice = only(GatherPath::compute);
  auto& blocks = choice.paths[static_cast<size_t>(GatherShape::block)];
  std::fill(blocks.begin() + static_cast<ptrdiff_t>(size_class(16 * 16)), blocks.end(), GatherPath::raster);
  return choice;
}

std::string to_text(const GatherChoice& choice) {
  std::string text;
  for (size_t shape = 0; shape < kGatherShapes; ++shape) {
    absl::StrAppend(&text, shape ? "; " : "", std::string(kGatherShapeNames[shape]), ":");
    const auto& by_size = choice.paths[shape];
    for (size_t size = 0; size < kSizeClasses; ++size) {
      if (size > 0 && by_size[size] == by_size[size - 1]) continue;
      absl::StrAppend(&text, size ? ", " : " ", std::string(name_of(by_size[size])));
      if (size > 0) absl::StrAppend(&text, " from ", 1u << size, " samples");
    }
  }
  return text;
}

}  // namespace tessera::shading
