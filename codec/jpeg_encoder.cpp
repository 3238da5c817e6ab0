#include "codec/jpeg_encoder.h"

#include <algorithm>
#include <cmath>

#include "codec/mcu_tiles.h"
#include "codec/parallel.h"
#include "codec/picture_packet.h"

namespace tessera::codec {
namespace {

// Aimed at a little below the budget; what is above it, or below this share, is worth another try.
constexpr double kAim = 0.96, kGoodShare = 0.9;
constexpr int kTries = 4, kMostTries = 12;  // while one fits already; while none does

// The next scale to try: the guess, but inside what earlier tries have left.
double narrowed(double guess, double too_fine, double fits) {
  return guess > 1.001 * too_fine && guess < 0.999 * fits ? guess : std::sqrt(too_fine * fits);
}

}  // namespace

JpegEncoder::JpegEncoder(uint32_t width, uint32_t height)
    : width_(width), height_(height), all_(width, height) {
  all_.add_rectangle(0, 0, width, height);
  const size_t workers = workers_for(tile_count(used_mcus(all_).size()));
  compressors_ = std::vector<JpegCompressor>(workers);
  choice_ = absl::StrCat("libjpeg-turbo, baseline JPEG, on up to ", workers, " threads");
}

StatusOr<std::unique_ptr<JpegEncoder>> JpegEncoder::create(uint32_t width, uint32_t height) {
  TESSERA_RETURN_IF_ERROR(check_sides(width, height));
  return std::unique_ptr<JpegEncoder>(new JpegEncoder(width, height));
}

double JpegEncoder::Coded::bits() const {
  size_t bytes = tables.size();
  for (const auto& tile : tiles) bytes += tile.size() + sizeof(uint32_t);  // with its length
  return 8.0 * static_cast<double>(bytes);
}

void JpegEncoder::gather_tiles(const AtlasPicture& picture) {
  mcus_ = used_mcus(*picture.used);
  tiles_.resize(tile_count(mcus_.size()));
  for_each_part(tiles_.size(), compressors_.size(),
                [&](size_t, size_t i) { gather(picture, mcus_of_tile(mcus_, i), tiles_[i]); });
}

StatusOr<JpegEncoder::Coded> JpegEncoder::compress(double scale) {
  Coded coded{.scale = scale};
  TESSERA_ASSIGN_OR_RETURN(coded.tables, compressors_[0].tables(scale));
  std::vector<StatusOr<std::vector<uint8_t>>> done(tiles_.size());
  for_each_part(tiles_.size(), compressors_.size(),
                [&](size_t worker, size_t i) { done[i] = compressors_[worker].compress(tiles_[i], scale); });
  for (auto& tile : done) {
    TESSERA_RETURN_IF_ERROR(tile.status());
    coded.tiles.push_back(*std::move(tile));
  }
  return coded;
}

StatusOr<JpegEncoder::Coded> JpegEncoder::compress_within(double budget_bits) {
  const auto mcus = static_cast<double>(mcus_.size());
  double too_fine = kFinestScale, fits = kCoarsestScale;  // bounds of the scales that are still worth a try
  double scale = search_.scale_for(kAim * budget_bits / mcus);
  Coded best;
  for (int tries = 1;; ++tries) {
    TESSERA_ASSIGN_OR_RETURN(Coded coded, compress(scale));
    const double bits = coded.bits();
    search_.learn(scale, bits / mcus, tries > 1);
    const bool good = bits <= budget_bits;
    (good ? fits : too_fine) = scale;
    if (good || best.tiles.empty() || best.bits() > budget_bits) best = std::move(coded);
    const bool done = good && (bits >= kGoodShare * budget_bits || scale <= kFinestScale || tries >= kTries);
    if (done || tries == kMostTries || (!good && scale >= kCoarsestScale)) return best;
    const double guess = search_.scale_for(kAim * budget_bits / mcus);
    const bool at_an_end = (good && guess <= kFinestScale) || (!good && guess >= kCoarsestScale);
    scale = at_an_end ? guess : narrowed(guess, too_fine, fits);
  }
}

StatusOr<AccessUnit> JpegEncoder::encode(FrameNumber frame, const AtlasPicture& picture, double budget_bits,
                                         bool) {
  if (!(budget_bits > 0))
    return absl::InvalidArgumentError(absl::StrFormat("encode: a budget of %g bits", budget_bits));
  const AtlasPicture whole(picture.yuv, picture.used ? picture.used : &all_);
  for (const auto& [width, height] : {std::pair(picture.yuv.width, picture.yuv.height),
                                      std::pair(whole.used->width(), whole.used->height())})
    if (width != width_ || height != height_)
      return absl::InvalidArgumentError(
          absl::StrFormat("encode: the picture or its occupancy is %ux%u, the encoder was made for %ux%u",
                          width, height, width_, height_));
  gather_tiles(whole);
  TiledPicture packet{.header = {AtlasCodec::jpeg, frame, width_, height_}, .mcus = mcus_};
  Coded coded;
  if (!mcus_.empty()) {
    TESSERA_ASSIGN_OR_RETURN(
        coded,
        compress_within(std::max(1.0, budget_bits - 8.0 * static_cast<double>(write_packet(packet).size()))));
  }
  packet.tables = coded.tables;
  packet.tiles.assign(coded.tiles.begin(), coded.tiles.end());
  return AccessUnit{frame, true, write_packet(packet)};
}

}  // namespace tessera::codec
