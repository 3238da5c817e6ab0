// Patches: whose they are, how many triangles, and which vertices. A vertex id is named by a rule: the next
// new vertex, a corner of the patch before, … Each corner keeps its rules in the order of their last use, so
// that the regular parts of a mesh take about one bit a corner. Corners of one patch have mostly come one
// soon after the other, so what no rule names is near another corner of the same patch.
#include <algorithm>
#include <numeric>

#include "geometry-compression/columns.h"
#include "geometry-compression/sections.h"

namespace tessera::geometry_compression {
namespace {

// Rules by number: 0 = the newest vertex + 1; 1..5 = corner 0..4 of the patch before; 6, 7 = 1 after, 1
// before the same corner of the patch before; 8, 9 = 1 after, 1 before the corner before, 10, 11 = the one
// before that; 12 = spelled out, as difference to predicted().
constexpr int kRules = 13;
constexpr int kSpelledOut = 12;

class CornerRules {
 public:
  explicit CornerRules(uint32_t first_vertex) : next_new_(first_vertex) {
    last_.fill(first_vertex);
    for (auto& order : order_) std::iota(order.begin(), order.end(), uint8_t{0});
  }

  // For all that follow: `v` are the vertices of the patch, of which those of corners below `corner` count.
  using Vertices = std::array<uint32_t, kMaxCorners>;

  // Corner 3 closes the parallelogram of a patch of two triangles (meta_frame.h); of three it is a guess.
  uint32_t predicted(const Vertices& v, int corner) const {
    if (corner == 0) return last_[0];
    if (corner == 3) return v[1] + v[2] - v[0];
    return corner == 4 ? v[3] : v[0];
  }
  // The id that `rule` (not kSpelledOut) names.
  uint32_t named(int rule, const Vertices& v, int corner) const {
    if (rule == 0) return next_new_;
    if (rule <= kMaxCorners) return last_[rule - 1];
    const uint32_t base = rule < 8    ? last_[corner]
                          : rule < 10 ? here_or_last(v, corner, 1)
                                      : here_or_last(v, corner, 2);
    return rule % 2 == 0 ? base + 1 : base - 1;
  }
  int rule_at(int rank, int corner) const { return order_[corner][rank]; }
  // The first rank whose rule names the corner's id.
  int rank_of(const Vertices& v, int corner) const {
    int spelled_out = 0;
    for (int rank = 0; rank < kRules; ++rank) {
      const int rule = rule_at(rank, corner);
      if (rule == kSpelledOut)
        spelled_out = rank;
      else if (named(rule, v, corner) == v[corner])
        return rank;
    }
    return spelled_out;
  }
  void used(int rank, uint32_t id, int corner) {
    auto& order = order_[corner];
    if (id == next_new_) ++next_new_;
    std::rotate(order.begin(), order.begin() + rank, order.begin() + rank + 1);
  }
  void end_patch(const NewPatch& patch) {
    std::copy_n(patch.vertices.begin(), corner_count(patch), last_.begin());
  }

 private:
  // The corner that is `back` before this one; where the patch has none, this one of the patch before.
  uint32_t here_or_last(const Vertices& v, int corner, int back) const {
    return corner >= back ? v[corner - back] : last_[corner];
  }

