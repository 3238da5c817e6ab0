// What things cost on the wire, on a mesh like a real one; figures in docs/meta-format.md.
#include <gtest/gtest.h>

#include <cstdio>
#include <random>

#include "geometry-compression/meta_codec.h"
#include "synthetic.h"

namespace tessera::geometry_compression {
namespace {

double per(uint64_t bits, size_t count) {
  return static_cast<double>(bits) / static_cast<double>(count);
}

TEST(MetaSize, TorusAgainstPlainNumbers) {
  std::mt19937 random(11);
  const MetaFrame f = torus_frame(random, 160);
  MetaBits bits;
  const auto bytes = encode(f, &bits);
  const double vertex = per(bits.vertices, f.vertices.size());
  const double patch = per(bits.patches, f.patches.size());
  const double placement = per(bits.placements, f.placements.size());
  // Plainly: three floats a vertex; four bytes an id and one for the number of triangles; a placement as id,
  // x, y (4 + 2
  // + 2 bytes) and one byte for levels and orientation.
  uint64_t ids = 0;
  for (const NewPatch& p : f.patches) ids += p.triangles + 2;
  const double plain_patch = per(32 * ids + 8 * f.patches.size(), f.patches.size());
  std::printf("%zu vertices: %.1f bits each (plain 96, %.1fx)\n", f.vertices.size(), vertex, 96 / vertex);
  std::printf("%zu patches: %.1f bits each (plain %.0f, %.1fx)\n", f.patches.size(), patch, plain_patch,
              plain_patch / patch);
  std::printf("%zu placements: %.1f bits each (plain 72, %.1fx)\n", f.placements.size(), placement,
              72 / placement);
  std::printf("%zu bytes in all\n", bytes.size());
  // Thesis table 7.1 reports 6.0-6.7x for vertices and 15 bits each.
  EXPECT_LT(vertex, 20);
  EXPECT_LT(patch, 14.5);
  EXPECT_LT(placement, 20);
}

}  // namespace
}  // namespace tessera::geometry_compression
