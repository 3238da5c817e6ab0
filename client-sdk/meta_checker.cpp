#include "client-sdk/meta_checker.h"

#include <cmath>
#include <cstdlib>

#include "atlas/addressing/addressing.h"

namespace tessera::client {
namespace {

namespace addressing = atlas::addressing;
using geometry_compression::MetaFrame;
using geometry_compression::NewMesh;
using geometry_compression::NewPatch;
using geometry_compression::NewVertex;
using geometry_compression::PatchPlacement;
using geometry_compression::PlacementKind;
using geometry_compression::Transform;

// Of TriangleRecord's fields, and of the packets (meta_frame.h).
constexpr size_t kMaxVertices = size_t{1} << 22;
constexpr size_t kMaxObjects = size_t{1} << 20;
constexpr size_t kMaxPatches = size_t{1} << 22;
constexpr size_t kMaxMeshes = kMaxVertices;
constexpr uint32_t kMaxAtlasSide = 8192;
constexpr int32_t kMaxQuantised = (1 << 30) - 1;

template <typename... Args>
Status bad(const Args&... args) {
  return absl::InvalidArgumentError(absl::StrCat("meta frame: ", args...));
}

Status check_count(const char* what, size_t count, size_t limit) {
  if (count <= limit) return absl::OkStatus();
  return bad("the ", what, " would be ", count, ", the limit is ", limit);
}

Status check_id(const char* what, size_t entry, size_t id, size_t held) {
  if (id < held) return absl::OkStatus();
  return bad(what, " of entry ", entry, " is ", id, ", but only ", held, " are known");
}

Status check_side(const char* what, uint32_t texels) {
  if (texels > 0 && texels % 2 == 0 && texels <= kMaxAtlasSide) return absl::OkStatus();
  return bad(what, " is ", texels, "; it must be even, above 0 and at most ", kMaxAtlasSide);
}

Status check_mesh(size_t entry, const NewMesh& mesh) {
  if (!(mesh.step > 0) || !std::isfinite(mesh.step))
    return bad("meshes.step of entry ", entry, " is ", mesh.step);
  for (double offset : mesh.offset) {
    if (!std::isfinite(offset)) return bad("meshes.offset of entry ", entry, " is ", offset);
  }
  return absl::OkStatus();
}

Status check_vertex(size_t entry, const NewVertex& vertex, const std::vector<NewMesh>& meshes) {
  TESSERA_RETURN_IF_ERROR(check_id("vertices.mesh", entry, vertex.mesh, meshes.size()));
  const NewMesh& mesh = meshes[vertex.mesh];
  for (int i = 0; i < 3; ++i) {
    if (vertex.q[i] > kMaxQuantised || vertex.q[i] < -kMaxQuantised) {
      return bad("vertices.q of entry ", entry, " is ", vertex.q[i], ", the limit is 2^30");
    }
    const double position = mesh.offset[i] + mesh.step * vertex.q[i];
    if (!(std::abs(position) <= std::numeric_limits<float>::max())) {
      return bad("vertices.q of entry ", entry, " lies at ", position, " m, outside the range of float");
    }
  }
  return absl::OkStatus();
}

Status check_transform(const char* what, size_t entry, const Transform& transform) {
  for (float v : transform.linear) {
    if (!std::isfinite(v)) return bad(what, ".linear of entry ", entry, " is ", v);
  }
  for (double v : transform.translation) {
    if (!std::isfinite(v)) return bad(what, ".translation of entry ", entry, " is ", v);
  }
  return absl::OkStatus();
}

Status check_patch(size_t entry, const NewPatch& patch, size_t vertices, size_t objects) {
  if (patch.triangles < 1 || patch.triangles > 3) {
    return bad("patches.triangles of entry ", entry, " is ", int{patch.triangles}, "; it must be 1 to 3");
  }
  TESSERA_RETURN_IF_ERROR(check_id("patches.object", entry, patch.object, objects));
  for (int i = 0; i < patch.triangles + 2; ++i) {
    TESSERA_RETURN_IF_ERROR(check_id("patches.vertices", entry, patch.vertices[i], vertices));
  }
  return absl::OkStatus();
}

Status check_spacing(size_t entry, const PatchPlacement& p) {
  for (const int code : p.spacing) {
    if (code < -126 || code > 126)
      return bad("placements.spacing of entry ", entry, " is ", code, ", not within -126..126");
  }
  return absl::OkStatus();
}

Status check_block(size_t entry, const PatchPlacement& p, uint32_t atlas_width, uint32_t atlas_height) {
  for (const uint32_t side : {p.width, p.height}) {
    if (side < 2 || side > geometry_compression::kMaxBlockSide || side % 2 != 0)
      return bad("placements.width, height of entry ", entry, " are ", p.width, ", ", p.height,
                 "; they must be even, 2 to ", geometry_compression::kMaxBlockSide);
  }
  if (p.x % 2 != 0 || p.y % 2 != 0 || p.x + p.width > atlas_width || p.y + p.height > atlas_height) {
    return bad("placements.x, y of entry ", entry, " are ", p.x, ", ", p.y, ": a block of ", p.width, "x",
               p.height, " must lie at even texels inside the atlas of ", atlas_width, "x", atlas_height);
  }
  return absl::OkStatus();
}

Status check_l(size_t entry, const PatchPlacement& p, bool masked, int atlas_width, int atlas_height) {
  const int level = p.l.level, splits = p.l.splits;
  if (level < 1 || level > addressing::kMaxTessellationLevel || splits < 1 ||
      splits > addressing::kMaxSplits) {
    return bad("placements.l of entry ", entry, " has level ", level, " and splits ", splits,
               "; they must be 1 to ", addressing::kMaxTessellationLevel, " and 1 to ",
               addressing::kMaxSplits);
  }
  if (p.x % 2 != 0 || p.y % 2 != 0 || p.l.next_y % 2 != 0 || (masked && p.l.turned))
    return bad("placements.l of entry ", entry, " lies at ", p.x, ", ", p.y, ", next row ", p.l.next_y,
               "; they must be even, and a masked one not turned");
  const glm::ivec2 pair = addressing::l_pair_pitch(level);
  // Of the first pair and the last; a row between them lies between them.
  const int halves = masked ? 2 * splits * splits : splits * splits + p.l.turned;
  bool inside = p.x + pair.x <= atlas_width && p.y + pair.y <= atlas_height;
  if (inside) {
    const glm::ivec2 last =
        addressing::l_pair_place((halves - 1) / 2, {p.x, p.y}, p.l.next_y, level, atlas_width);
    inside = last.y + pair.y <= atlas_height;
  }
  if (!inside)
    return bad("placements.l of entry ", entry, " at ", p.x, ", ", p.y, ", next row ", p.l.next_y,
               ": its Ls must lie inside the atlas of ", atlas_width, "x", atlas_height);
  return absl::OkStatus();
}

Status check_halves(size_t entry, const PatchPlacement& p, int atlas_width, int atlas_height) {
  const auto& h = p.halves;
  if (h.apex > 2 || h.foot >= geometry_compression::kFeet || h.across < 1 ||
      h.across > addressing::kMaxHalfWidth) {
    return bad("placements.halves of entry ", entry, " has apex ", int{h.apex}, ", foot ", int{h.foot},
               " and across ", int{h.across}, "; they must be 0 to 2, 0 to 63 and 1 to ",
               addressing::kMaxHalfWidth);
  }
  for (const auto& half : h.half) {
    if (half.along < 1 || half.along > addressing::kMaxHalfLength)
      return bad("placements.halves.along of entry ", entry, " is ", half.along, "; it must be 1 to ",
                 addressing::kMaxHalfLength);
    const glm::ivec2 size = addressing::half_staircase(h.across, half.along);
    if (half.y % 2 != 0 || half.x + size.y + 1 > atlas_width || half.y + size.x + 1 > atlas_height)
      return bad("placements.halves of entry ", entry, " at ", half.x, ", ", half.y,
                 ": y must be even, and it must lie inside the atlas of ", atlas_width, "x", atlas_height);
  }
  return absl::OkStatus();
}

// Kinds none and block are for whole patches, l and halves for triangles of them, colours for both.
Status check_part(size_t entry, const PatchPlacement& p, uint8_t triangles) {
  const bool of_triangle = p.kind == PlacementKind::l || p.kind == PlacementKind::halves;
  const uint8_t least = of_triangle ? 1 : 0;
  const uint8_t most = of_triangle || p.kind == PlacementKind::color ? triangles : 0;
  if (p.part >= least && p.part <= most) return absl::OkStatus();
  return bad("placements.part of entry ", entry, " is ", int{p.part}, "; with its kind and patch it must be ",
             int{least}, " to ", int{most});
}

}  // namespace

Status MetaChecker::check_placement(size_t entry, const PatchPlacement& p, const Holdings& held) {
  TESSERA_RETURN_IF_ERROR(check_id("placements.patch", entry, p.patch, held.patches.size()));
  const PatchTraits& patch = held.patches[p.patch];
  TESSERA_RETURN_IF_ERROR(check_part(entry, p, patch.triangles));
  TESSERA_RETURN_IF_ERROR(check_spacing(entry, p));
  switch (p.kind) {
    case PlacementKind::none:
      return absl::OkStatus();
    case PlacementKind::block:
      return check_block(entry, p, held.atlas_width, held.atlas_height);
    case PlacementKind::l:
      return check_l(entry, p, patch.masked, held.atlas_width, held.atlas_height);
    case PlacementKind::halves:
      return check_halves(entry, p, held.atlas_width, held.atlas_height);
    case PlacementKind::color:
      if (p.rgb > 0xffffff) return bad("placements.rgb of entry ", entry, " is ", p.rgb, ", above 0xffffff");
      return absl::OkStatus();
  }
  return bad("placements.kind of entry ", entry, " is ", static_cast<int>(p.kind), "; it must be 0 to 4");
}

Status MetaChecker::check(const MetaFrame& frame) {
  if (newest_ && !is_newer(frame.frame, *newest_)) {
    complete_ = false;
    return bad("frame is ", frame.frame, ", not newer than ", *newest_, " before it");
  }
  if (!complete_ && !frame.full_state) {
    return absl::DataLossError(
        absl::StrCat("meta frame ", frame.frame,
                     " builds on a frame that is missing or was damaged; waiting for one with full_state"));
  }
  Holdings holdings = frame.full_state ? Holdings{} : std::move(holdings_);
  const Status status = check_content(frame, holdings);
  holdings_ = std::move(holdings);
  newest_ = frame.frame;
  complete_ = status.ok();
  return status;
}

Status MetaChecker::check_content(const MetaFrame& frame, Holdings& held) {
  TESSERA_RETURN_IF_ERROR(check_side("atlas_width", frame.atlas_width));
  TESSERA_RETURN_IF_ERROR(check_side("atlas_height", frame.atlas_height));
  if (!frame.full_state &&
      (frame.atlas_width != held.atlas_width || frame.atlas_height != held.atlas_height)) {
    return bad("the atlas is ", frame.atlas_width, "x", frame.atlas_height, " after ", held.atlas_width, "x",
               held.atlas_height, "; its size may change only with full_state");
  }
  TESSERA_RETURN_IF_ERROR(check_count("meshes", held.meshes.size() + frame.meshes.size(), kMaxMeshes));
  TESSERA_RETURN_IF_ERROR(check_count("vertices", held.vertices + frame.vertices.size(), kMaxVertices));
  TESSERA_RETURN_IF_ERROR(check_count("objects", held.masked.size() + frame.objects.size(), kMaxObjects));
  TESSERA_RETURN_IF_ERROR(check_count("patches", held.patches.size() + frame.patches.size(), kMaxPatches));
  held.atlas_width = frame.atlas_width;
  held.atlas_height = frame.atlas_height;
  held.meshes.insert(held.meshes.end(), frame.meshes.begin(), frame.meshes.end());
  held.vertices += frame.vertices.size();
  for (const auto& object : frame.objects) held.masked.push_back(object.masked);

  size_t entry = 0;
  for (const auto& mesh : frame.meshes) TESSERA_RETURN_IF_ERROR(check_mesh(entry++, mesh));
  entry = 0;
  for (const auto& vertex : frame.vertices)
    TESSERA_RETURN_IF_ERROR(check_vertex(entry++, vertex, held.meshes));
  entry = 0;
  for (const auto& object : frame.objects) {
    TESSERA_RETURN_IF_ERROR(check_transform("objects", entry++, object.transform));
  }
  entry = 0;
  for (const auto& moved : frame.moved) {
    TESSERA_RETURN_IF_ERROR(check_id("moved.object", entry, moved.object, held.masked.size()));
    TESSERA_RETURN_IF_ERROR(check_transform("moved", entry++, moved.transform));
  }
  entry = 0;
  for (const auto& patch : frame.patches) {
    TESSERA_RETURN_IF_ERROR(check_patch(entry++, patch, held.vertices, held.masked.size()));
    held.patches.push_back({patch.triangles, held.masked[patch.object]});
  }
  entry = 0;
  for (const auto& placement : frame.placements) {
    TESSERA_RETURN_IF_ERROR(check_placement(entry++, placement, held));
  }
  return absl::OkStatus();
}

}  // namespace tessera::client
