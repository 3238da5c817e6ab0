#include "geometry-compression/columns.h"

#include <algorithm>

namespace tessera::geometry_compression {
namespace {

constexpr bool is_plain(uint32_t code) {
  return code > kLastOrder;
}
constexpr uint32_t plain_bits(uint32_t code) {
  return code - kLastOrder;
}

// UINT64_MAX for a code that does not have all values.
uint64_t bits_of(std::span<const uint32_t> run, uint32_t code) {
  if (is_plain(code)) {
    const bool fits = std::ranges::all_of(run, [&](uint32_t v) { return v >> plain_bits(code) == 0; });
    return fits ? uint64_t{plain_bits(code)} * run.size() : UINT64_MAX;
  }
  uint64_t bits = 0;
  for (uint32_t v : run) bits += exp_golomb_bits(v, code);
  return bits;
}

uint32_t cheapest_code(std::span<const uint32_t> run) {
  if (std::ranges::all_of(run, [](uint32_t v) { return v == 0; })) return kAllZeros;
  uint32_t best = 0;
  uint64_t best_bits = UINT64_MAX;
  for (uint32_t code = 0; code < kAllZeros; ++code) {
    const uint64_t bits = bits_of(run, code);
    if (bits >= best_bits) continue;
    best_bits = bits;
    best = code;
  }
  return best;
}

void put(BitWriter& out, uint32_t value, uint32_t code) {
  if (code == kAllZeros) return;
  is_plain(code) ? out.put(value, plain_bits(code)) : out.put_unsigned(value, code);
}

uint32_t get(BitReader& in, uint32_t code) {
  if (code == kAllZeros) return 0;
  return is_plain(code) ? static_cast<uint32_t>(in.get(plain_bits(code))) : in.get_unsigned(code);
}

}  // namespace

void write_column(BitWriter& out, std::span<const uint32_t> values) {
  for (size_t first = 0; first < values.size(); first += kRunLength) {
    const auto run = values.subspan(first, std::min<size_t>(kRunLength, values.size() - first));
    const uint32_t code = cheapest_code(run);
    out.put(code, kCodeBits);
    for (uint32_t v : run) put(out, v, code);
  }
}

std::vector<uint32_t> read_column(BitReader& in, uint32_t count) {
  std::vector<uint32_t> values;
  while (in.ok() && values.size() < count) {
    const uint32_t length = std::min<uint32_t>(kRunLength, count - static_cast<uint32_t>(values.size()));
    const auto code = static_cast<uint32_t>(in.get(kCodeBits));
    for (uint32_t i = 0; i < length && in.ok(); ++i) values.push_back(get(in, code));
  }
  return values;
}

void write_repeats(BitWriter& out, std::span<const uint32_t> values) {
  std::vector<uint32_t> lengths, deltas;
  uint32_t previous = 0;
  for (size_t i = 0; i < values.size();) {
    size_t end = i + 1;
    while (end < values.size() && values[end] == values[i]) ++end;
    lengths.push_back(static_cast<uint32_t>(end - i - 1));
    deltas.push_back(delta(values[i], previous));
    previous = values[i];
    i = end;
  }
  out.put_unsigned(static_cast<uint32_t>(lengths.size()), 4);
  write_column(out, lengths);
  write_column(out, deltas);
}

bool read_repeats(BitReader& in, uint32_t count, const std::function<void(uint32_t, uint32_t)>& on_run) {
  const uint32_t runs = in.get_unsigned(4);
  if (!in.ok() || runs > count) return false;
  const auto lengths = read_column(in, runs);
  const auto deltas = read_column(in, runs);
  if (!in.ok()) return false;
  uint32_t left = count, value = 0;
  for (uint32_t i = 0; i < runs; ++i) {
    if (lengths[i] >= left) return false;
    left -= lengths[i] + 1;
    value = undelta(deltas[i], value);
    on_run(lengths[i] + 1, value);
  }
  return left == 0;
}

}  // namespace tessera::geometry_compression
