// The one way to touch wire bytes: a checked reader and a checked writer. Both latch their first error, so
// that a parser reads its fields in a row and asks ok() once. All numbers are big-endian (network byte
// order); floats are IEEE 754 bits. Safe for untrusted input.
#pragma once

#include <bit>
#include <concepts>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

namespace tessera::transport {

// Reads past the end give zeros and latch the error; nothing outside `bytes` is ever touched.
class ByteReader {
 public:
  explicit ByteReader(std::span<const uint8_t> bytes) : bytes_(bytes) {}

  uint8_t u8() { return number<uint8_t>(); }
  uint16_t u16() { return number<uint16_t>(); }
  uint32_t u24() { return uint32_t{u8()} << 16 | u16(); }
  uint32_t u32() { return number<uint32_t>(); }
  uint64_t u64() { return number<uint64_t>(); }
  int64_t i64() { return static_cast<int64_t>(u64()); }
  float f32() { return std::bit_cast<float>(u32()); }
  double f64() { return std::bit_cast<double>(u64()); }

  // A view of the next `count` bytes; empty if there are fewer.
  std::span<const uint8_t> bytes(size_t count) {
    if (!take(count)) return {};
    return bytes_.subspan(at_ - count, count);
  }
  std::span<const uint8_t> rest() { return bytes(remaining()); }
  void skip(size_t count) { take(count); }

  // Latches the error: a value was out of range.
  void fail() { ok_ = false; }

  size_t remaining() const { return ok_ ? bytes_.size() - at_ : 0; }
  bool ok() const { return ok_; }
  // Everything was read, and nothing more than there was.
  bool done() const { return ok_ && at_ == bytes_.size(); }

 private:
  bool take(size_t count) {
    if (!ok_ || count > bytes_.size() - at_) return ok_ = false;
    at_ += count;
    return true;
  }
  template <std::unsigned_integral T>
  T number() {
    if (!take(sizeof(T))) return 0;
    T value = 0;
    for (size_t i = at_ - sizeof(T); i < at_; ++i) value = static_cast<T>(uint64_t{value} << 8 | bytes_[i]);
    return value;
  }

  std::span<const uint8_t> bytes_;
  size_t at_ = 0;
  bool ok_ = true;
};

// Appends to `out`. What would grow it beyond `limit` bytes is left out and latches the error.
class ByteWriter {
 public:
  explicit ByteWriter(std::vector<uint8_t>& out, size_t limit = std::numeric_limits<size_t>::max())
      : out_(out), limit_(limit) {}

  void u8(uint8_t v) { number(v); }
  void u16(uint16_t v) { number(v); }
  void u24(uint32_t v) {
    u8(static_cast<uint8_t>(v >> 16));
    u16(static_cast<uint16_t>(v));
  }
  void u32(uint32_t v) { number(v); }
  void u64(uint64_t v) { number(v); }
  void i64(int64_t v) { number(static_cast<uint64_t>(v)); }
  void f32(float v) { u32(std::bit_cast<uint32_t>(v)); }
  void f64(double v) { u64(std::bit_cast<uint64_t>(v)); }
  void bytes(std::span<const uint8_t> bytes) {
    if (fits(bytes.size())) out_.insert(out_.end(), bytes.begin(), bytes.end());
  }
  void zeros(size_t count) {
    if (fits(count)) out_.insert(out_.end(), count, uint8_t{0});
  }
  // Replaces two bytes that were written before.
  void patch_u16(size_t at, uint16_t v) {
    if (out_.size() < 2 || at > out_.size() - 2) {
      ok_ = false;
      return;
    }
    out_[at] = static_cast<uint8_t>(v >> 8);
    out_[at + 1] = static_cast<uint8_t>(v);
  }

  size_t size() const { return out_.size(); }
  bool ok() const { return ok_; }

 private:
  bool fits(size_t count) {
    if (!ok_ || out_.size() > limit_ || count > limit_ - out_.size()) return ok_ = false;
    return true;
  }
  template <std::unsigned_integral T>
  void number(T value) {
    if (!fits(sizeof(T))) return;
    for (size_t i = sizeof(T); i-- > 0;) out_.push_back(static_cast<uint8_t>(value >> (8 * i)));
  }

  std::vector<uint8_t>& out_;
  size_t limit_;
  bool ok_ = true;
};

}  // namespace tessera::transport
