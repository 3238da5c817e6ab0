// MetaFrame ⇄ bits: deltas and exp-Golomb codes. Packets are self-contained: nothing is predicted from
// another packet.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "geometry-compression/meta_frame.h"

namespace tessera::geometry_compression {

constexpr uint8_t kMetaVersion = 3;

// Where the bits of one packet went, for reports.
struct MetaBits {
  uint64_t header = 0, meshes = 0, vertices = 0, objects = 0, moved = 0, patches = 0, placements = 0;
};

// `frame` must satisfy the ranges that meta_frame.h states (asserted).
std::vector<uint8_t> encode(const MetaFrame& frame, MetaBits* bits = nullptr);

// Upper bounds that the receiver accepts; ids beyond what the client holds are the client's to check.
struct MetaLimits {
  uint32_t max_vertices = 1u << 22;
  uint32_t max_objects = 1u << 20;
  uint32_t max_patches = 1u << 22;
};

// Safe for untrusted input: bounded time and memory (allocation grows with the bytes read, not with what they
// claim). Returns an empty string, or what is wrong and where; `out` is then unspecified.
std::string decode(std::span<const uint8_t> bytes, MetaFrame& out, const MetaLimits& limits = {});

}  // namespace tessera::geometry_compression
