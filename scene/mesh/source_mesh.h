// A mesh on its way from a source (glTF, procedural) to a Geometry: what is done to it, in this order.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "scene/scene.h"

namespace tessera::scene {

struct SourceMesh {
  std::string name;
  std::vector<Vertex> vertices;
  std::vector<uint32_t> indices;  // 3 a triangle, all < vertices.size()
  // World metres per unit along each local axis, the largest over its instances.
  dvec3 scale{1};

  uint32_t triangle_count() const { return static_cast<uint32_t>(indices.size() / 3); }
};

// Removes triangles without area (they never cover a sample); slivers stay. Returns how many.
size_t drop_degenerate_triangles(SourceMesh& mesh);

// Every triangle gets vertices of its own, with the triangle's normal (glTF: missing normals mean flat
// shading).
void set_flat_normals(SourceMesh& mesh);

// Replaces normals without length by the normal of a triangle that uses the vertex; brings all others to unit
// length.
void repair_normals(SourceMesh& mesh);

// Tangents per vertex from the texture coordinates that `normal_map` uses, orthogonal to the normal, with
// w * cross(normal, tangent) along -dP/dv (glTF: +Y of the normal map is up, v runs down). A vertex where
// mirrored coordinates meet is doubled.
void derive_tangents(SourceMesh& mesh, const TextureRef& normal_map);

// Joins vertices that are equal in all bits.
void weld_vertices(SourceMesh& mesh);

// Splits edges longer than `max_edge_m` at their midpoints until none is left. The decision depends on the
// two positions alone and is symmetric in them, so triangles that share an edge stay joined, over seams too.
void split_long_edges(SourceMesh& mesh, double max_edge_m);
// Triangles that split_long_edges() would leave; counting stops above `stop_at`.
uint64_t count_after_split(const SourceMesh& mesh, double max_edge_m, uint64_t stop_at);
// The smallest of 0.35, 0.5, 0.7, 1, 1.4, 2 … m that adds at most max(15 %, 100,000) instanced triangles.
// `instances`: how many instances place each mesh. `max_growth`: a bound on what is added, where there is
// one.
double choose_max_edge(std::span<const SourceMesh> meshes, std::span<const uint64_t> instances,
                       uint64_t max_growth = UINT64_MAX);

// Cuts the mesh into meshlets and patches and orders triangles and vertices by them.
Geometry build_geometry(SourceMesh mesh);

}  // namespace tessera::scene
