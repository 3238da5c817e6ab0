#include "codec/jpeg_encoder.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>

#include "codec/mcu_tiles.h"
#include "codec/parallel.h"
#include "codec/picture_packet.h"

namespace tessera::codec {
namespace {

// Aimed at a little below the budget; what is above it, or below this share, is worth another try. Between
// them lies what the sample errs by from picture to picture, a few percent: another try costs as much time as
// the first.
constexpr double kAim = 0.975, kGoodShare = 0.92;
constexpr int kTries = 3, kMostTries = 8;  // with the whole picture: while one fits already; while none does
constexpr int kPlanTries = 6;              // with its sample, whose size
constexpr double kFar = 0.08;              // off by more than this tells too little of the right scale

// The sample: a run of squares in every n, at a place of its own in each: an even stride that divides the
// atlas's rows would see a few of its columns alone. Runs are short, because neighbours are alike: the more
// places, the better the sample stands for the whole.
constexpr size_t kRunMcus = 4, kSampleEvery = 12, kMinSampleRuns = 128;

std::vector<uint32_t> sample_of(std::span<const uint32_t> mcus) {
  const size_t runs = (mcus.size() + kRunMcus - 1) / kRunMcus;
  const size_t taken = std::min(runs, std::max(kMinSampleRuns, runs / kSampleEvery));
  std::vector<uint32_t> sample;
  for (size_t i = 0; i < taken; ++i) {
    const double place = std::fmod(static_cast<double>(i) * std::numbers::phi, 1.0);
    const auto at = static_cast<size_t>((static_cast<double>(i) + place) * static_cast<double>(runs) /
                                        static_cast<double>(taken));
    const auto run = mcus.subspan(std::min(at, runs - 1) * kRunMcus);
    sample.insert(sample.end(), run.begin(), run.begin() + std::min(kRunMcus, run.size()));
  }
  return sample;
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
  const std::vector<uint32_t> sample = sample_of(mcus_);
  gather(picture, sample, sample_);
  sample_share_ = static_cast<double>(sample.size()) / static_cast<double>(mcus_.size());
}

StatusOr<JpegEncoder::Plan> JpegEncoder::plan_for(double bits) {
  const auto mcus = static_cast<double>(mcus_.size());
  double scale = search_.scale_for(bits / mcus);
  for (int tries = 1;; ++tries) {
    TESSERA_ASSIGN_OR_RETURN(const auto fitted, compressors_[0].codes_for(sample_, scale));
    const double sample_bits = 8.0 * static_cast<double>(fitted.bytes) / sample_share_;
    const double expected = sample_bits * whole_to_sample_;
    search_.learn(scale, expected / mcus, tries > 1);
    const double better = search_.scale_for(bits / mcus);
    if (std::abs(expected - bits) <= kFar * bits || tries == kPlanTries || better == scale)
      return Plan{better, fitted.codes, search_.bits_per_mcu(better) * mcus};
    scale = better;
  }
}

StatusOr<JpegEncoder::Coded> JpegEncoder::compress(const Plan& plan) {
  Coded coded;
  TESSERA_ASSIGN_OR_RETURN(coded.tables, compressors_[0].tables(plan.scale, plan.codes));
  std::vector<StatusOr<std::vector<uint8_t>>> done(tiles_.size());
  for_each_part(tiles_.size(), compressors_.size(), [&](size_t worker, size_t i) {
    done[i] = compressors_[worker].compress(tiles_[i], plan.scale, plan.codes);
  });
  for (auto& tile : done) {
    TESSERA_RETURN_IF_ERROR(tile.status());
    coded.tiles.push_back(*std::move(tile));
  }
  return coded;
}

StatusOr<JpegEncoder::Coded> JpegEncoder::compress_within(double budget_bits) {
  Coded best;
  double aim = kAim * budget_bits;
  for (int tries = 1;; ++tries) {
    TESSERA_ASSIGN_OR_RETURN(const Plan plan, plan_for(aim));
    TESSERA_ASSIGN_OR_RETURN(Coded coded, compress(plan));
    const double bits = coded.bits();
    whole_to_sample_ *= bits / plan.expected_bits;
    const bool fits = bits <= budget_bits;
    if (best.tiles.empty() || (fits ? bits > best.bits() || best.bits() > budget_bits : bits < best.bits()))
      best = std::move(coded);
    const bool at_an_end = plan.scale <= kFinestScale ? fits : !fits && plan.scale >= kCoarsestScale;
    const bool good = fits && (bits >= kGoodShare * budget_bits || tries >= kTries);
    if (good || at_an_end || tries == kMostTries) return best;
    if (!fits) aim *= kAim;  // small pictures are hard to foretell
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
