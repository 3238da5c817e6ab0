#include "codec/annex_b.h"

#include <algorithm>

namespace tessera::codec {
namespace {

constexpr uint8_t kUserDataUnregistered = 5;
constexpr size_t kTagSize = sizeof(kFrameUuid) + 8;

bool is_slice(Nal nal) {
  return type_of(nal) == NalType::slice || type_of(nal) == NalType::idr_slice;
}

void append(std::vector<uint8_t>& out, Nal nal) {
  out.insert(out.end(), {0, 0, 0, 1});
  out.insert(out.end(), nal.begin(), nal.end());
}

void append_u32(std::vector<uint8_t>& out, uint32_t v) {
  for (int shift = 24; shift >= 0; shift -= 8) out.push_back(static_cast<uint8_t>(v >> shift));
}

uint32_t read_u32(const uint8_t* p) {
  return uint32_t{p[0]} << 24 | uint32_t{p[1]} << 16 | uint32_t{p[2]} << 8 | uint32_t{p[3]};
}

// H.264 7.4.1: no start code may appear inside, so a 3 goes between two zeros and a byte up to 3.
std::vector<uint8_t> escaped(std::span<const uint8_t> raw) {
  std::vector<uint8_t> out;
  int zeros = 0;
  for (uint8_t byte : raw) {
    if (zeros == 2 && byte <= 3) {
      out.push_back(3);
      zeros = 0;
    }
    out.push_back(byte);
    zeros = byte == 0 ? zeros + 1 : 0;
  }
  return out;
}

std::vector<uint8_t> unescaped(Nal nal) {
  std::vector<uint8_t> out;
  int zeros = 0;
  for (uint8_t byte : nal) {
    if (zeros >= 2 && byte == 3) {
      zeros = 0;
      continue;
    }
    out.push_back(byte);
    zeros = byte == 0 ? zeros + 1 : 0;
  }
  return out;
}

std::vector<uint8_t> tag_nal(const FrameTag& tag) {
  std::vector<uint8_t> raw = {static_cast<uint8_t>(NalType::sei), kUserDataUnregistered, kTagSize};
  raw.insert(raw.end(), std::begin(kFrameUuid), std::end(kFrameUuid));
  append_u32(raw, tag.frame);
  append_u32(raw, tag.reference);
  raw.push_back(0x80);  // stop bit
  return escaped(raw);
}

// A number written as a sum of bytes of which all but the last are 255 (H.264 7.3.2.3.1); false past the end.
bool read_sum(std::span<const uint8_t> bytes, size_t& at, size_t& sum) {
  sum = 0;
  while (at < bytes.size()) {
    sum += bytes[at];
    if (bytes[at++] != 255) return true;
  }
  return false;
}

std::optional<FrameTag> find_tag(Nal sei) {
  const std::vector<uint8_t> raw = unescaped(sei);
  size_t at = 1, type = 0, size = 0;
  while (read_sum(raw, at, type) && read_sum(raw, at, size) && size <= raw.size() - at) {
    const uint8_t* payload = raw.data() + at;
    if (type == kUserDataUnregistered && size >= kTagSize &&
        std::equal(std::begin(kFrameUuid), std::end(kFrameUuid), payload))
      return FrameTag{read_u32(payload + sizeof(kFrameUuid)), read_u32(payload + sizeof(kFrameUuid) + 4)};
    at += size;
  }
  return std::nullopt;
}

}  // namespace

std::vector<Nal> split_nals(std::span<const uint8_t> access_unit) {
  std::vector<Nal> nals;
  const auto add = [&](size_t begin, size_t end) {
    while (end > begin && access_unit[end - 1] == 0) --end;
    if (end > begin) nals.push_back(access_unit.subspan(begin, end - begin));
  };
  size_t begin = access_unit.size();  // until the first start code
  size_t at = 0;
  while (at + 3 <= access_unit.size()) {
    if (access_unit[at] != 0 || access_unit[at + 1] != 0 || access_unit[at + 2] != 1) {
      ++at;
      continue;
    }
    if (begin < at) add(begin, at);
    begin = at + 3;
    at = begin;
  }
  if (begin < access_unit.size()) add(begin, access_unit.size());
  return nals;
}

std::vector<uint8_t> with_tag(std::span<const uint8_t> access_unit, const FrameTag& tag) {
  std::vector<uint8_t> out;
  out.reserve(access_unit.size() + kTagBits / 8);
  bool tagged = false;
  for (Nal nal : split_nals(access_unit)) {
    if (type_of(nal) == NalType::sei) continue;
    if (is_slice(nal) && !tagged) {
      append(out, tag_nal(tag));
      tagged = true;
    }
    append(out, nal);
  }
  return out;
}

AccessUnitInfo inspect(std::span<const uint8_t> access_unit) {
  AccessUnitInfo info;
  for (Nal nal : split_nals(access_unit)) {
    info.has_slice = info.has_slice || is_slice(nal);
    info.key_frame = info.key_frame || type_of(nal) == NalType::idr_slice;
    if (type_of(nal) == NalType::sei && !info.tag) info.tag = find_tag(nal);
  }
  return info;
}

}  // namespace tessera::codec
