#include "server/meta_builder.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <utility>

#include "server/position_index.h"

namespace tessera::server {

namespace gc = geometry_compression;
using scene::kNone;

namespace {

constexpr uint32_t kRgb = 0xffffffu;

bool is_color(const atlas::Placement& p) {
  return p.kind == atlas::PlacementKind::color;
}

gc::Transform to_wire(const dmat4& matrix) {
  gc::Transform t;
  for (int column = 0; column < 3; ++column) {
    for (int row = 0; row < 3; ++row) t.linear[3 * column + row] = static_cast<float>(matrix[column][row]);
    t.translation[column] = matrix[3][column];
  }
  return t;
}

double largest_scale(const dmat4& m) {
  return std::max({glm::length(dvec3(m[0])), glm::length(dvec3(m[1])), glm::length(dvec3(m[2]))});
}

bool differs(uint32_t a, uint32_t b, int threshold) {
  for (int shift = 0; shift < 24; shift += 8) {
    const int da = static_cast<int>((a >> shift) & 0xff), db = static_cast<int>((b >> shift) & 0xff);
    if (std::abs(da - db) > threshold) return true;
  }
  return false;
}

gc::HalvesPlacement to_wire(const atlas::HalvesPlace& halves) {
  gc::HalvesPlacement out{.apex = halves.apex, .foot = halves.foot, .across = halves.across, .half = {}};
  for (size_t i = 0; i < out.half.size(); ++i) {
    const atlas::HalfPlace& half = halves.half[i];
    out.half[i] = {half.x, half.y, half.along, half.turned};
  }
  return out;
}

gc::PatchPlacement to_wire(const atlas::Placement& p, uint32_t patch, uint32_t color) {
  gc::PatchPlacement out;
  out.patch = patch;
  out.part = p.part;
  if (is_color(p)) {
    out.kind = gc::PlacementKind::color;
    out.rgb = color;
    return out;
  }
  out.spacing = p.spacing;
  if (p.kind == atlas::PlacementKind::halves) {
    out.kind = gc::PlacementKind::halves;
    out.halves = to_wire(p.halves);
    return out;
  }
  out.x = p.x;
  out.y = p.y;
  if (p.kind == atlas::PlacementKind::l) {
    out.kind = gc::PlacementKind::l;
    out.l = {p.l.level, p.l.splits, p.l.turned, p.l.splits > 1 ? p.l.next_y : uint16_t{0}};
    return out;
  }
  out.kind = gc::PlacementKind::block;
  out.width = p.width;
  out.height = p.height;
  out.transposed = p.transposed;
  return out;
}

// Of a patch that is not shown, or not as colours.
constexpr std::array<uint32_t, 3> kNoColors{kNone, kNone, kNone};
size_t color_slot(const atlas::Placement& p) {
  return p.part == atlas::kWholePatch ? 0 : p.triangle();
}

}  // namespace

struct MetaBuilder::Impl {
  // What the client knows of one geometry.
  struct Mesh {
    uint32_t id = kNone;
    gc::NewMesh wire;
    PositionIndex positions;           // vertices with equal positions share one wire vertex
    std::vector<uint32_t> vertex_ids;  // by position; kNone = not sent
  };

  const scene::Scene& scene;
  MetaSettings settings;
  std::vector<Mesh> meshes;                    // by geometry
  std::vector<double> scales;                  // by geometry: largest scale of its instances
  std::vector<uint32_t> object_ids;            // by instance
  std::vector<gc::Transform> sent_transforms;  // by instance, of those that move
  std::vector<uint32_t> patch_ids;             // by PatchId
  // By wire patch id, by triangle (of a whole patch: the first); kNone = not shown as a colour.
  std::vector<std::array<uint32_t, 3>> sent_colors;
  uint32_t next_mesh = 0, next_vertex = 0, next_object = 0, next_patch = 0;
  bool first = true;

  Impl(const scene::Scene& s, const MetaSettings& m)
      : scene(s),
        settings(m),
        meshes(s.geometries.size()),
        object_ids(s.instances.size(), kNone),
        sent_transforms(s.instances.size()),
        patch_ids(s.patch_count, kNone) {}

  bool moves(uint32_t instance) const { return scene.nodes[scene.instances[instance].node].moves; }

  // Positions are quantised for a geometry's largest instance.
  void measure_scales(std::span<const dmat4> transforms) {
    scales.assign(meshes.size(), 1e-30);
    for (size_t i = 0; i < transforms.size(); ++i) {
      double& scale = scales[scene.instances[i].geometry];
      scale = std::max(scale, largest_scale(transforms[i]));
    }
  }

  void ensure_mesh(uint32_t geometry, gc::MetaFrame& out) {
    Mesh& mesh = meshes[geometry];
    if (mesh.id != kNone) return;
    const scene::Geometry& g = scene.geometries[geometry];
    const double extent = std::max({g.bounds.extent().x, g.bounds.extent().y, g.bounds.extent().z, 1e-30f});
    // A power of two, so that dequantised positions are exact in float for most scenes; wide enough for 2^29
    // steps.
    const double wish = std::max(settings.position_step_m / scales[geometry], extent / (1 << 29));
    mesh.wire.step = std::exp2(std::floor(std::log2(wish)));
    mesh.wire.offset = {g.bounds.min.x, g.bounds.min.y, g.bounds.min.z};
    mesh.positions = PositionIndex(g.vertices);
    mesh.vertex_ids.assign(mesh.positions.count(), kNone);
    mesh.id = next_mesh++;
    out.meshes.push_back(mesh.wire);
  }