  uint32_t next_new_;
  Vertices last_{};  // of the last patch that has the corner
  std::array<std::array<uint8_t, kRules>, kMaxCorners> order_{};
};

}  // namespace

uint32_t guess_first_vertex(const MetaFrame& frame) {
  // New vertices come with the patches that need them, so the highest id in use is the newest vertex.
  uint32_t highest = 0;
  for (const NewPatch& patch : frame.patches)
    highest = std::max(highest, *std::max_element(patch.vertices.begin(), patch.vertices.end()));
  const auto count = static_cast<uint32_t>(frame.vertices.size());
  return frame.patches.empty() || highest < count ? 0 : highest - count + 1;
}

void write_patches(BitWriter& out, std::span<const NewPatch> patches, uint32_t first_vertex) {
  std::vector<uint32_t> objects, triangles, spelled_out;
  std::array<std::vector<uint32_t>, kMaxCorners> ranks;
  CornerRules rules(first_vertex);
  uint32_t previous_triangles = 2;
  for (const NewPatch& patch : patches) {
    objects.push_back(patch.object);
    triangles.push_back(delta(patch.triangles, previous_triangles));
    previous_triangles = patch.triangles;
    for (int corner = 0; corner < corner_count(patch); ++corner) {
      const int rank = rules.rank_of(patch.vertices, corner);
      if (rules.rule_at(rank, corner) == kSpelledOut)
        spelled_out.push_back(delta(patch.vertices[corner], rules.predicted(patch.vertices, corner)));
      ranks[corner].push_back(static_cast<uint32_t>(rank));
      rules.used(rank, patch.vertices[corner], corner);
    }
    rules.end_patch(patch);
  }
  write_column(out, triangles);
  write_repeats(out, objects);
  for (const auto& column : ranks) write_column(out, column);
  out.put_unsigned(static_cast<uint32_t>(spelled_out.size()), 4);
  write_column(out, spelled_out);
}

namespace {

std::string read_triangles(BitReader& in, uint32_t count, std::vector<NewPatch>& patches) {
  const auto column = read_column(in, count);
  uint32_t triangles = 2;
  patches.resize(column.size());
  for (size_t i = 0; i < column.size(); ++i) {
    triangles = undelta(column[i], triangles);
    if (in.ok() && (triangles < 1 || triangles > 3))
      return "patch " + std::to_string(i) + ": a patch has 1 to 3 triangles";
    patches[i].triangles = static_cast<uint8_t>(triangles);
  }
  return {};
}

struct CornerColumns {
  std::array<std::vector<uint32_t>, kMaxCorners> ranks;
  std::vector<uint32_t> spelled_out;
};

CornerColumns read_corner_columns(BitReader& in, const std::vector<NewPatch>& patches) {
  CornerColumns columns;
  uint32_t corners = 0;
  for (int corner = 0; corner < kMaxCorners; ++corner) {
    const auto users = static_cast<uint32_t>(std::count_if(
        patches.begin(), patches.end(), [&](const NewPatch& p) { return corner < corner_count(p); }));
    columns.ranks[corner] = read_column(in, users);
    corners += users;
  }
  const uint32_t spelled_out = in.get_unsigned(4);
  if (spelled_out <= corners) columns.spelled_out = read_column(in, spelled_out);
  return columns;
}

}  // namespace

std::string read_patches(BitReader& in, uint32_t count, uint32_t first_vertex,
                         std::vector<NewPatch>& patches) {
  if (std::string error = read_triangles(in, count, patches); !error.empty() || !in.ok()) return error;
  uint32_t next_patch = 0;
  if (!read_repeats(in, count, [&](uint32_t length, uint32_t object) {
        for (; length > 0; --length) patches[next_patch++].object = object;
      }))
    return "patches: the runs of objects do not add up to their number";
  const CornerColumns columns = read_corner_columns(in, patches);
  if (!in.ok()) return {};

  CornerRules rules(first_vertex);
  std::array<size_t, kMaxCorners> next_rank{};
  size_t next_spelled_out = 0;
  for (NewPatch& patch : patches) {
    for (int corner = 0; corner < corner_count(patch); ++corner) {
      const uint32_t rank = columns.ranks[corner][next_rank[corner]++];
      if (rank >= kRules) return "patches: there is no vertex rule " + std::to_string(rank);
      const int rule = rules.rule_at(static_cast<int>(rank), corner);
      if (rule != kSpelledOut) {
        patch.vertices[corner] = rules.named(rule, patch.vertices, corner);
      } else {
        if (next_spelled_out == columns.spelled_out.size()) return "patches: too few spelled-out vertices";
        patch.vertices[corner] =
            undelta(columns.spelled_out[next_spelled_out++], rules.predicted(patch.vertices, corner));
      }
      rules.used(static_cast<int>(rank), patch.vertices[corner], corner);
    }
    rules.end_patch(patch);
  }
  if (next_spelled_out != columns.spelled_out.size()) return "patches: spelled-out vertices that nobody uses";
  return {};
}

}  // namespace tessera::geometry_compression
