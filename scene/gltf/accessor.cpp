#include "scene/gltf/accessor.h"

#include <cstring>

namespace tessera::scene {
namespace {

// Without a buffer view an accessor's elements are zeros that cost the file nothing: a small file must not
// claim many.
constexpr uint64_t kMaxElementsWithoutView = 1'000'000;

size_t component_size(int type) {
  return static_cast<size_t>(tinygltf::GetComponentSizeInBytes(static_cast<uint32_t>(type)));
}

// Columns of matrices of small components are padded to 4 bytes.
size_t element_size(const tinygltf::Accessor& a) {
  const size_t size = component_size(a.componentType);
  const auto columns = [&](size_t n) { return n * ((n * size + 3) / 4 * 4); };
  switch (a.type) {
    case TINYGLTF_TYPE_MAT2:
      return columns(2);
    case TINYGLTF_TYPE_MAT3:
      return columns(3);
    case TINYGLTF_TYPE_MAT4:
      return columns(4);
    default:
      return size * static_cast<size_t>(tinygltf::GetNumComponentsInType(static_cast<uint32_t>(a.type)));
  }
}

size_t stride_of(const Document& document, const tinygltf::Accessor& a) {
  const size_t stride = document.model().bufferViews[static_cast<size_t>(a.bufferView)].byteStride;
  return stride == 0 ? element_size(a) : stride;
}

uint32_t read_unsigned(const uint8_t* bytes, int type) {
  switch (type) {
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return *bytes;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT: {
      uint16_t v;
      std::memcpy(&v, bytes, sizeof v);
      return v;
    }
    default: {
      uint32_t v;
      std::memcpy(&v, bytes, sizeof v);
      return v;
    }
  }
}

template <typename T>
T load(const uint8_t* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof value);
  return value;
}

// glTF 2.0, 3.6.2.2: the conversion of normalised integers.
float read_component(const uint8_t* b, int type, bool normalized) {
  switch (type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE: {
      const float v = load<int8_t>(b);
      return normalized ? std::max(v / 127.f, -1.f) : v;
    }
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return normalized ? static_cast<float>(*b) / 255.f : *b;
    case TINYGLTF_COMPONENT_TYPE_SHORT: {
      const float v = load<int16_t>(b);
      return normalized ? std::max(v / 32767.f, -1.f) : v;
    }
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT: {
      const float v = load<uint16_t>(b);
      return normalized ? v / 65535.f : v;
    }
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT: {
      const auto v = static_cast<double>(load<uint32_t>(b));
      return static_cast<float>(normalized ? v / 4294967295.0 : v);
    }
    default:
      return load<float>(b);
  }
}

// First byte after `count` elements, without overflow: offsets are at most 1e15, counts at most 1e15, strides
// 252.
uint64_t end_of(uint64_t offset, uint64_t count, uint64_t stride, uint64_t size) {
  return offset + (count - 1) * stride + size;
}

Status check_sparse(const Document& document, const tinygltf::Accessor& a, const std::string& path) {
  const auto& sparse = a.sparse;
  const std::string indices_path = path + "/sparse/indices", values_path = path + "/sparse/values";
  const int type = sparse.indices.componentType;
  if (type != TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE && type != TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT &&
      type != TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT) {
    return document.error(indices_path + "/componentType",
                          absl::StrFormat("%d is not an unsigned integer type", type));
  }
  const auto count = static_cast<uint64_t>(sparse.count);
  if (count > a.count) {
    return document.error(path + "/sparse/count",
                          absl::StrFormat("%d overrides of %d elements", count, a.count));
  }
  const auto indices = document.view(sparse.indices.bufferView);
  const auto index_offset = static_cast<uint64_t>(sparse.indices.byteOffset);
  const size_t index_size = component_size(type);
  if (end_of(index_offset, count, index_size, index_size) > indices.size()) {
    return document.error(indices_path, "reaches past the end of its buffer view");
  }
  const auto value_offset = static_cast<uint64_t>(sparse.values.byteOffset);
  if (end_of(value_offset, count, element_size(a), element_size(a)) >
      document.view(sparse.values.bufferView).size()) {
    return document.error(values_path, "reaches past the end of its buffer view");
  }
  uint64_t next = 0;
  for (uint64_t i = 0; i < count; ++i) {
    const uint32_t index = read_unsigned(indices.data() + index_offset + i * index_size, type);
    if (index < next || index >= a.count) {
      return document.error(
          indices_path,
          absl::StrFormat("entry %d is %d: indices must increase and stay below %d", i, index, a.count));
    }
    next = uint64_t{index} + 1;
  }
  return absl::OkStatus();
}

Status check_accessor(const Document& document, const tinygltf::Accessor& a, const std::string& path) {
  if (tinygltf::GetComponentSizeInBytes(static_cast<uint32_t>(a.componentType)) <= 0 ||
      a.componentType == TINYGLTF_COMPONENT_TYPE_INT) {
    return document.error(path + "/componentType",
                          absl::StrFormat("%d is not a component type", a.componentType));
  }
  if (a.sparse.isSparse) TESSERA_RETURN_IF_ERROR(check_sparse(document, a, path));
  if (a.bufferView < 0) {
    if (a.count <= kMaxElementsWithoutView) return absl::OkStatus();
    return document.over_limit(path + "/count",
                               absl::StrFormat("%d elements without a buffer view; the limit is %d", a.count,
                                               kMaxElementsWithoutView));
  }
  const size_t size = element_size(a), stride = stride_of(document, a);
  if (stride < size) {
    return document.error(
        absl::StrFormat("/bufferViews/%d/byteStride", a.bufferView),
        absl::StrFormat("%d is less than the %d bytes of an element of %s", stride, size, path));
  }
  const uint64_t end = end_of(a.byteOffset, a.count, stride, size),
                 available = document.view(a.bufferView).size();
  if (end > available) {
    return document.error(path + "/count",
                          absl::StrFormat("%d elements end at byte %d of buffer view %d, which has %d",
                                          a.count, end, a.bufferView, available));
  }
  return absl::OkStatus();
}

}  // namespace