  void ensure_object(uint32_t instance, const dmat4& transform, gc::MetaFrame& out) {
    if (object_ids[instance] != kNone) return;
    const scene::Material& material = scene.materials[scene.instances[instance].material];
    gc::NewObject object;
    object.transform = to_wire(transform);
    object.mirrored = glm::determinant(glm::dmat3(transform)) < 0;
    object.double_sided = material.double_sided;
    object.masked = material.alpha_mode == scene::AlphaMode::mask;
    object_ids[instance] = next_object++;
    sent_transforms[instance] = object.transform;
    out.objects.push_back(object);
  }

  uint32_t ensure_vertex(uint32_t geometry, uint32_t vertex, gc::MetaFrame& out) {
    Mesh& mesh = meshes[geometry];
    uint32_t& id = mesh.vertex_ids[mesh.positions[vertex]];
    if (id != kNone) return id;
    const vec3 p = scene.geometries[geometry].vertices[vertex].position;
    gc::NewVertex wire{mesh.id, {}};
    for (int axis = 0; axis < 3; ++axis) {
      wire.q[axis] = static_cast<int32_t>(std::lround((p[axis] - mesh.wire.offset[axis]) / mesh.wire.step));
    }
    out.vertices.push_back(wire);
    return id = next_vertex++;
  }

  uint32_t ensure_patch(scene::PatchId patch, std::span<const dmat4> transforms, gc::MetaFrame& out) {
    if (patch_ids[patch] != kNone) return patch_ids[patch];
    const uint32_t instance = scene.instance_of(patch);
    const scene::Instance& placed = scene.instances[instance];
    ensure_mesh(placed.geometry, out);
    ensure_object(instance, transforms[instance], out);

    const scene::Geometry& g = scene.geometries[placed.geometry];
    const scene::Patch& source = g.patches[patch - placed.first_patch];
    const uint32_t* corner = &g.indices[3 * source.first_triangle];
    gc::NewPatch wire;
    wire.object = object_ids[instance];
    wire.triangles = static_cast<uint8_t>(source.triangle_count);
    for (int i = 0; i < 3; ++i) wire.vertices[i] = ensure_vertex(placed.geometry, corner[i], out);
    // The corners that the further triangles add (see scene::Patch).
    if (source.triangle_count >= 2) wire.vertices[3] = ensure_vertex(placed.geometry, corner[3], out);
    if (source.triangle_count == 3) wire.vertices[4] = ensure_vertex(placed.geometry, corner[7], out);
    out.patches.push_back(wire);
    sent_colors.push_back(kNoColors);
    return patch_ids[patch] = next_patch++;
  }

  void add_changed(const atlas::LayoutDelta& delta, const Shown& shown, std::span<const dmat4> transforms,
                   gc::MetaFrame& out) {
    size_t at = 0, color = 0;  // in shown.placements, shown.colors
    for (const atlas::Placement& changed : delta.changed) {
      const auto is_it = [&](const atlas::Placement& p) {
        return p.patch == changed.patch && p.part == changed.part;
      };
      for (; !is_it(shown.placements[at]); ++at) color += is_color(shown.placements[at]);
      const uint32_t id = ensure_patch(changed.patch, transforms, out);
      const uint32_t rgb = is_color(changed) ? shown.colors[color] & kRgb : kNone;
      out.placements.push_back(to_wire(changed, id, rgb));
      sent_colors[id][color_slot(changed)] = rgb;
    }
    for (const scene::PatchId removed : delta.removed) {
      const uint32_t id = patch_ids[removed];
      out.placements.push_back({.patch = id, .kind = gc::PlacementKind::none});
      sent_colors[id] = kNoColors;
    }
  }

  // Colours that moved since they were sent. Runs after add_changed, so that changed patches are already up
  // to date.
  void add_recolored(const Shown& shown, gc::MetaFrame& out) {
    size_t color = 0;
    for (const atlas::Placement& placement : shown.placements) {
      if (!is_color(placement)) continue;
      const uint32_t rgb = shown.colors[color++] & kRgb;
      const uint32_t id = patch_ids[placement.patch];
      uint32_t& sent = sent_colors[id][color_slot(placement)];
      if (!differs(sent, rgb, settings.color_threshold)) continue;
      sent = rgb;
      out.placements.push_back(to_wire(placement, id, rgb));
    }
  }

  void add_moved(std::span<const dmat4> transforms, gc::MetaFrame& out) {
    for (uint32_t i = 0; i < object_ids.size(); ++i) {
      if (object_ids[i] == kNone || !moves(i)) continue;
      const gc::Transform now = to_wire(transforms[i]);
      if (now == sent_transforms[i]) continue;
      sent_transforms[i] = now;
      out.moved.push_back({object_ids[i], now});
    }
    std::sort(out.moved.begin(), out.moved.end(),
              [](const auto& a, const auto& b) { return a.object < b.object; });
  }
};

MetaBuilder::MetaBuilder(const scene::Scene& scene, const MetaSettings& settings)
    : impl_(std::make_unique<Impl>(scene, settings)) {}
MetaBuilder::~MetaBuilder() = default;

gc::MetaFrame MetaBuilder::build(FrameNumber frame, const atlas::LayoutDelta& delta, const Shown& shown,
                                 std::span<const dmat4> transforms) {
  gc::MetaFrame out;
  out.frame = frame;
  out.atlas_width = impl_->settings.atlas_width;
  out.atlas_height = impl_->settings.atlas_height;
  out.full_state = std::exchange(impl_->first, false);
  if (out.full_state) impl_->measure_scales(transforms);
  impl_->add_moved(transforms, out);
  impl_->add_changed(delta, shown, transforms, out);
  impl_->add_recolored(shown, out);
  std::sort(out.placements.begin(), out.placements.end(), [](const auto& a, const auto& b) {
    return std::pair(a.patch, a.part) < std::pair(b.patch, b.part);
  });
  return out;
}

}  // namespace tessera::server
