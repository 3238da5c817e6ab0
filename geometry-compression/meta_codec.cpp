#include "geometry-compression/meta_codec.h"

#include <algorithm>
#include <cassert>

#include "geometry-compression/bit_io.h"
#include "geometry-compression/sections.h"

namespace tessera::geometry_compression {
namespace {

constexpr uint32_t kMagic = 0x54534D46;  // "TSMF"
constexpr uint32_t kMaxAtlasSide = 8192;
constexpr uint32_t kCountOrder = 6;
constexpr uint32_t kFirstVertexOrder = 12;

struct Counts {
  uint32_t meshes, vertices, objects, moved, patches, placements;
};

Counts counts_of(const MetaFrame& f) {
  const auto size = [](const auto& v) { return static_cast<uint32_t>(v.size()); };
  return {size(f.meshes), size(f.vertices), size(f.objects),
          size(f.moved),  size(f.patches),  size(f.placements)};
}

void write_header(BitWriter& out, const MetaFrame& frame) {
  out.put(kMagic, 32);
  out.put(kMetaVersion, 8);
  out.put(frame.frame, 32);
  out.put(frame.rtp_timestamp, 32);
  out.put(frame.atlas_width, 16);
  out.put(frame.atlas_height, 16);
  out.put(frame.full_state, 1);
  const Counts n = counts_of(frame);
  for (uint32_t count : {n.meshes, n.objects, n.moved, n.patches, n.vertices, n.placements})
    out.put_unsigned(count, kCountOrder);
  out.put_unsigned(guess_first_vertex(frame), kFirstVertexOrder);
}

bool valid_atlas_side(uint32_t side) {
  return side % 2 == 0 && side <= kMaxAtlasSide;
}

std::string over_limit(const char* what, uint32_t count, uint32_t limit) {
  return std::to_string(count) + " " + what + " are more than the limit of " + std::to_string(limit);
}

std::string check_counts(const Counts& n, const MetaLimits& limits) {
  // A mesh without an object is of no use.
  if (n.meshes > limits.max_objects) return over_limit("meshes", n.meshes, limits.max_objects);
  if (n.objects > limits.max_objects) return over_limit("objects", n.objects, limits.max_objects);
  if (n.moved > limits.max_objects) return over_limit("moved objects", n.moved, limits.max_objects);
  if (n.patches > limits.max_patches) return over_limit("patches", n.patches, limits.max_patches);
  if (n.vertices > limits.max_vertices) return over_limit("vertices", n.vertices, limits.max_vertices);
  if (n.placements > limits.max_patches) return over_limit("placements", n.placements, limits.max_patches);
  return {};
}

struct Header {
  Counts counts{};
  uint32_t first_vertex = 0;
};

std::string read_header(BitReader& in, const MetaLimits& limits, MetaFrame& out, Header& header) {
  const bool magic = in.get(32) == kMagic;
  const auto version = static_cast<uint32_t>(in.get(8));
  if (!in.ok()) return {};
  if (!magic) return "not a meta packet: it does not start with TSMF";
  if (version != kMetaVersion)
    return "version " + std::to_string(version) + "; this reader knows " + std::to_string(kMetaVersion);
  out.frame = static_cast<uint32_t>(in.get(32));
  out.rtp_timestamp = static_cast<uint32_t>(in.get(32));
  out.atlas_width = static_cast<uint16_t>(in.get(16));
  out.atlas_height = static_cast<uint16_t>(in.get(16));
  if (!valid_atlas_side(out.atlas_width) || !valid_atlas_side(out.atlas_height))
    return "the atlas's sides must be even and at most 8192";
  out.full_state = in.get(1) != 0;
  Counts& n = header.counts;
  for (uint32_t* count : {&n.meshes, &n.objects, &n.moved, &n.patches, &n.vertices, &n.placements})
    *count = in.get_unsigned(kCountOrder);
  header.first_vertex = in.get_unsigned(kFirstVertexOrder);
  return check_counts(n, limits);
}

std::string read_end(BitReader& in) {
  const uint64_t left = in.bits_left();
  if (left >= 8 || in.get(static_cast<uint32_t>(left)) != 0) return "data after the end";
  return {};
}

std::string read_all(BitReader& in, MetaFrame& out, const MetaLimits& limits) {
  Header header;
  if (std::string error = read_header(in, limits, out, header); !error.empty() || !in.ok()) return error;
  const Counts& n = header.counts;
  if (auto e = read_meshes(in, n.meshes, out.meshes); !e.empty() || !in.ok()) return e;
  if (auto e = read_objects(in, n.objects, out.objects); !e.empty() || !in.ok()) return e;
  if (auto e = read_moved(in, n.moved, out.moved); !e.empty() || !in.ok()) return e;
  if (auto e = read_patches(in, n.patches, header.first_vertex, out.patches); !e.empty() || !in.ok())
    return e;
  if (auto e = read_vertices(in, n.vertices, out.patches, header.first_vertex, out.vertices);
      !e.empty() || !in.ok())
    return e;
  if (auto e = read_placements(in, n.placements, out.placements); !e.empty() || !in.ok()) return e;
  return read_end(in);
}

// What meta_frame.h demands of a sender.
[[maybe_unused]] bool valid(const MetaFrame& f) {
  const auto by_patch = [](const auto& a, const auto& b) {
    return std::pair(a.patch, a.part) >= std::pair(b.patch, b.part);
  };
  const auto by_object = [](const auto& a, const auto& b) { return a.object >= b.object; };
  return valid_atlas_side(f.atlas_width) && valid_atlas_side(f.atlas_height) &&
         std::adjacent_find(f.placements.begin(), f.placements.end(), by_patch) == f.placements.end() &&
         std::adjacent_find(f.moved.begin(), f.moved.end(), by_object) == f.moved.end() &&
         std::all_of(f.patches.begin(), f.patches.end(),
                     [](const NewPatch& p) { return p.triangles >= 1 && p.triangles <= 3; });
}

}  // namespace

std::vector<uint8_t> encode(const MetaFrame& frame, MetaBits* bits) {
  assert(valid(frame));
  BitWriter out;
  uint64_t done = 0;
  const auto account = [&](uint64_t MetaBits::*section) {
    if (bits) bits->*section = out.bit_count() - done;
    done = out.bit_count();
  };
  const uint32_t first_vertex = guess_first_vertex(frame);
  write_header(out, frame);
  account(&MetaBits::header);
  write_meshes(out, frame.meshes);
  account(&MetaBits::meshes);
  write_objects(out, frame.objects);
  account(&MetaBits::objects);
  write_moved(out, frame.moved);
  account(&MetaBits::moved);
  write_patches(out, frame.patches, first_vertex);
  account(&MetaBits::patches);
  write_vertices(out, frame.vertices, frame.patches, first_vertex);
  account(&MetaBits::vertices);
  write_placements(out, frame.placements);
  account(&MetaBits::placements);
  return std::move(out).take();
}

std::string decode(std::span<const uint8_t> bytes, MetaFrame& out, const MetaLimits& limits) {
  out = {};
  BitReader in(bytes);
  std::string error = read_all(in, out, limits);
  // A packet that ended too early made later values 0, so what is wrong with those says nothing.
  if (!in.ok()) error = "it is damaged or ends too early, at bit " + std::to_string(in.position());
  return error.empty() ? error : "meta packet: " + error;
}

}  // namespace tessera::geometry_compression
