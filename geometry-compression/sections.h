// The sections of a meta packet, in wire order after the header: meshes, objects, moved, patches, vertices,
// placements. Each pair of functions lies in one file, so that writer and reader can be read side by side
// (docs/meta-format.md).
//
// Readers return an empty string or what is wrong. They allocate in proportion to the bits that they have
// read.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "geometry-compression/bit_io.h"
#include "geometry-compression/meta_frame.h"

namespace tessera::geometry_compression {

void write_meshes(BitWriter& out, std::span<const NewMesh> meshes);
std::string read_meshes(BitReader& in, uint32_t count, std::vector<NewMesh>& meshes);

void write_objects(BitWriter& out, std::span<const NewObject> objects);
std::string read_objects(BitReader& in, uint32_t count, std::vector<NewObject>& objects);

void write_moved(BitWriter& out, std::span<const MovedObject> moved);
std::string read_moved(BitReader& in, uint32_t count, std::vector<MovedObject>& moved);

// `first_vertex`: the id of the packet's first new vertex, as far as its patches tell. A prediction only: a
// wrong one costs bits, not correctness.
uint32_t guess_first_vertex(const MetaFrame& frame);

void write_patches(BitWriter& out, std::span<const NewPatch> patches, uint32_t first_vertex);
std::string read_patches(BitReader& in, uint32_t count, uint32_t first_vertex,
                         std::vector<NewPatch>& patches);

// Vertices are predicted from those before them, by the parallelograms of `patches`.
void write_vertices(BitWriter& out, std::span<const NewVertex> vertices, std::span<const NewPatch> patches,
                    uint32_t first_vertex);
std::string read_vertices(BitReader& in, uint32_t count, std::span<const NewPatch> patches,
                          uint32_t first_vertex, std::vector<NewVertex>& vertices);

void write_placements(BitWriter& out, std::span<const PatchPlacement> placements);
std::string read_placements(BitReader& in, uint32_t count, std::vector<PatchPlacement>& placements);

// The part of the placements that holds kinds l and halves.
void write_triangle_placements(BitWriter& out, std::span<const PatchPlacement> placements);
std::string read_triangle_placements(BitReader& in, std::span<PatchPlacement> placements);

constexpr int kMaxCorners = 5;
inline int corner_count(const NewPatch& patch) {
  return patch.triangles + 2;
}

}  // namespace tessera::geometry_compression
