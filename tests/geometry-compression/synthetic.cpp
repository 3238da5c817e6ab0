#include "synthetic.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace tessera::geometry_compression {
namespace {

using Random = std::mt19937;

uint32_t below(Random& random, uint32_t end) {
  return std::uniform_int_distribution<uint32_t>(0, end - 1)(random);
}

// Magnitudes of every order are equally likely.
uint32_t any_u32(Random& random) {
  return static_cast<uint32_t>(random() >> below(random, 32));
}
int32_t any_coordinate(Random& random) {
  const auto magnitude = static_cast<int32_t>((random() & 0x3fffffff) >> below(random, 30));
  return below(random, 2) ? magnitude : -magnitude;
}
double any_double(Random& random) {
  const double sign = below(random, 2) ? 1 : -1;
  return sign * std::ldexp(1 + below(random, 1000) / 1000.0, static_cast<int>(below(random, 2000)) - 1000);
}

Transform any_transform(Random& random) {
  Transform t;
  for (float& f : t.linear)
    if (below(random, 2)) f = static_cast<float>(below(random, 2000)) / 7 - 100;
  for (double& d : t.translation)
    if (below(random, 2)) d = any_double(random);
  return t;
}

PatchPlacement any_placement(Random& random) {
  PatchPlacement p;
  p.kind = static_cast<PlacementKind>(below(random, 3));
  if (p.kind == PlacementKind::block) {
    p.x = static_cast<uint16_t>(2 * below(random, 4096));
    p.y = static_cast<uint16_t>(2 * below(random, 4096));
    p.width = static_cast<uint16_t>(2 + 2 * below(random, 128));
    p.height = static_cast<uint16_t>(2 + 2 * below(random, 128));
    p.transposed = below(random, 2) != 0;
    for (int8_t& code : p.spacing) code = static_cast<int8_t>(static_cast<int>(below(random, 253)) - 126);
  } else if (p.kind == PlacementKind::color) {
    p.rgb = static_cast<uint32_t>(random() & 0xffffff);
  }
  return p;
}

// Of a triangle.
PatchPlacement any_part_placement(Random& random) {
  constexpr PlacementKind kKinds[] = {PlacementKind::color, PlacementKind::l, PlacementKind::halves};
  PatchPlacement p;
  p.kind = kKinds[below(random, 3)];
  const auto position = [&] { return static_cast<uint16_t>(2 * below(random, 4096)); };
  if (p.kind == PlacementKind::color) {
    p.rgb = static_cast<uint32_t>(random() & 0xffffff);
    return p;
  }
  for (size_t i = 0; i < 2; ++i)
    p.spacing[i] = static_cast<int8_t>(static_cast<int>(below(random, 253)) - 126);
  if (p.kind == PlacementKind::l) {
    p.x = position();
    p.y = position();
    p.l.level = static_cast<uint8_t>(1 + below(random, 64));
    p.l.splits = static_cast<uint8_t>(below(random, 3) ? 1 : 2 + below(random, 30));
    p.l.turned = below(random, 2) != 0;
    p.l.next_y = p.l.splits > 1 ? position() : uint16_t{0};
    return p;
  }
  p.halves.apex = static_cast<uint8_t>(below(random, 3));
  p.halves.foot = static_cast<uint8_t>(below(random, 64));
  p.halves.across = static_cast<uint8_t>(1 + below(random, 128));
  for (HalfPlacement& half : p.halves.half)
    half = {static_cast<uint16_t>(below(random, 8192)), position(),
            static_cast<uint16_t>(1 + below(random, 1024)), below(random, 2) != 0};
  return p;
}

std::vector<uint32_t> sorted_ids(Random& random, uint32_t count) {
  std::vector<uint32_t> ids(count);
  for (uint32_t& id : ids) id = any_u32(random);
  std::sort(ids.begin(), ids.end());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
  return ids;
}

NewPatch any_patch(Random& random, const NewPatch& previous) {
  NewPatch p;
  p.object = below(random, 4) ? previous.object : any_u32(random);
  p.triangles = static_cast<uint8_t>(1 + below(random, 3));
  for (int corner = 0; corner < p.triangles + 2; ++corner)
    p.vertices[corner] =
        below(random, 2) ? any_u32(random) : previous.vertices[below(random, 5)] + below(random, 3);
  return p;
}

}  // namespace

MetaFrame random_frame(Random& random, uint32_t max_items) {
  const auto count = [&] { return below(random, 5) ? below(random, max_items + 1) : 0; };
  MetaFrame f;
  f.frame = any_u32(random);
  f.rtp_timestamp = any_u32(random);
  f.atlas_width = static_cast<uint16_t>(2 * below(random, 4097));
  f.atlas_height = static_cast<uint16_t>(2 * below(random, 4097));
  f.full_state = below(random, 2) != 0;
  f.meshes.resize(count());
  for (NewMesh& m : f.meshes) m = {{any_double(random), any_double(random), 0}, std::abs(any_double(random))};
  f.vertices.resize(count());
  for (NewVertex& v : f.vertices) {
    v.mesh = below(random, 4) ? 0 : any_u32(random);
    for (int32_t& q : v.q) q = any_coordinate(random);
  }
  f.objects.resize(count());
  for (NewObject& o : f.objects)
    o = {any_transform(random), below(random, 2) != 0, below(random, 2) != 0, below(random, 2) != 0};
  for (uint32_t id : sorted_ids(random, count())) f.moved.push_back({id, any_transform(random)});
  for (uint32_t n = count(); n > 0; --n)
    f.patches.push_back(any_patch(random, f.patches.empty() ? NewPatch{} : f.patches.back()));
  const bool has_parts = below(random, 3) == 0;
  for (uint32_t id : sorted_ids(random, count())) {
    const uint32_t part = has_parts ? id % 4 : 0;
    f.placements.push_back(part ? any_part_placement(random) : any_placement(random));
    f.placements.back().patch = has_parts ? id / 4 : id;
    f.placements.back().part = static_cast<uint8_t>(part);
  }
  return f;
}

