// Meshes, objects and moved objects: few, and mostly numbers without structure. Each number is one bit if it
// has the same bits as in the item before, else a 0 bit and its IEEE 754 bits.
#include <bit>
#include <cmath>

#include "geometry-compression/columns.h"
#include "geometry-compression/sections.h"

namespace tessera::geometry_compression {
namespace {

template <class Float>
struct BitsOf;
template <>
struct BitsOf<float> {
  using Type = uint32_t;
};
template <>
struct BitsOf<double> {
  using Type = uint64_t;
};

template <class Float>
void write_number(BitWriter& out, Float value, Float previous) {
  using Bits = typename BitsOf<Float>::Type;
  const auto bits = std::bit_cast<Bits>(value);
  const bool same = bits == std::bit_cast<Bits>(previous);
  out.put(same, 1);
  if (!same) out.put(bits, 8 * sizeof(Bits));
}

template <class Float>
Float read_number(BitReader& in, Float previous) {
  using Bits = typename BitsOf<Float>::Type;
  if (in.get(1) != 0) return previous;
  return std::bit_cast<Float>(static_cast<Bits>(in.get(8 * sizeof(Bits))));
}

template <class Array>
void write_numbers(BitWriter& out, const Array& values, const Array& previous) {
  for (size_t i = 0; i < values.size(); ++i) write_number(out, values[i], previous[i]);
}

// False if a number is not finite.
template <class Array>
bool read_numbers(BitReader& in, Array& values, const Array& previous) {
  bool finite = true;
  for (size_t i = 0; i < values.size(); ++i) {
    values[i] = read_number(in, previous[i]);
    finite = finite && std::isfinite(values[i]);
  }
  return finite;
}

void write_transform(BitWriter& out, const Transform& t, const Transform& previous) {
  write_numbers(out, t.linear, previous.linear);
  write_numbers(out, t.translation, previous.translation);
}

bool read_transform(BitReader& in, Transform& t, const Transform& previous) {
  const bool linear = read_numbers(in, t.linear, previous.linear);
  const bool translation = read_numbers(in, t.translation, previous.translation);
  return linear && translation;
}

}  // namespace

void write_meshes(BitWriter& out, std::span<const NewMesh> meshes) {
  NewMesh previous;
  for (const NewMesh& mesh : meshes) {
    write_numbers(out, mesh.offset, previous.offset);
    write_number(out, mesh.step, previous.step);
    previous = mesh;
  }
}

std::string read_meshes(BitReader& in, uint32_t count, std::vector<NewMesh>& meshes) {
  NewMesh mesh;
  for (uint32_t i = 0; i < count && in.ok(); ++i) {
    const NewMesh previous = mesh;
    const bool finite = read_numbers(in, mesh.offset, previous.offset);
    mesh.step = read_number(in, previous.step);
    if (!finite || !std::isfinite(mesh.step) || !(mesh.step > 0))
      return "mesh " + std::to_string(i) + ": offset and step must be finite, step above 0";
    meshes.push_back(mesh);
  }
  return {};
}

void write_objects(BitWriter& out, std::span<const NewObject> objects) {
  Transform previous;
  for (const NewObject& object : objects) {
    out.put(object.mirrored, 1);
    out.put(object.double_sided, 1);
    out.put(object.masked, 1);
    write_transform(out, object.transform, previous);
    previous = object.transform;
  }
}

std::string read_objects(BitReader& in, uint32_t count, std::vector<NewObject>& objects) {
  NewObject object;
  for (uint32_t i = 0; i < count && in.ok(); ++i) {
    const Transform previous = object.transform;
    object.mirrored = in.get(1) != 0;
    object.double_sided = in.get(1) != 0;
    object.masked = in.get(1) != 0;
    if (!read_transform(in, object.transform, previous))
      return "object " + std::to_string(i) + ": the transform is not finite";
    objects.push_back(object);
  }
  return {};
}

void write_moved(BitWriter& out, std::span<const MovedObject> moved) {
  std::vector<uint32_t> gaps;
  uint32_t next = 0;
  for (const MovedObject& m : moved) {
    gaps.push_back(m.object - next);
    next = m.object + 1;
  }
  write_column(out, gaps);
  Transform previous;
  for (const MovedObject& m : moved) {
    write_transform(out, m.transform, previous);
    previous = m.transform;
  }
}

std::string read_moved(BitReader& in, uint32_t count, std::vector<MovedObject>& moved) {
  const auto gaps = read_column(in, count);
  uint64_t next = 0;
  MovedObject m;
  for (uint32_t i = 0; i < count && in.ok(); ++i) {
    const Transform previous = m.transform;
    const uint64_t object = next + gaps[i];
    if (object > UINT32_MAX) return "moved object " + std::to_string(i) + ": its id does not fit in 32 bits";
    m.object = static_cast<uint32_t>(object);
    next = object + 1;
    if (!read_transform(in, m.transform, previous))
      return "moved object " + std::to_string(i) + ": the transform is not finite";
    moved.push_back(m);
  }
  return {};
}

}  // namespace tessera::geometry_compression
