#include "geometry-compression/columns.h"

#include <algorithm>

namespace tessera::geometry_compression {
namespace {

uint32_t cheapest_order(std::span<const uint32_t> run) {
  uint32_t best = 0;
  uint64_t best_bits = UINT64_MAX;
  for (uint32_t order = 0; order < kAllZeros; ++order) {
    uint64_t bits = 0;
    for (uint32_t v : run) bits += exp_golomb_bits(v, order);
    if (bits >= best_bits) continue;
    best_bits = bits;
    best = order;
  }
  return best;
}

}  // namespace

void write_column(BitWriter& out, std::span<const uint32_t> values) {
  for (size_t first = 0; first < values.size(); first += kRunLength) {
    const auto run = values.subspan(first, std::min<size_t>(kRunLength, values.size() - first));
    if (std::all_of(run.begin(), run.end(), [](uint32_t v) { return v == 0; })) {
      out.put(kAllZeros, kOrderBits);
      continue;
    }
    const uint32_t order = cheapest_order(run);
    out.put(order, kOrderBits);
    for (uint32_t v : run) out.put_unsigned(v, order);
  }
}

std::vector<uint32_t> read_column(BitReader& in, uint32_t count) {
  std::vector<uint32_t> values;
  while (in.ok() && values.size() < count) {
    const uint32_t length = std::min<uint32_t>(kRunLength, count - static_cast<uint32_t>(values.size()));
    const auto order = static_cast<uint32_t>(in.get(kOrderBits));
    for (uint32_t i = 0; i < length && in.ok(); ++i)
      values.push_back(order == kAllZeros ? 0 : in.get_unsigned(order));
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
