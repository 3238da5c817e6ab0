#include "transport/frame_io.h"

#include <algorithm>

#include "transport/byte_io.h"

namespace tessera::transport {
namespace {

Status too_long(size_t bytes, size_t max_payload) {
  return absl::InvalidArgumentError(
      absl::StrCat("frame payload of ", bytes, " bytes exceeds max_payload (", max_payload, ")"));
}

uint32_t length_of(std::span<const uint8_t, kFrameHeaderBytes> header) {
  return ByteReader(header).u32();
}

}  // namespace

Status write_frame(FrameType type, std::span<const uint8_t> payload, std::vector<uint8_t>& out,
                   size_t max_payload) {
  if (payload.size() > max_payload || payload.size() > UINT32_MAX)
    return too_long(payload.size(), max_payload);
  ByteWriter w(out);
  w.u32(static_cast<uint32_t>(payload.size()));
  w.u8(static_cast<uint8_t>(type));
  w.bytes(payload);
  return absl::OkStatus();
}

Status FrameParser::check_header() const {
  const uint8_t type = header_[4];
  if (type < static_cast<uint8_t>(FrameType::hello) || type > static_cast<uint8_t>(FrameType::bye))
    return absl::InvalidArgumentError(absl::StrCat("frame type ", type, " does not exist"));
  if (length_of(header_) > max_payload_) return too_long(length_of(header_), max_payload_);
  return absl::OkStatus();
}

// Takes what it can of one frame from the front of `bytes`.
Status FrameParser::feed_frame(std::span<const uint8_t>& bytes, const Handler& handler) {
  if (header_bytes_ < kFrameHeaderBytes) {
    const size_t take = std::min(bytes.size(), kFrameHeaderBytes - header_bytes_);
    std::copy_n(bytes.begin(), take, header_.begin() + static_cast<ptrdiff_t>(header_bytes_));
    header_bytes_ += take;
    bytes = bytes.subspan(take);
    if (header_bytes_ < kFrameHeaderBytes) return absl::OkStatus();
    TESSERA_RETURN_IF_ERROR(check_header());
  }
  const size_t length = length_of(header_);
  const size_t take = std::min(bytes.size(), length - payload_.size());
  std::span<const uint8_t> payload = bytes.first(take);
  bytes = bytes.subspan(take);
  if (take < length) {  // not whole in one piece
    payload_.insert(payload_.end(), payload.begin(), payload.end());
    if (payload_.size() < length) return absl::OkStatus();
    payload = payload_;
  }
  header_bytes_ = 0;
  const Status status = handler(static_cast<FrameType>(header_[4]), payload);
  payload_.clear();
  return status;
}

Status FrameParser::feed(std::span<const uint8_t> bytes, const Handler& handler) {
  // A frame of no payload is complete with its header, so the last header may end the bytes.
  while (status_.ok() && !bytes.empty()) status_ = feed_frame(bytes, handler);
  return status_;
}

}  // namespace tessera::transport
