// Geometry: what the catalogue asks of triangles and coordinates.
#include <algorithm>
#include <array>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <limits>

#include "bench/stability_mesh.h"
#include "bench/stability_stage.h"

namespace tessera::bench {
namespace {

using Measures = std::vector<StabilityMeasure>;

constexpr uint32_t kSide = 128;  // of pictures, in pixels
const PictureBounds kSmooth{.color = 3 / 255.0, .why = "colours are linear: atlas, fetch and picture round"};

StatusOr<Measures> measure_mesh(const StabilityContext& context, const StabilityMesh& mesh,
                                const PictureBounds& bounds = kSmooth, const dvec3& eye = dvec3(0)) {
  TESSERA_ASSIGN_OR_RETURN(const ImportedMesh imported, import_mesh(mesh));
  const View view = stability_view(kSide, eye);
  return measure_pictures(context, imported.scene, {&view, 1}, bounds);
}

// Two triangles without area for each cell: one whose corners coincide, one whose corners lie on a line.
StatusOr<Measures> zero_area(const StabilityContext& context) {
  constexpr uint32_t kCells = 12;
  // Steps of 1/16, so that midpoints are exact.
  StabilityMesh mesh = grid_mesh(
      kCells, kCells, [](float u, float v) { return vec3(1.5f * u - 0.75f, 1.5f * v - 0.75f, -1); });
  for (uint32_t j = 0; j < kCells; ++j)
    for (uint32_t i = 0; i < kCells; ++i) {
      const uint32_t a = j * (kCells + 1) + i, b = a + 1;
      const auto middle = static_cast<uint32_t>(mesh.positions.size());
      mesh.positions.push_back(0.5f * (mesh.positions[a] + mesh.positions[b]));
      mesh.colors.push_back(0.5f * (mesh.colors[a] + mesh.colors[b]));
      mesh.add_triangle(a, b, middle);
      mesh.add_triangle(a, a, b);
    }
  TESSERA_ASSIGN_OR_RETURN(const ImportedMesh imported, import_mesh(mesh));
  const View view = stability_view(kSide);
  TESSERA_ASSIGN_OR_RETURN(Measures measures, measure_pictures(context, imported.scene, {&view, 1}, kSmooth));
  const double kept = imported.scene->triangle_count - 2.0 * kCells * kCells;
  measures.push_back({"triangles without area kept", std::abs(kept), 0, "they cover no sample"});
  const bool said = std::ranges::any_of(imported.notes, [](const std::string& note) {
    return note.find("288 triangles without area") != std::string::npos;
  });
  measures.push_back({"notes that are missing", said ? 0.0 : 1.0, 0, "an import says what it changed"});
  return measures;
}

// Strips from top to bottom, so that each triangle is `aspect` times as long as it is wide, in a grid of
// others.
StatusOr<Measures> slivers(const StabilityContext& context, double aspect) {
  std::vector<float> columns = even_steps(8);
  for (int i = 1; i <= 24; ++i) columns.push_back(0.5f + static_cast<float>(i / aspect));
  std::ranges::sort(columns);
  StabilityMesh mesh = grid_mesh(columns, {0, 1}, on_screen);
  // Around 0 floats are fine enough for strips of any width.
  for (size_t i = 0; i < mesh.positions.size(); ++i)
    if (const size_t strip = i % columns.size(); strip > 4 && strip <= 28)
      mesh.positions[i].x = static_cast<float>(1.75 * static_cast<double>(strip - 4) / aspect);
  PictureBounds bounds = kSmooth;
  if (aspect == 1e3) {
    bounds.holes = 2.0 / 448;  // two of the columns of samples
    bounds.holes_why =
        "strips of 0.11 pixels travel in steps of 1/8192 m: samples may come to one that no view hit";
  }
  return measure_mesh(context, mesh, bounds);
}

// Every corner has a vertex of its own, and every triangle is there twice.
StatusOr<Measures> coincident(const StabilityContext& context) {
  const StabilityMesh grid = grid_mesh(12, 12, on_screen);
  StabilityMesh soup;
  for (int copy = 0; copy < 2; ++copy)
    for (const uint32_t index : grid.indices) {
      soup.indices.push_back(static_cast<uint32_t>(soup.positions.size()));
      soup.positions.push_back(grid.positions[index]);
      soup.colors.push_back(grid.colors[index]);
    }
  return measure_mesh(context, soup);
}

// The pages of a book, all on one edge, in front of a wall that shares corners with them.
StatusOr<Measures> non_manifold(const StabilityContext& context) {
  constexpr uint32_t kPages = 61;
  StabilityMesh mesh = grid_mesh(2, 2, [](float u, float v) { return 2.0f * on_screen(u, v); });
  mesh.double_sided = true;
  const uint32_t low = 1, high = 7;  // of the wall's middle column: the spine
  for (uint32_t i = 0; i < kPages; ++i) {
    const float angle = 3.1f * (static_cast<float>(i) + 0.5f) / kPages;
    const vec3 across = 0.8f * vec3(std::cos(angle), 0, std::sin(angle));
    const auto first = static_cast<uint32_t>(mesh.positions.size());
    for (const uint32_t end : {low, high}) {
      mesh.positions.push_back(mesh.positions[end] + across);
      mesh.colors.push_back(mesh.colors[end] + 0.2f * vec3(std::cos(angle), 0, 0));
    }
    mesh.add_triangle(low, first, high);
    mesh.add_triangle(first + 1, high, first);
  }
  return measure_mesh(
      context, mesh,
      {.color = 0.05,
       .why = "pages thinner than a pixel are shown by one of their points: neighbours differ by 0.02"});
}

// A floor from far ahead to far behind, nearer to the eye than the near plane, and a wall beside it likewise.
StatusOr<Measures> around_the_eye(const StabilityContext& context, double distance) {
  const auto floor = [&](float u, float v) {
    return vec3(40 * u - 20, -distance, 40 - 80 * v);  // ahead: -Z
  };
  StabilityMesh mesh = grid_mesh(4, 4, floor);
  mesh.double_sided = true;
  return measure_mesh(context, mesh, kSmooth);
}

StatusOr<Measures> far_away(const StabilityContext& context) {
  StabilityMesh mesh = grid_mesh(12, 12, on_screen);
  const dvec3 place(1e7, -1e7, 1e7);
  mesh.matrix = glm::translate(dmat4(1), place);
  return measure_mesh(context, mesh, kSmooth, place);
}

// Mesh coordinates of `size`; the node's scale brings them to `shown_m`, seen from as far.
StatusOr<Measures> scaled(const StabilityContext& context, float size, double shown_m) {
  StabilityMesh mesh = grid_mesh(12, 12, [&](float u, float v) { return size * on_screen(u, v); });
  if (shown_m != size) mesh.matrix = glm::scale(dmat4(1), dvec3(shown_m / size));
  return measure_mesh(context, mesh);
}

// Floats are a metre apart there.
StatusOr<Measures> large_mesh_coordinates(const StabilityContext& context) {
  const vec3 place(1e7f, -1e7f, 1e7f);
  const StabilityMesh mesh =
      grid_mesh(12, 12, [&](float u, float v) { return place + glm::round(1024.0f * on_screen(u, v)); });
  return measure_mesh(context, mesh, kSmooth, dvec3(place));
}

// A speck of 1e-7 m, a metre ahead: less than any sample; the wall behind it must not change.
StatusOr<Measures> speck(const StabilityContext& context) {
  StabilityMesh mesh = grid_mesh(4, 4, [](float u, float v) { return 2.0f * on_screen(u, v); });
  const auto first = static_cast<uint32_t>(mesh.positions.size());
  for (const vec3 corner : {vec3(0), vec3(1e-7f, 0, 0), vec3(0, 1e-7f, 0)}) {
    mesh.positions.push_back(corner + vec3(0, 0, -1));
    mesh.colors.push_back(vec3(1, 1, 0));
  }
  mesh.add_triangle(first, first + 1, first + 2);
  return measure_mesh(context, mesh);
}

// One triangle, `size` times as large as the screen.
StatusOr<Measures> screen_triangle(const StabilityContext& context, float size) {
  StabilityMesh mesh;
  mesh.add({-2 * size, -size, -1}, {0, 0});
  mesh.add({2 * size, -size, -1}, {1, 0});
  mesh.add({0, 3 * size, -1}, {0.5f, 1});
  mesh.add_triangle(0, 1, 2);
  return measure_mesh(context, mesh);
}

// Two triangles a pixel, in a picture that is as large as that takes.
StatusOr<Measures> sub_pixel(const StabilityContext& context) {
  const auto cells = static_cast<uint32_t>(std::ceil(std::sqrt(context.sub_pixel_triangles / 2.0)));
  StabilityMesh mesh = grid_mesh(cells, cells, [](float u, float v) {
    return on_screen(u, v) + vec3(0, 0, 0.01f * std::sin(40 * u) * std::cos(30 * v));
  });
  mesh.shares_vertices = true;  // else a million triangles exceed a software device's buffers
  TESSERA_ASSIGN_OR_RETURN(const ImportedMesh imported, import_mesh(mesh));
  const View view = stability_view(cells * 8 / 7 / 2 * 2);
  PictureBounds bounds = kSmooth;
  bounds.holes = 0.001;
  bounds.holes_why = "what no view's pixel centre hits is not known to be visible";
  return measure_pictures(context, imported.scene, {&view, 1}, bounds);
}

// The mesh is squeezed as much as the node stretches it. What is front stays so (glTF 2.0, 3.7.4).
StatusOr<Measures> mirrored(const StabilityContext& context) {
  const dvec3 scale(-1, 1e-3, 1e3);
  StabilityMesh mesh =
      grid_mesh(12, 12, [&](float u, float v) { return vec3(dvec3(on_screen(1 - u, v)) / scale); });
  mesh.matrix = glm::scale(dmat4(1), scale);
  return measure_mesh(context, mesh);
}

struct BadValue {
  const char* where;
  float value;
  bool seen =
      true;  // if it is imported: whether anything is as large as a pixel, and not nearer than the near plane
};

StabilityMesh damaged(const BadValue& bad) {
  StabilityMesh mesh = grid_mesh(8, 8, on_screen);
  const std::string where = bad.where;
  constexpr size_t kMiddle = 40;
  if (where == "position") mesh.positions[kMiddle].y = bad.value;
  if (where == "colour") mesh.colors[kMiddle].y = bad.value;
  if (where == "index") mesh.indices[kMiddle] = static_cast<uint32_t>(bad.value);
  if (where == "node") mesh.matrix = glm::scale(dmat4(1), dvec3(1, bad.value, 1));
  if (where == "all positions")
    for (vec3& p : mesh.positions) p *= bad.value;
  return mesh;
}

bool all_finite(const scene::Scene& scene) {
  for (const scene::Geometry& g : scene.geometries)
    for (const scene::Vertex& v : g.vertices)
      if (!std::isfinite(v.position.x) || !std::isfinite(v.position.y) || !std::isfinite(v.position.z) ||
          !std::isfinite(glm::length(v.normal)))
        return false;
  const Aabb bounds = scene.world_bounds(0);
  const vec3 extent = bounds.extent();
  return scene.triangle_count == 0 ||
         (std::isfinite(extent.x) && std::isfinite(extent.y) && std::isfinite(extent.z));
}

struct Outcome {
  const char* what = "";
  bool good = false;
};

StatusOr<Outcome> outcome_of(const StabilityContext& context, const BadValue& bad) {
  const StatusOr<ImportedMesh> imported = import_mesh(damaged(bad));
  if (!imported.ok())
    return Outcome{"refused", imported.status().message().find("stability.glb: /") != std::string::npos};
  if (!all_finite(*imported->scene)) return Outcome{"imported, not finite", false};
  if (imported->scene->triangle_count == 0) return Outcome{"left out", !imported->notes.empty()};
  const View view = stability_view(kSide);
  const PictureBounds drawn_right{.color = 0.1, .may_show_nothing = true};
  constexpr std::array kLayouts{atlas::LayoutKind::blocks};
  TESSERA_ASSIGN_OR_RETURN(const Measures measures,
                           measure_pictures(context, imported->scene, {&view, 1}, drawn_right, kLayouts));
  TESSERA_ASSIGN_OR_RETURN(const auto staged, StabilityScene::create(context, imported->scene));
  TESSERA_ASSIGN_OR_RETURN(const shading::ReferenceImage truth, staged->truth(view));
  const bool seen = std::ranges::count(truth.covered, 1) > 0;
  return Outcome{seen ? "drawn" : "not seen",
                 seen == bad.seen && std::ranges::all_of(measures, [](const auto& m) { return m.passed(); })};
}

StatusOr<Measures> bad_buffers(const StabilityContext& context) {
  using Limits = std::numeric_limits<float>;
  constexpr std::array<BadValue, 21> kValues{{{"position", Limits::quiet_NaN()},
                                              {"position", Limits::infinity()},
                                              {"position", -Limits::infinity()},
                                              {"position", Limits::denorm_min()},
                                              {"position", 1e15f},
                                              {"position", Limits::max()},
                                              {"all positions", 1e-44f, false},
                                              {"all positions", 1e-38f, false},
                                              {"all positions", 1e-20f, false},
                                              {"all positions", 1e15f},
                                              {"all positions", 1e20f},
                                              {"all positions", 1e30f},
                                              {"all positions", Limits::max()},
                                              {"colour", Limits::quiet_NaN()},
                                              {"colour", Limits::infinity()},
                                              {"colour", Limits::denorm_min()},
                                              {"colour", -1e30f},
                                              {"index", 81},
                                              {"index", 4294967040.0f},
                                              {"node", 1e-40f, false},
                                              {"node", 1e30f}}};
  Measures measures;
  for (const BadValue& bad : kValues) {
    TESSERA_ASSIGN_OR_RETURN(const Outcome outcome, outcome_of(context, bad));
    measures.push_back({absl::StrFormat("%s of %g: %s", bad.where, bad.value, outcome.what),
                        outcome.good ? 0.0 : 1.0, 0,
                        "refused or left out with a message, or finite and drawn right"});
  }
  return measures;
}

}  // namespace

std::vector<StabilityCase> geometry_stability_cases() {
  const char* kAsTruth = "the reference renderer's picture";
  const auto bind = [](auto function, auto... arguments) {
    return [=](const StabilityContext& context) { return function(context, arguments...); };
  };
  return {
      {"geometry", "zero-area", "288 triangles without area in a grid of 288 others", kAsTruth, zero_area},
      {"geometry", "sliver-1e3", "strips 1000 times as long as wide", kAsTruth, bind(slivers, 1e3)},
      {"geometry", "sliver-1e5", "strips 100,000 times as long as wide", kAsTruth, bind(slivers, 1e5)},
      {"geometry", "sliver-1e7", "strips 10,000,000 times as long as wide", kAsTruth, bind(slivers, 1e7)},
      {"geometry", "coincident", "no shared vertices, every triangle twice", kAsTruth, coincident},
      {"geometry", "non-manifold", "61 pages on one edge, which the wall behind them shares", kAsTruth,
       non_manifold},
      {"geometry", "behind-the-eye", "a floor 1 m below the eye, 40 m to all sides", kAsTruth,
       bind(around_the_eye, 1.0)},
      {"geometry", "near-plane", "a floor 0.02 m below the eye, 40 m to all sides", kAsTruth,
       bind(around_the_eye, 0.02)},
      {"geometry", "far-node", "a node 1e7 m from the origin along each axis", kAsTruth, far_away},
      {"geometry", "large-mesh", "a mesh with coordinates of 1e7 m", kAsTruth, bind(scaled, 1e7f, 1e7)},
      {"geometry", "offset-mesh", "mesh coordinates 1e7 m from the origin, 1 m apart", kAsTruth,
       large_mesh_coordinates},
      {"geometry", "small-mesh", "a mesh with coordinates of 1e-7, scaled to 1 m", kAsTruth,
       bind(scaled, 1e-7f, 1.0)},
      {"geometry", "speck", "a triangle of 1e-7 m before a wall", kAsTruth, speck},
      {"geometry", "screen-triangle", "one triangle that just holds the screen", kAsTruth,
       bind(screen_triangle, 1.2f)},
      {"geometry", "huge-triangle", "one triangle 10,000 times as large as the screen", kAsTruth,
       bind(screen_triangle, 1e4f)},
      {"geometry", "sub-pixel", "triangles smaller than a pixel", kAsTruth, sub_pixel},
      {"geometry", "mirrored", "scaled by -1, 0.001 and 1000", kAsTruth, mirrored},
      {"geometry", "bad-buffers", "NaN, infinity, denormal and huge values in buffers and nodes",
       "a message, or a sane scene", bad_buffers},
  };
}

}  // namespace tessera::bench
