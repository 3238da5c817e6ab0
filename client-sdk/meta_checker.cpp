#include "client-sdk/meta_checker.h"

#include <cmath>
#include <cstdlib>

namespace tessera::client {
namespace {

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
  for (const int code : p.spacing) {
    if (code < -126 || code > 126)
      return bad("placements.spacing of entry ", entry, " is ", code, ", not within -126..126");
  }
  return absl::OkStatus();
}

Status check_placement(size_t entry, const PatchPlacement& p, size_t patches, const MetaFrame& frame) {
  TESSERA_RETURN_IF_ERROR(check_id("placements.patch", entry, p.patch, patches));
  switch (p.kind) {
    case PlacementKind::none:
      return absl::OkStatus();
    case PlacementKind::block:
      return check_block(entry, p, frame.atlas_width, frame.atlas_height);
    case PlacementKind::color:
      if (p.rgb > 0xffffff) return bad("placements.rgb of entry ", entry, " is ", p.rgb, ", above 0xffffff");
      return absl::OkStatus();
  }
  return bad("placements.kind of entry ", entry, " is ", static_cast<int>(p.kind), "; it must be 0 to 2");
}

}  // namespace

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
  TESSERA_RETURN_IF_ERROR(check_count("objects", held.objects + frame.objects.size(), kMaxObjects));
  TESSERA_RETURN_IF_ERROR(check_count("patches", held.patches + frame.patches.size(), kMaxPatches));
  held.atlas_width = frame.atlas_width;
  held.atlas_height = frame.atlas_height;
  held.meshes.insert(held.meshes.end(), frame.meshes.begin(), frame.meshes.end());
  held.vertices += frame.vertices.size();
  held.objects += frame.objects.size();
  held.patches += frame.patches.size();

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
    TESSERA_RETURN_IF_ERROR(check_id("moved.object", entry, moved.object, held.objects));
    TESSERA_RETURN_IF_ERROR(check_transform("moved", entry++, moved.transform));
  }
  entry = 0;
  for (const auto& patch : frame.patches) {
    TESSERA_RETURN_IF_ERROR(check_patch(entry++, patch, held.vertices, held.objects));
  }
  entry = 0;
  for (const auto& placement : frame.placements) {
    TESSERA_RETURN_IF_ERROR(check_placement(entry++, placement, held.patches, frame));
  }
  return absl::OkStatus();
}

}  // namespace tessera::client
