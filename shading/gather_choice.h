// Which path shades a placement: the cheapest by what a sample of its kind and size costs on the device
// (shading/gather_cost.h). Plain values.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace tessera::shading {

// Single colours are computed on every path. `tessellation` shades Ls and halves in the evaluation shader,
// one invocation for each vertex of a tessellated triangle (TSS section 3), and computes blocks; it needs a
// device that passes check_tessellator() (tessellator.h).
enum class GatherPath : uint8_t { automatic, compute, raster, tessellation };
// By GatherPath; names of options and in results.
constexpr std::string_view kGatherPathNames[] = {"auto", "compute", "raster", "tessellation"};
// Nothing: no path has this name.
std::optional<GatherPath> gather_path_named(std::string_view name);
// Those that shade, in the order in which the first of equally cheap ones wins.
constexpr GatherPath kGatherPaths[] = {GatherPath::compute, GatherPath::raster, GatherPath::tessellation};
constexpr std::string_view name_of(GatherPath path) {
  return kGatherPathNames[static_cast<size_t>(path)];
}

// What a path shades at a time: a block, one L, one half. Single colours are always computed.
enum class GatherShape : uint8_t { block, l, half };
constexpr std::string_view kGatherShapeNames[] = {"block", "L", "half"};
constexpr size_t kGatherShapes = std::size(kGatherShapeNames);
constexpr bool can_shade(GatherPath path, GatherShape shape) {
  return path != GatherPath::tessellation || shape != GatherShape::block;
}

// Shapes by their number of samples n: class floor(log2(n)), the last one for all larger.
constexpr size_t kSizeClasses = 15;
size_t size_class(uint64_t samples);

// ns per sample, by shape, size class and path (index in kGatherPaths). Infinite: the path cannot shade it.
struct GatherCosts {
  std::array<std::array<std::array<double, std::size(kGatherPaths)>, kSizeClasses>, kGatherShapes> ns{};
};

// The path of every shape and size class; never `automatic`.
struct GatherChoice {
  std::array<std::array<GatherPath, kSizeClasses>, kGatherShapes> paths{};

  GatherPath of(GatherShape shape, uint64_t samples) const {
    return paths[static_cast<size_t>(shape)][size_class(samples)];
  }
  bool uses(GatherPath path) const;
  bool operator==(const GatherChoice&) const = default;
};

// One path for all that it can shade; compute for what it cannot.
GatherChoice only(GatherPath path);
// The cheapest path of each; an earlier one of kGatherPaths unless a later one is cheaper by more than
// kLeastGain, so that noise decides nothing that does not matter. NaN counts as infinite.
constexpr double kLeastGain = 0.05;
GatherChoice cheapest(const GatherCosts& costs);
// By `tessera-bench gather` on the software device: blocks from 16x16 texels on by raster, all else by
// compute.
GatherChoice software_choice();
// For people: "block: compute, raster from 64 samples; L: compute; half: compute".
std::string to_text(const GatherChoice& choice);

}  // namespace tessera::shading
