#include "transport/nal.h"

#include <algorithm>

namespace tessera::transport {
namespace {

// Where the next 00 00 01 begins at or after `at`; the end if there is none.
size_t find_start_code(std::span<const uint8_t> stream, size_t at) {
  static constexpr uint8_t kStartCode[] = {0, 0, 1};
  const auto found = std::search(stream.begin() + static_cast<ptrdiff_t>(at), stream.end(),
                                 std::begin(kStartCode), std::end(kStartCode));
  return static_cast<size_t>(found - stream.begin());
}

}  // namespace

std::vector<Nal> split_annex_b(std::span<const uint8_t> stream) {
  std::vector<Nal> nals;
  size_t code = find_start_code(stream, 0);
  while (code < stream.size()) {
    const size_t begin = code + 3;
    code = find_start_code(stream, begin);
    size_t end = code;
    while (end > begin && stream[end - 1] == 0) --end;
    if (end > begin) nals.push_back(stream.subspan(begin, end - begin));
  }
  return nals;
}

void append_annex_b(std::vector<uint8_t>& stream, Nal nal) {
  stream.insert(stream.end(), {0, 0, 0, 1});
  stream.insert(stream.end(), nal.begin(), nal.end());
}

}  // namespace tessera::transport
