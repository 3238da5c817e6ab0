// Cuts a fuzzer's input into pieces: a length byte before each.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>

template <class Use>
void for_each_piece(const uint8_t* data, size_t size, Use&& use) {
  std::span<const uint8_t> rest(data, size);
  while (!rest.empty()) {
    const size_t length = std::min<size_t>(rest[0], rest.size() - 1);
    use(rest.subspan(1, length));
    rest = rest.subspan(1 + length);
  }
}
