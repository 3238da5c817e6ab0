#include "codec/jpeg_decoder.h"

#include "codec/mcu_tiles.h"
#include "codec/parallel.h"
#include "codec/yuv.h"

namespace tessera::codec {

JpegDecoder::JpegDecoder(uint32_t max_width, uint32_t max_height) : limits_{max_width, max_height} {}

Status JpegDecoder::decode_tile(Worker& worker, const TiledPicture& picture, size_t index) {
  const std::span<const uint32_t> mcus = mcus_of_tile(picture.mcus, index);
  resize_tile(mcus.size(), worker.tile);
  TESSERA_RETURN_IF_ERROR(worker.jpeg.decompress(picture.tables, picture.tiles[index], worker.tile));
  scatter(worker.tile, mcus, picture_);
  return absl::OkStatus();
}

StatusOr<DecodedFrame> JpegDecoder::decode(std::span<const uint8_t> packet) {
  TESSERA_ASSIGN_OR_RETURN(const TiledPicture picture, read_packet(packet, limits_));
  resize(picture.header.width, picture.header.height, picture_);
  workers_.resize(std::max(workers_.size(), workers_for(picture.tiles.size())));
  std::vector<Status> failures(picture.tiles.size());
  for_each_part(picture.tiles.size(), workers_.size(), [&](size_t worker, size_t tile) {
    failures[tile] = decode_tile(workers_[worker], picture, tile);
  });
  for (const Status& failure : failures) TESSERA_RETURN_IF_ERROR(failure);
  return DecodedFrame{picture.header.frame, view_of(picture_)};
}

}  // namespace tessera::codec
