// The only way to touch wire bytes: bits, most significant first, and exponential-Golomb codes of order k.
//
// Order-k code of v: x = v + 2^k written in n + 1 binary digits, behind n - k zeros. Short for v < 2^k, and
// any 32-bit value has a code (of at most 65 bits).
#pragma once

#include <bit>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace tessera::geometry_compression {

constexpr uint32_t kMaxOrder = 31;

// Bits that exp-Golomb of this order takes for `value`.
constexpr uint32_t exp_golomb_bits(uint32_t value, uint32_t order) {
  const uint64_t x = uint64_t{value} + (uint64_t{1} << order);
  return 2 * static_cast<uint32_t>(std::bit_width(x)) - 1 - order;
}

// Small magnitudes of either sign become small numbers: 0, -1, 1, -2, … → 0, 1, 2, 3, …
constexpr uint32_t zigzag(int32_t v) {
  return (static_cast<uint32_t>(v) << 1) ^ (v < 0 ? ~0u : 0u);
}
constexpr int32_t unzigzag(uint32_t v) {
  return static_cast<int32_t>((v >> 1) ^ (0u - (v & 1)));
}

class BitWriter {
 public:
  // The low `count` (0..64) bits of `value`, most significant first.
  void put(uint64_t value, uint32_t count) {
    assert(count <= 64 && (count == 64 || value >> count == 0));
    while (count > 0) {
      if (free_ == 0) {
        bytes_.push_back(0);
        free_ = 8;
      }
      const uint32_t n = count < free_ ? count : free_;
      count -= n;
      free_ -= n;
      bytes_.back() |= static_cast<uint8_t>(((value >> count) & ((1u << n) - 1)) << free_);
    }
  }
  void put_unsigned(uint32_t value, uint32_t order) {
    assert(order <= kMaxOrder);
    const uint64_t x = uint64_t{value} + (uint64_t{1} << order);
    const auto digits = static_cast<uint32_t>(std::bit_width(x));
    put(0, digits - 1 - order);
    put(x, digits);
  }
  void put_signed(int32_t value, uint32_t order) { put_unsigned(zigzag(value), order); }

  uint64_t bit_count() const { return uint64_t{8} * bytes_.size() - free_; }
  // The last byte is filled up with zeros.
  std::vector<uint8_t> take() && { return std::move(bytes_); }

 private:
  std::vector<uint8_t> bytes_;
  uint32_t free_ = 0;  // bits of the last byte
};

// Safe for untrusted input. The first read past the end, or of a code that no value has, makes ok() false for
// good; from then on everything reads as 0. So a parser tests ok() where it would loop or allocate, and at
// its end.
class BitReader {
 public:
  explicit BitReader(std::span<const uint8_t> bytes) : bytes_(bytes) {}

  // `count` 0..64.
  uint64_t get(uint32_t count) {
    assert(count <= 64);
    if (!ok_ || count > bits_left()) return fail();
    uint64_t value = 0;
    while (count > 0) {
      const auto used = static_cast<uint32_t>(position_ % 8);
      const uint32_t n = count < 8 - used ? count : 8 - used;
      value = value << n | ((bytes_[position_ / 8] >> (8 - used - n)) & ((1u << n) - 1));
      position_ += n;
      count -= n;
    }
    return value;
  }
  uint32_t get_unsigned(uint32_t order) {
    assert(order <= kMaxOrder);
    uint32_t zeros = 0;
    while (ok_ && get(1) == 0) ++zeros;
    // x < 2^33, so n <= 32
    if (!ok_ || zeros + order > 32) return fail();
    const uint32_t rest = zeros + order;
    const uint64_t value = (uint64_t{1} << rest | get(rest)) - (uint64_t{1} << order);
    if (!ok_ || value > UINT32_MAX) return fail();
    return static_cast<uint32_t>(value);
  }
  int32_t get_signed(uint32_t order) { return unzigzag(get_unsigned(order)); }

  bool ok() const { return ok_; }
  uint64_t bits_left() const { return uint64_t{8} * bytes_.size() - position_; }
  uint64_t position() const { return position_; }  // in bits

 private:
  uint32_t fail() {
    ok_ = false;
    return 0;
  }

  std::span<const uint8_t> bytes_;
  uint64_t position_ = 0;
  bool ok_ = true;
};

}  // namespace tessera::geometry_compression