Status check_accessors(const Document& document) {
  const auto& accessors = document.model().accessors;
  for (size_t i = 0; i < accessors.size(); ++i) {
    TESSERA_RETURN_IF_ERROR(check_accessor(document, accessors[i], absl::StrCat("/accessors/", i)));
  }
  return absl::OkStatus();
}

AccessorView::AccessorView(const Document& document, int accessor) {
  const tinygltf::Accessor& a = document.model().accessors[static_cast<size_t>(accessor)];
  count_ = a.count;
  components_ = tinygltf::GetNumComponentsInType(static_cast<uint32_t>(a.type));
  component_type_ = a.componentType;
  normalized_ = a.normalized;
  element_size_ = element_size(a);
  if (a.bufferView >= 0) {
    base_ = document.view(a.bufferView).data() + a.byteOffset;
    stride_ = stride_of(document, a);
  }
  if (!a.sparse.isSparse) return;
  sparse_count_ = static_cast<size_t>(a.sparse.count);
  sparse_index_type_ = a.sparse.indices.componentType;
  sparse_indices_ = document.view(a.sparse.indices.bufferView).data() + a.sparse.indices.byteOffset;
  sparse_values_ = document.view(a.sparse.values.bufferView).data() + a.sparse.values.byteOffset;
}

const uint8_t* AccessorView::bytes_of(size_t element) const {
  size_t low = 0, high = sparse_count_;
  while (low < high) {
    const size_t middle = (low + high) / 2;
    const uint32_t index =
        read_unsigned(sparse_indices_ + middle * component_size(sparse_index_type_), sparse_index_type_);
    if (index == element) return sparse_values_ + middle * element_size_;
    index < element ? low = middle + 1 : high = middle;
  }
  return base_ ? base_ + element * stride_ : nullptr;
}

vec4 AccessorView::read(size_t element) const {
  vec4 result(0);
  const uint8_t* bytes = bytes_of(element);
  if (!bytes) return result;
  const size_t size = component_size(component_type_);
  for (int c = 0; c < std::min(components_, 4); ++c) {
    result[c] = read_component(bytes + static_cast<size_t>(c) * size, component_type_, normalized_);
  }
  return result;
}

uint32_t AccessorView::read_index(size_t element) const {
  const uint8_t* bytes = bytes_of(element);
  return bytes ? read_unsigned(bytes, component_type_) : 0;
}

}  // namespace tessera::scene
