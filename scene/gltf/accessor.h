// Reading glTF accessors: all component types, normalised or not, with strides and sparse overrides.
#pragma once

#include <optional>

#include "base/math.h"
#include "scene/gltf/document.h"

namespace tessera::scene {

// Checks that every accessor's elements lie inside its buffer views, and that sparse indices increase and
// exist.
Status check_accessors(const Document& document);

// Random access to the elements of one checked accessor, without a copy. `document` must outlive it.
class AccessorView {
 public:
  AccessorView(const Document& document, int accessor);

  size_t count() const { return count_; }
  int components() const { return components_; }  // of a vector; matrices cannot be read
  // As floats, normalised if the accessor says so; components that it lacks are 0.
  vec4 read(size_t element) const;
  // Of an unsigned integer scalar.
  uint32_t read_index(size_t element) const;

 private:
  const uint8_t* bytes_of(size_t element) const;  // null: the element is zero

  size_t count_;
  int components_, component_type_;
  bool normalized_;
  const uint8_t* base_ = nullptr;
  size_t stride_ = 0;
  size_t sparse_count_ = 0;
  int sparse_index_type_ = 0;
  const uint8_t* sparse_indices_ = nullptr;
  const uint8_t* sparse_values_ = nullptr;
  size_t element_size_;
};

}  // namespace tessera::scene
