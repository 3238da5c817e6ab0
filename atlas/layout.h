// A layout turns visible sets into placements, frame by frame.
#pragma once

#include <memory>
#include <span>
#include <string_view>

#include "atlas/level_selection.h"
#include "atlas/placement.h"
#include "base/math.h"
#include "base/status.h"
#include "scene/visible_set.h"

namespace tessera::atlas {

enum class LayoutKind : uint8_t {
  blocks,       // Shading Atlas Streaming: power-of-two blocks in superblocks and columns
  coherent,     // rectangles of any even sides in slabs, samples spaced as the eye sees them
  tessellated,  // Tessellated Shading Streaming: each triangle as an L or two staircases, placed anew each
                // frame
};
constexpr LayoutKind kDefaultLayout = LayoutKind::coherent;
constexpr std::string_view kLayoutNames[] = {"blocks", "coherent", "tessellated"};  // by LayoutKind

constexpr float kDefaultSlantedness = 4;

struct LayoutSettings {
  LayoutKind kind = kDefaultLayout;
  uint32_t width = 2048, height = 1024;  // texels; blocks: multiples of the superblock's side; at most 8192
  uint8_t superblock_log = 8;            // blocks
  // blocks: share of the superblocks in use above which a fragmented atlas is re-placed, in stages; coherent:
  // of the shelves, above which slabs are emptied and what grows takes gaps alone. In (0, 1].
  float high_water = 0.96f;
  float slantedness =
      kDefaultSlantedness;  // tessellated: longest edge over height above which halves are taken
  LevelSettings levels;
};

// Settings of a layout for an atlas of this size.
LayoutSettings layout_settings(LayoutKind kind, uint32_t width, uint32_t height);

struct LayoutInput {
  const scene::VisiblePatches& visible;
  dvec3 eye{0};                         // world; where samples are spaced for
  std::span<const dmat4> transforms{};  // world matrix of each instance of the scene
};

struct LayoutStats {
  float bias = 0;
  uint64_t used_texels = 0;        // in blocks
  uint64_t fragmented_texels = 0;  // not in use, nor fit for every block
  uint32_t blocks = 0, colors = 0, colors_out_of_memory = 0;
  uint32_t halves = 0;         // among the blocks: triangles of kind halves
  uint32_t blocks_halved = 0;  // placed in this frame smaller than wished, for want of memory
  uint32_t changed = 0, removed = 0;
  bool reset = false;  // this frame re-placed everything, or a large stage of it
  uint32_t resets_total = 0;
};

// Per session. Not thread-safe.
class Layout {
 public:
  virtual ~Layout() = default;
  // Places the visible set. Patches that stay visible at their size keep their place. When memory runs out a
  // patch falls back to a single colour.
  virtual LayoutDelta update(const LayoutInput& input) = 0;
  // All current placements, sorted by patch and part. Valid until the next update.
  virtual std::span<const Placement> placements() const = 0;
  virtual const LayoutStats& stats() const = 0;
};

// InvalidArgument if the settings do not fit. `scene` outlives the layout.
StatusOr<std::unique_ptr<Layout>> create_layout(const scene::Scene& scene, const LayoutSettings& settings);

}  // namespace tessera::atlas
