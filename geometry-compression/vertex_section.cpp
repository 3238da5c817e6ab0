// Vertices: the difference to a prediction. The patch that uses a vertex first tells what it is near: with
// three corners known the fourth closes a parallelogram; else its edges are like those of the patch before;
// else it lies near their mean; else near the mesh's last vertex.
#include <algorithm>
#include <array>
#include <optional>

#include "geometry-compression/columns.h"
#include "geometry-compression/sections.h"

namespace tessera::geometry_compression {
namespace {

constexpr int32_t kMaxCoordinate = (1 << 30) - 1;
constexpr uint32_t kNobody = UINT32_MAX;

// For each corner of each kind of patch: a + b - c of other corners, where all three are known (meta_frame.h:
// NewPatch).
struct Parallelogram {
  int8_t a, b, c;
};
constexpr Parallelogram kPair[4] = {{1, 2, 3}, {0, 3, 2}, {0, 3, 1}, {1, 2, 0}};
constexpr Parallelogram kThree[5] = {{1, 3, 4}, {0, 4, 3}, {3, 4, 2}, {0, 4, 1}, {1, 3, 0}};

using Position = std::array<int64_t, 3>;  // 64 bits hold every sum; residuals wrap modulo 2^32

class VertexPredictor {
 public:
  VertexPredictor(std::span<const NewPatch> patches, uint32_t first_vertex, uint32_t count)
      : patches_(patches), first_vertex_(first_vertex), first_use_(count, kNobody) {
    for (uint32_t p = 0; p < patches.size(); ++p)
      for (int corner = 0; corner < corner_count(patches[p]); ++corner) {
        const uint32_t index = patches[p].vertices[corner] - first_vertex;
        if (index < count && first_use_[index] == kNobody) first_use_[index] = p;
      }
  }

  // The prediction for vertex `known.size()` of `mesh`, from those before it.
  Position predict(std::span<const NewVertex> known, uint32_t mesh) const {
    const auto index = static_cast<uint32_t>(known.size());
    if (const uint32_t use = first_use_[index]; use != kNobody) {
      const int wanted = corner_of(patches_[use], first_vertex_ + index);
      const Corners here = known_corners(use, known, mesh);
      if (const auto p = close_parallelogram(patches_[use].triangles, wanted, here)) return *p;
      if (use > 0)
        if (const auto p = like_before(wanted, here, known_corners(use - 1, known, mesh))) return *p;
      if (const auto p = mean(here)) return *p;
    }
    if (index > 0 && known[index - 1].mesh == mesh) return position(known[index - 1]);
    return {};
  }

 private:
  using Corners = std::array<const NewVertex*, kMaxCorners>;  // nullptr = not known

  static Position position(const NewVertex& v) { return {v.q[0], v.q[1], v.q[2]}; }
  static int corner_of(const NewPatch& patch, uint32_t id) {
    return static_cast<int>(std::find(patch.vertices.begin(), patch.vertices.end(), id) -
                            patch.vertices.begin());
  }

  Corners known_corners(uint32_t patch, std::span<const NewVertex> known, uint32_t mesh) const {
    Corners corners{};
    for (int i = 0; i < corner_count(patches_[patch]); ++i) {
      const uint32_t index = patches_[patch].vertices[i] - first_vertex_;
      if (index < known.size() && known[index].mesh == mesh) corners[i] = &known[index];
    }
    return corners;
  }

  static std::optional<Position> close_parallelogram(int triangles, int wanted, const Corners& here) {
    if (triangles == 1) return std::nullopt;
    const Parallelogram& p = triangles == 2 ? kPair[wanted] : kThree[wanted];
    if (!here[p.a] || !here[p.b] || !here[p.c]) return std::nullopt;
    Position sum{};
    for (int axis = 0; axis < 3; ++axis)
      sum[axis] = int64_t{here[p.a]->q[axis]} + here[p.b]->q[axis] - here[p.c]->q[axis];
    return sum;
  }

  // The mean of: a known corner, plus the edge from it to the wanted one in the patch before.
  static std::optional<Position> like_before(int wanted, const Corners& here, const Corners& before) {
    if (!before[wanted]) return std::nullopt;
    Position sum{};
    int count = 0;
    for (int i = 0; i < kMaxCorners; ++i) {
      if (!here[i] || !before[i]) continue;
      ++count;
      for (int axis = 0; axis < 3; ++axis)
        sum[axis] += int64_t{here[i]->q[axis]} + before[wanted]->q[axis] - before[i]->q[axis];
    }
    if (count == 0) return std::nullopt;
    for (int64_t& s : sum) s /= count;
    return sum;
  }

  static std::optional<Position> mean(const Corners& here) {
    Position sum{};
    int count = 0;
    for (const NewVertex* v : here) {
      if (!v) continue;
      ++count;
      for (int axis = 0; axis < 3; ++axis) sum[axis] += v->q[axis];
    }
    if (count == 0) return std::nullopt;
    for (int64_t& s : sum) s /= count;
    return sum;
  }

  std::span<const NewPatch> patches_;
  uint32_t first_vertex_;
  std::vector<uint32_t> first_use_;  // patch that names the vertex first
};

}  // namespace

void write_vertices(BitWriter& out, std::span<const NewVertex> vertices, std::span<const NewPatch> patches,
                    uint32_t first_vertex) {
  const VertexPredictor predictor(patches, first_vertex, static_cast<uint32_t>(vertices.size()));
  std::array<std::vector<uint32_t>, 3> residuals;
  std::vector<uint32_t> meshes;
  for (size_t i = 0; i < vertices.size(); ++i) {
    const auto prediction = predictor.predict(vertices.first(i), vertices[i].mesh);
    for (int axis = 0; axis < 3; ++axis)
      residuals[axis].push_back(
          delta(static_cast<uint32_t>(vertices[i].q[axis]), static_cast<uint32_t>(prediction[axis])));
    meshes.push_back(vertices[i].mesh);
  }
  for (const auto& column : residuals) write_column(out, column);
  write_repeats(out, meshes);
}

std::string read_vertices(BitReader& in, uint32_t count, std::span<const NewPatch> patches,
                          uint32_t first_vertex, std::vector<NewVertex>& vertices) {
  std::array<std::vector<uint32_t>, 3> residuals;
  for (auto& column : residuals) {
    column = read_column(in, count);
    if (!in.ok()) return {};
  }
  vertices.resize(count);
  uint32_t next = 0;
  if (!read_repeats(in, count, [&](uint32_t length, uint32_t mesh) {
        for (; length > 0; --length) vertices[next++].mesh = mesh;
      }))
    return "vertices: the runs of meshes do not add up to their number";

  const VertexPredictor predictor(patches, first_vertex, count);
  for (uint32_t i = 0; i < count; ++i) {
    NewVertex& vertex = vertices[i];
    const auto prediction = predictor.predict(std::span(vertices).first(i), vertex.mesh);
    for (int axis = 0; axis < 3; ++axis) {
      vertex.q[axis] =
          static_cast<int32_t>(undelta(residuals[axis][i], static_cast<uint32_t>(prediction[axis])));
      if (vertex.q[axis] < -kMaxCoordinate || vertex.q[axis] > kMaxCoordinate)
        return "vertex " + std::to_string(i) + ": a coordinate is not below 2^30";
    }
  }
  return {};
}

}  // namespace tessera::geometry_compression
