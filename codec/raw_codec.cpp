#include "codec/raw_codec.h"

#include "codec/picture_packet.h"

namespace tessera::codec {
namespace {

void append_plane(const uint8_t* plane, uint32_t stride, uint32_t width, uint32_t height,
                  std::vector<uint8_t>& out) {
  for (uint32_t row = 0; row < height; ++row)
    out.insert(out.end(), plane + size_t{row} * stride, plane + size_t{row} * stride + width);
}

}  // namespace

StatusOr<std::unique_ptr<RawEncoder>> RawEncoder::create(uint32_t width, uint32_t height) {
  TESSERA_RETURN_IF_ERROR(check_sides(width, height));
  return std::unique_ptr<RawEncoder>(new RawEncoder(width, height));
}

StatusOr<AccessUnit> RawEncoder::encode(FrameNumber frame, const AtlasPicture& picture, double, bool) {
  const YuvView& yuv = picture.yuv;
  if (yuv.width != width_ || yuv.height != height_)
    return absl::InvalidArgumentError(
        absl::StrFormat("encode: the picture is %ux%u, the encoder was made for %ux%u", yuv.width, yuv.height,
                        width_, height_));
  AccessUnit unit{.frame = frame, .key_frame = true};
  unit.bytes.reserve(kPictureHeaderBytes + size_t{width_} * height_ * 3 / 2);
  append_header({AtlasCodec::raw, frame, width_, height_}, unit.bytes);
  append_plane(yuv.y, yuv.y_stride, width_, height_, unit.bytes);
  append_plane(yuv.u, yuv.uv_stride, width_ / 2, height_ / 2, unit.bytes);
  append_plane(yuv.v, yuv.uv_stride, width_ / 2, height_ / 2, unit.bytes);
  return unit;
}

StatusOr<DecodedFrame> RawDecoder::decode(std::span<const uint8_t> packet) {
  TESSERA_ASSIGN_OR_RETURN(const PictureHeader header, read_header(packet, AtlasCodec::raw, limits_));
  const size_t luma = size_t{header.width} * header.height;
  if (packet.size() != kPictureHeaderBytes + luma * 3 / 2)
    return absl::InvalidArgumentError(
        absl::StrFormat("raw picture: %u bytes for %ux%u", packet.size(), header.width, header.height));
  planes_.assign(packet.begin() + kPictureHeaderBytes, packet.end());
  const uint8_t* y = planes_.data();
  return DecodedFrame{
      header.frame,
      {header.width, header.height, y, y + luma, y + luma * 5 / 4, header.width, header.width / 2}};
}

}  // namespace tessera::codec
