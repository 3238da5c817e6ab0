// Every component type, normalised or not, tight or strided, dense, sparse, or sparse over nothing, against
// values computed here.
#include "scene/gltf/accessor.h"

#include <gtest/gtest.h>

#include <limits>

#include "gltf_builder.h"

namespace tessera::scene {
namespace {

constexpr size_t kCount = 7;
enum class Storage { dense, sparse, sparse_without_view };

struct TypeName {
  int component_type;
  double divisor;  // of normalised values; 0 = floats are never normalised
  double lowest, highest;
  size_t size;
};
constexpr TypeName kTypes[] = {{5120, 127, -128, 127, 1},
                               {5121, 255, 0, 255, 1},
                               {5122, 32767, -32768, 32767, 2},
                               {5123, 65535, 0, 65535, 2},
                               {5125, 4294967295.0, 0, 4294967295.0, 4},
                               {5126, 0, -1e30, 1e30, 4}};

// Values that reach both ends of the type's range.
double raw_value(const TypeName& type, size_t element, int component) {
  const double t = static_cast<double>((element * 5 + static_cast<size_t>(component) * 3) % 11) / 10.0;
  return std::floor(type.lowest + t * (type.highest - type.lowest));
}

void put(std::vector<uint8_t>& out, const TypeName& type, double value) {
  const auto push = [&](auto v) {
    const auto* bytes = reinterpret_cast<const uint8_t*>(&v);
    out.insert(out.end(), bytes, bytes + sizeof v);
  };
  switch (type.component_type) {
    case 5120:
      push(static_cast<int8_t>(value));
      break;
    case 5121:
      push(static_cast<uint8_t>(value));
      break;
    case 5122:
      push(static_cast<int16_t>(value));
      break;
    case 5123:
      push(static_cast<uint16_t>(value));
      break;
    case 5125:
      push(static_cast<uint32_t>(value));
      break;
    default:
      push(static_cast<float>(value));
  }
}

float expected(const TypeName& type, double raw, bool normalized) {
  if (type.component_type == 5126) return static_cast<float>(raw);
  return static_cast<float>(normalized ? std::max(raw / type.divisor, -1.0) : raw);
}

struct Case {
  TypeName type;
  int components;
  bool normalized;
  int stride;
  Storage storage;
};

bool is_override(size_t element) {
  return element == 2 || element == 5;
}

// In sparse storage the dense elements hold garbage where overrides are.
GltfBuilder make_file(const Case& c) {
  GltfBuilder b;
  std::vector<uint8_t> dense, values;
  for (size_t i = 0; i < kCount; ++i) {
    const size_t start = dense.size();
    for (int k = 0; k < c.components; ++k) {
      const double raw = raw_value(c.type, i, k);
      const bool overridden = c.storage != Storage::dense && is_override(i);
      put(dense, c.type, overridden ? c.type.highest : raw);
      if (overridden) put(values, c.type, raw);
    }
    if (c.stride > 0) dense.resize(start + static_cast<size_t>(c.stride), 0xAB);
  }
  const char* names[] = {"", "SCALAR", "VEC2", "VEC3", "VEC4"};
  const int view = c.storage == Storage::sparse_without_view ? -1 : b.add_view(dense, c.stride);
  const int accessor = b.add_accessor(view, c.type.component_type, kCount, names[c.components], c.normalized);
  if (c.storage != Storage::dense) {
    b.document["accessors"][static_cast<size_t>(accessor)]["sparse"] = {
        {"count", 2},
        {"indices", {{"bufferView", b.add_view(std::vector<uint16_t>{2, 5})}, {"componentType", 5123}}},
        {"values", {{"bufferView", b.add_view(values)}}}};
  }
  return b;
}

void check(const Case& c) {
  SCOPED_TRACE(absl::StrFormat("type %d, %d components, normalized %d, stride %d, storage %d",
                               c.type.component_type, c.components, c.normalized, c.stride,
                               static_cast<int>(c.storage)));
  const std::vector<std::byte> file = make_file(c).glb();
  ImportNotes notes;
  const auto document = Document::open(file, "test.glb", {}, {}, notes);
  ASSERT_TRUE(document.ok()) << document.status();
  const AccessorView view(**document, 0);
  ASSERT_EQ(view.count(), kCount);
  for (size_t i = 0; i < kCount; ++i) {
    const vec4 read = view.read(i);
    for (int k = 0; k < 4; ++k) {
      const bool zero = k >= c.components || (c.storage == Storage::sparse_without_view && !is_override(i));
      EXPECT_FLOAT_EQ(read[k], zero ? 0.f : expected(c.type, raw_value(c.type, i, k), c.normalized));
    }
  }
}

TEST(Accessor, ReadsEveryTypeInEveryStorage) {
  for (const TypeName& type : kTypes) {
    for (int components = 1; components <= 4; ++components) {
      for (const Storage storage : {Storage::dense, Storage::sparse, Storage::sparse_without_view}) {
        for (const int stride : {0, 16, 20}) {
          check({type, components, false, stride, storage});
          if (type.divisor > 0) check({type, components, true, stride, storage});
        }
      }
    }
  }
}

TEST(Accessor, ReadsIndicesOfEveryUnsignedType) {
  const auto check_indices = [](int type, auto one) {
    GltfBuilder b;
    std::vector<decltype(one)> values = {0, 3, std::numeric_limits<decltype(one)>::max()};
    b.add_accessor(b.add_view(values), type, 3, "SCALAR");
    const std::vector<std::byte> file = b.glb();
    ImportNotes notes;
    const auto document = Document::open(file, "test.glb", {}, {}, notes);
    ASSERT_TRUE(document.ok()) << document.status();
    const AccessorView view(**document, 0);
    for (size_t i = 0; i < 3; ++i) EXPECT_EQ(view.read_index(i), values[i]);
  };
  check_indices(5121, uint8_t{});
  check_indices(5123, uint16_t{});
  check_indices(5125, uint32_t{});
}

TEST(Accessor, ViewMayEndExactlyAtTheLastElement) {
  for (const size_t spare : {size_t{0}, size_t{1}}) {
    GltfBuilder b;
    b.add_accessor(b.add_view(std::vector<float>(12)), 5126, 4, "VEC3");
    b.document["accessors"][0]["byteOffset"] = 4 * spare;
    ImportNotes notes;
    const std::vector<std::byte> file = b.glb();
    EXPECT_EQ(Document::open(file, "test.glb", {}, {}, notes).ok(), spare == 0);
  }
}

}  // namespace
}  // namespace tessera::scene
