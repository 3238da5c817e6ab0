#include "test_streams.h"

#include <cctype>

#include "transport/nal.h"

namespace tessera::transport::test {

Bytes from_hex(std::string_view hex) {
  Bytes out;
  int digits = 0, value = 0;
  for (char c : hex) {
    if (std::isspace(static_cast<unsigned char>(c))) continue;
    value = value * 16 + (std::isdigit(static_cast<unsigned char>(c)) ? c - '0' : std::tolower(c) - 'a' + 10);
    if (++digits % 2 == 0) {
      out.push_back(static_cast<uint8_t>(value));
      value = 0;
    }
  }
  return out;
}

Bytes make_nal(uint8_t type, size_t bytes, std::mt19937_64& random) {
  Bytes nal(bytes);
  nal[0] = static_cast<uint8_t>(3 << 5 | type);
  for (size_t i = 1; i < bytes; ++i) nal[i] = static_cast<uint8_t>(random() % 255 + 1);
  return nal;
}

Bytes join(const std::vector<Bytes>& nals) {
  Bytes out;
  for (const Bytes& nal : nals) append_annex_b(out, nal);
  return out;
}

Bytes make_access_unit(bool key_frame, size_t bytes, std::mt19937_64& random) {
  if (!key_frame) return join({make_nal(1, bytes, random)});
  return join(
      {make_nal(kNalSps, 12, random), make_nal(kNalPps, 6, random), make_nal(kNalIdrSlice, bytes, random)});
}

}  // namespace tessera::transport::test