namespace {

// Where column-wise packing has come to, for one block width.
struct Column {
  uint32_t x = 0, y = 2048;
};

// Blocks of one width fill columns of the atlas from top to bottom.
class ColumnPacker {
 public:
  PatchPlacement place(uint8_t log_w, uint8_t log_h) {
    Column& column = columns_[log_w];
    if (column.y + (1u << log_h) > 2048) {
      next_x_ = (next_x_ + (1u << log_w) - 1) >> log_w << log_w;
      column = {next_x_ % 8192, 0};
      next_x_ += 1u << log_w;
    }
    column.y = (column.y + (1u << log_h) - 1) >> log_h << log_h;
    PatchPlacement p;
    p.kind = PlacementKind::block;
    p.x = static_cast<uint16_t>(column.x);
    p.y = static_cast<uint16_t>(column.y % 2048);
    p.width = static_cast<uint16_t>(1u << log_w);
    p.height = static_cast<uint16_t>(1u << log_h);
    column.y += 1u << log_h;
    return p;
  }

 private:
  std::map<uint8_t, Column> columns_;
  uint32_t next_x_ = 0;
};

std::array<int32_t, 3> torus_point(uint32_t i, uint32_t j, uint32_t side) {
  const double u = 6.283185307 * i / side, v = 6.283185307 * j / side;
  const double r = 0.3 + 0.03 * std::sin(7 * u) * std::cos(5 * v) + 0.001 * std::sin(61 * u + 43 * v);
  const double ring = 1 + r * std::cos(v);
  const auto quantised = [](double x) { return static_cast<int32_t>(std::lround(x * 6000)); };
  return {quantised(ring * std::cos(u)), quantised(r * std::sin(v)), quantised(ring * std::sin(u))};
}

class TorusBuilder {
 public:
  TorusBuilder(MetaFrame& frame, Random& random, uint32_t side)
      : frame_(frame), random_(random), side_(side) {}

  void add_pair(uint32_t i, uint32_t j) {
    const uint32_t a = vertex(i, j), b = vertex(i + 1, j), c = vertex(i, j + 1), d = vertex(i + 1, j + 1);
    if (below(random_, 10) == 0) {
      frame_.patches.push_back({0, 1, {a, b, c}});
      frame_.patches.push_back({0, 1, {d, c, b}});
    } else {
      frame_.patches.push_back({0, 2, {a, b, c, d}});
    }
  }

 private:
  uint32_t vertex(uint32_t i, uint32_t j) {
    i %= side_, j %= side_;
    const auto [entry, is_new] = ids_.try_emplace({i, j}, static_cast<uint32_t>(frame_.vertices.size()));
    if (is_new) frame_.vertices.push_back({0, torus_point(i, j, side_)});
    return entry->second;
  }

  MetaFrame& frame_;
  Random& random_;
  uint32_t side_;
  std::map<std::pair<uint32_t, uint32_t>, uint32_t> ids_;
};

}  // namespace

MetaFrame torus_frame(Random& random, uint32_t side) {
  constexpr uint32_t kCluster = 8;
  MetaFrame f;
  f.full_state = true;
  f.atlas_width = 8192;
  f.atlas_height = 2048;
  f.meshes.push_back({{0, 0, 0}, 1.0 / 6000});
  f.objects.emplace_back();
  std::vector<std::pair<uint32_t, uint32_t>> clusters;
  for (uint32_t i = 0; i < side; i += kCluster)
    for (uint32_t j = 0; j < side; j += kCluster) clusters.emplace_back(i, j);
  std::shuffle(clusters.begin(), clusters.end(), random);
  TorusBuilder builder(f, random, side);
  for (const auto& [i0, j0] : clusters)
    for (uint32_t j = j0; j < j0 + kCluster; ++j)
      for (uint32_t i = i0; i < i0 + kCluster; ++i) builder.add_pair(i, j);

  ColumnPacker packer;
  for (uint32_t patch = 0; patch < f.patches.size(); ++patch) {
    PatchPlacement p;
    if (below(random, 8) == 0) {
      p.kind = PlacementKind::color;
      p.rgb = 0x606060 + below(random, 24) * 0x010101 + below(random, 6);
    } else {
      const auto log_w = static_cast<uint8_t>(2 + below(random, 4) * below(random, 4) / 3);
      p = packer.place(log_w, static_cast<uint8_t>(log_w - below(random, 2)));
      p.transposed = below(random, 2) != 0;
    }
    p.patch = patch;
    f.placements.push_back(p);
  }
  return f;
}

}  // namespace tessera::geometry_compression
