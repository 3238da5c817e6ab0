#include "bench/rate_client.h"

#include <utility>

namespace tessera::bench {

StatusOr<RateClient> RateClient::create(const LoopbackSettings& settings, double bitrate_mbps) {
  RateClient client;
  client.rate_.bitrate_bps = bitrate_mbps * 1e6;
  client.rate_.frames_per_second = settings.server_fps;
  const codec::EncoderSettings video{.width = settings.atlas.width,
                                     .height = settings.atlas.height,
                                     .frames_per_second = client.rate_.frames_per_second,
                                     .bitrate_bps = client.rate_.bitrate_bps};
  TESSERA_ASSIGN_OR_RETURN(client.encoder_, codec::AtlasEncoder::create(AtlasCodec::h264, video));
  TESSERA_ASSIGN_OR_RETURN(client.decoder_, codec::AtlasDecoder::create(AtlasCodec::h264));
  return client;
}

StatusOr<double> RateClient::serve(FrameNumber frame, const YuvView& atlas, double meta_bits) {
  const bool key_frame = std::exchange(first_, false);
  const double budget = balance_.atlas_bits(rate_, meta_bits, key_frame);
  TESSERA_ASSIGN_OR_RETURN(const codec::AccessUnit unit, encoder_->encode(frame, atlas, budget, key_frame));
  TESSERA_ASSIGN_OR_RETURN(const codec::DecodedFrame decoded, decoder_->decode(unit.bytes));
  decoded_ = decoded.picture;
  const double bits = 8.0 * static_cast<double>(unit.bytes.size());
  balance_.spend(bits);
  return bits;
}

}  // namespace tessera::bench
