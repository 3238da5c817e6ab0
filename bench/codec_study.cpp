#include "bench/codec_study.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <nlohmann/json.hpp>

#include "bench/shading_streamer.h"
#include "bench/study_scene.h"
#include "bench/truth_source.h"
#include "codec/atlas_decoder.h"
#include "codec/atlas_encoder.h"
#include "codec/yuv.h"
#include "server/sample_map.h"

namespace tessera::bench {
namespace {

constexpr uint32_t kMcu = 16;
constexpr uint32_t kGap = 64;      // side of the squares of the half that is empty
constexpr uint32_t kPictures = 4;  // server frames of the scene
constexpr std::array kCodecs = {AtlasCodec::h264, AtlasCodec::jpeg};
constexpr double kMtexel = 1 << 20;

Size atlas_size(uint32_t mtexels) {
  Size size{1024, 1024};
  for (uint32_t n = mtexels; n > 1; n /= 2) (size.width > size.height ? size.height : size.width) *= 2;
  return size;
}

YuvImage copy_of(const YuvView& view) {
  YuvImage out;
  codec::resize(view.width, view.height, out);
  const auto copy = [](const uint8_t* from, uint32_t stride, uint32_t width, std::vector<uint8_t>& to) {
    for (size_t row = 0; row < to.size() / width; ++row)
      std::copy_n(from + row * stride, width, &to[row * width]);
  };
  copy(view.y, view.y_stride, view.width, out.y);
  copy(view.u, view.uv_stride, view.width / 2, out.u);
  copy(view.v, view.uv_stride, view.width / 2, out.v);
  return out;
}

// Makes the square at (x, y) of the picture (in squares) another one's copy.
void copy_square(YuvImage& picture, uint32_t from, uint32_t to) {
  const auto copy = [&](std::vector<uint8_t>& plane, size_t stride, size_t side) {
    const size_t columns = stride / side;
    const auto at = [&](uint32_t square) {
      return square / columns * side * stride + square % columns * side;
    };
    for (size_t row = 0; row < side; ++row)
      std::copy_n(&plane[at(from) + row * stride], side, &plane[at(to) + row * stride]);
  };
  copy(picture.y, picture.width, kMcu);
  copy(picture.u, picture.width / 2, kMcu / 2);
  copy(picture.v, picture.width / 2, kMcu / 2);
}

// Squares that are not wholly used become copies of such that are, so that no texel is empty.
void fill_up(YuvImage& picture, const codec::Occupancy& used) {
  const uint32_t columns = picture.width / kMcu, squares = columns * (picture.height / kMcu);
  const auto whole = [&](uint32_t square) {
    const uint32_t x = square % columns * 2, y = square / columns * 2;
    return (used.block(x, y) & used.block(x + 1, y) & used.block(x, y + 1) & used.block(x + 1, y + 1)) ==
           codec::Occupancy::kFull;
  };
  std::vector<uint32_t> sources;
  for (uint32_t square = 0; square < squares; ++square)
    if (whole(square)) sources.push_back(square);
  if (sources.empty()) return;
  size_t next = 0;
  for (uint32_t square = 0; square < squares; ++square)
    if (!whole(square)) copy_square(picture, sources[next++ % sources.size()], square);
}

// All of it, or every other square of a chessboard.
codec::Occupancy occupancy(Size size, double fill) {
  codec::Occupancy used(size.width, size.height);
  if (fill == 1) used.add_rectangle(0, 0, size.width, size.height);
  if (fill < 1)
    for (uint32_t y = 0; y < size.height; y += kGap)
      for (uint32_t x = y % (2 * kGap); x < size.width; x += 2 * kGap) used.add_rectangle(x, y, kGap, kGap);
  return used;
}

struct Quality {
  double ssim = 0, psnr = 0;
};

// Windows that reach into unused texels see the original there.
Quality quality(const YuvImage& original, const YuvView& decoded, const codec::Occupancy& used) {
  Plane a(original.width, original.height), b = a;
  double squares = 0;
  for (uint32_t y = 0; y < a.height; ++y)
    for (uint32_t x = 0; x < a.width; ++x) {
      const size_t at = size_t{y} * a.width + x;
      const int coded = used.uses(x, y) ? decoded.y[size_t{y} * decoded.y_stride + x] : original.y[at];
      a.values[at] = static_cast<float>(original.y[at]) / 255;
      b.values[at] = static_cast<float>(coded) / 255;
      squares += (coded - original.y[at]) * (coded - original.y[at]);
    }
  const Plane map = ssim_map(a, b, gaussian_window(11, 2));
  double sum = 0;
  for (uint32_t y = 0; y < a.height; ++y)
    for (uint32_t x = 0; x < a.width; ++x)
      if (used.uses(x, y)) sum += map.row(y)[x];
  const auto samples = static_cast<double>(used.texels());
  return {sum / samples, psnr_db(squares / (samples * 255 * 255))};
}

struct Duration {
  double wall_ms = 0, cpu_ms = 0;
};

// By the clock on the wall and by that of all the process's threads.
class Watch {
 public:
  Duration lap() {
    const TimeNs now = clock_.now();
    const std::clock_t cpu_now = std::clock();
    const Duration out{to_ms(now - std::exchange(wall_, now)),
                       1e3 * static_cast<double>(cpu_now - std::exchange(cpu_, cpu_now)) / CLOCKS_PER_SEC};
    return out;
  }

 private:
  SteadyClock clock_;
  TimeNs wall_ = clock_.now();
  std::clock_t cpu_ = std::clock();
};

struct Coded {
  Duration encode, decode;
  double bits = 0;
  YuvView picture;  // the decoder's
};

// A codec's two ends.
struct Coder {
  std::unique_ptr<codec::AtlasEncoder> encoder;
  std::unique_ptr<codec::AtlasDecoder> decoder;
  FrameNumber next = 0;

  static StatusOr<Coder> create(AtlasCodec codec, Size size, double fps, double bits) {
    Coder coder;
    TESSERA_ASSIGN_OR_RETURN(coder.encoder, codec::AtlasEncoder::create(
                                                codec, {.width = size.width,
                                                        .height = size.height,
                                                        .frames_per_second = fps,
                                                        .bitrate_bps = std::clamp(bits * fps, 1000.0, 2e9)}));
    TESSERA_ASSIGN_OR_RETURN(coder.decoder, codec::AtlasDecoder::create(codec));
    return coder;
  }

  StatusOr<Coded> run(const YuvImage& picture, const codec::Occupancy& used, double bits) {
    const codec::AtlasPicture input(codec::view_of(picture), &used);
    Watch watch;
    TESSERA_ASSIGN_OR_RETURN(const codec::AccessUnit unit, encoder->encode(next, input, bits, next == 0));
    const Duration encoded = watch.lap();
    TESSERA_ASSIGN_OR_RETURN(const codec::DecodedFrame frame, decoder->decode(unit.bytes));
    ++next;
    return Coded{encoded, watch.lap(), 8.0 * static_cast<double>(unit.bytes.size()), frame.picture};
  }
};

// One atlas size: the scene's pictures, and all codecs on them.
class SizeStudy {
 public:
  SizeStudy(const CodecStudySettings& settings, uint32_t mtexels, CodecStudyResult& result)
      : settings_(settings), size_(atlas_size(mtexels)), result_(result) {}

  // By one codec from server to client; the first time also keeps the atlases.
  Status stream(std::shared_ptr<server::SharedScene> scene, const CameraPath& path, TruthSource& truth,
                AtlasCodec codec);
  Status code();

 private:
  struct Measured {
    std::vector<double> encode_ms, decode_ms, encode_cpu_ms, decode_cpu_ms;
    double bits = 0, ssim = 0, psnr = 0;
  };

  double texels() const { return static_cast<double>(size_.width) * size_.height; }
  void keep_atlas(const server::Session& session);
  StatusOr<double> equal_quality_share(AtlasCodec codec);
  void add_rows(AtlasCodec codec, std::span<const Measured> by_fill, double equal_quality_share);

  const CodecStudySettings& settings_;
  const Size size_;
  CodecStudyResult& result_;
  std::vector<YuvImage> atlases_;
  static constexpr std::array kFills = {1.0, 0.5};
};

void SizeStudy::keep_atlas(const server::Session& session) {
  codec::Occupancy used(size_.width, size_.height);
  server::map_samples(session.placements(), used);
  fill_up(atlases_.emplace_back(copy_of(session.yuv())), used);
}

// The client's picture of the newest frame, coded and not, is compared with each other and with the truth.
Status add_picture(ShadingStreamer& streamer, const View& view, const Image8& truth, CodecPictureRow& row) {
  constexpr double kShare = 1.0 / (kPictures - 1);
  TESSERA_ASSIGN_OR_RETURN(const Image8 uncoded, streamer.draw_uncoded(view));
  TESSERA_ASSIGN_OR_RETURN(const Image8 coded, streamer.draw(view));
  const ImageError error = compare_luma(uncoded, coded);
  row.mssim += kShare * error.mssim;
  row.psnr += kShare * error.psnr;
  row.truth_uncoded += kShare * compare_luma(truth, uncoded).mssim;
  row.truth_coded += kShare * compare_luma(truth, coded).mssim;
  return absl::OkStatus();
}

// The first frame, which is a key frame, is sent but not counted.
Status SizeStudy::stream(std::shared_ptr<server::SharedScene> scene, const CameraPath& path,
                         TruthSource& truth, AtlasCodec codec) {
  LoopbackSettings s = settings_.common;
  s.atlas = size_;
  s.codec = codec;
  s.split = true;  // keeps what the client's picture is compared with
  s.bitrate_mbps = settings_.bits_per_texel * texels() * s.server_fps / 1e6;
  TESSERA_ASSIGN_OR_RETURN(const auto streamer, ShadingStreamer::create(scene, s));
  const bool first_codec = atlases_.empty();
  CodecPictureRow row{.codec = codec, .width = size_.width, .height = size_.height};
  for (FrameNumber n = 0; n < kPictures; ++n) {
    const TimeNs now = from_seconds(s.start_s + n / s.server_fps);
    const TimedPose pose{now, path.at(now)};
    TESSERA_ASSIGN_OR_RETURN(
        const std::vector<Packet> packets,
        streamer->serve(
            {.number = n, .poses = {&pose, 1}, .round_trip_ns = 100 * kNsPerMs, .scene_time_ns = now}));
    double mbits = 0;
    for (const Packet& packet : packets) {
      TESSERA_RETURN_IF_ERROR(streamer->deliver(packet.channel, packet.bytes));
      if (packet.channel == Channel::atlas) mbits = 8e-6 * static_cast<double>(packet.bytes.size());
    }
    if (first_codec) keep_atlas(streamer->session());
    if (streamer->newest_frame() != n)
      return absl::InternalError(
          absl::StrCat("frame ", n, " by ", std::string(name_of(codec)), " did not arrive"));
    if (n == 0) continue;
    row.mbits = std::max(row.mbits, mbits);
    View view = client_view(s);
    view.pose = pose.pose;
    TESSERA_ASSIGN_OR_RETURN(const RenderedImage reference, truth.truth(view, now));
    TESSERA_RETURN_IF_ERROR(add_picture(*streamer, view, reference->color, row));
  }
  row.used = static_cast<double>(streamer->last_stats().layout.used_texels) / texels();
  result_.pictures.push_back(row);
  return absl::OkStatus();
}

// Key frames, so that no picture before helps; the scale of budgets is bisected. Both pictures are judged by
// the texels that both have, so that one's are not harder than the other's.
StatusOr<double> SizeStudy::equal_quality_share(AtlasCodec codec) {
  const auto code_once = [&](double fill, double bits, double& spent) -> StatusOr<double> {
    TESSERA_ASSIGN_OR_RETURN(Coder coder, Coder::create(codec, size_, settings_.common.server_fps, bits));
    const codec::Occupancy used = occupancy(size_, fill);
    TESSERA_ASSIGN_OR_RETURN(const Coded coded, coder.run(atlases_[0], used, bits));
    spent = coded.bits;
    return quality(atlases_[0], coded.picture, occupancy(size_, 0.5)).psnr;
  };
  const double budget = settings_.bits_per_texel * texels();
  double full_bits = 0, half_bits = 0;
  TESSERA_ASSIGN_OR_RETURN(const double wanted, code_once(1, budget, full_bits));
  double low = 0.3 * budget, high = 1.2 * budget;
  double best = high;
  for (int i = 0; i < 8; ++i) {
    const double bits = 0.5 * (low + high);
    TESSERA_ASSIGN_OR_RETURN(const double psnr, code_once(0.5, bits, half_bits));
    (psnr >= wanted ? high : low) = bits;
    if (psnr >= wanted) best = std::min(best, half_bits);
  }
  return best / full_bits;
}

double median_ratio(const std::vector<double>& a, const std::vector<double>& b) {
  std::vector<double> ratios;
  for (size_t i = 0; i < a.size(); ++i) ratios.push_back(a[i] / b[i]);
  return percentiles(std::move(ratios)).p50;
}

Percentiles per_mtexel(std::vector<double> ms, double texels) {
  for (double& value : ms) value *= kMtexel / texels;
  return percentiles(std::move(ms));
}

void SizeStudy::add_rows(AtlasCodec codec, std::span<const Measured> by_fill, double equal_quality_share) {
  for (size_t i = 0; i < kFills.size(); ++i) {
    const Measured& m = by_fill[i];
    CodecRow row{.codec = codec, .width = size_.width, .height = size_.height, .fill = kFills[i]};
    row.encode_ms_per_mtexel = per_mtexel(m.encode_ms, texels());
    row.decode_ms_per_mtexel = per_mtexel(m.decode_ms, texels());
    row.encode_cpu_ms_per_mtexel = per_mtexel(m.encode_cpu_ms, texels());
    row.decode_cpu_ms_per_mtexel = per_mtexel(m.decode_cpu_ms, texels());
    row.bits_per_sample = m.bits / (kFills[i] * texels() * settings_.rounds);
    row.ssim = m.ssim;
    row.psnr = m.psnr;
    if (i > 0) {
      row.encode_time_share = median_ratio(m.encode_cpu_ms, by_fill[0].encode_cpu_ms);
      row.decode_time_share = median_ratio(m.decode_cpu_ms, by_fill[0].decode_cpu_ms);
      row.equal_quality_share = equal_quality_share;
    }
    result_.rows.push_back(row);
  }
}

Status SizeStudy::code() {
  std::array<std::array<std::optional<Coder>, kFills.size()>, kCodecs.size()> coders;
  std::array<std::array<Measured, kFills.size()>, kCodecs.size()> measured;
  for (uint32_t round = 0; round <= settings_.rounds;
       ++round) {  // the first, with its key frames, is not counted
    const YuvImage& picture = atlases_[round % atlases_.size()];
    for (size_t f = 0; f < kFills.size(); ++f)
      for (size_t c = 0; c < kCodecs.size(); ++c) {
        const codec::Occupancy used = occupancy(size_, kFills[f]);
        const double bits = kFills[f] * settings_.bits_per_texel * texels();
        if (!coders[c][f]) {
          TESSERA_ASSIGN_OR_RETURN(coders[c][f],
                                   Coder::create(kCodecs[c], size_, settings_.common.server_fps, bits));
        }
        // As in a stream, where its memory is in use all the time: right after the picture before.
        if (round > 0) {
          const YuvImage& last = atlases_[(round - 1) % atlases_.size()];
          TESSERA_RETURN_IF_ERROR(coders[c][f]->run(last, used, bits).status());
        }
        TESSERA_ASSIGN_OR_RETURN(const Coded coded, coders[c][f]->run(picture, used, bits));
        if (round == 0) continue;
        Measured& m = measured[c][f];
        m.encode_ms.push_back(coded.encode.wall_ms);
        m.decode_ms.push_back(coded.decode.wall_ms);
        m.encode_cpu_ms.push_back(coded.encode.cpu_ms);
        m.decode_cpu_ms.push_back(coded.decode.cpu_ms);
        m.bits += coded.bits;
        const Quality q = quality(picture, coded.picture, used);
        m.ssim += q.ssim / settings_.rounds;
        m.psnr += q.psnr / settings_.rounds;
      }
  }
  for (size_t c = 0; c < kCodecs.size(); ++c) {
    TESSERA_ASSIGN_OR_RETURN(const double share, equal_quality_share(kCodecs[c]));
    add_rows(kCodecs[c], measured[c], share);
  }
  return absl::OkStatus();
}

nlohmann::json to_json(const CodecRow& row) {
  nlohmann::json out = {{"codec", name_of(row.codec)},
                        {"atlas", absl::StrCat(row.width, "x", row.height)},
                        {"fill", row.fill},
                        {"encode_ms_per_mtexel", to_json(row.encode_ms_per_mtexel)},
                        {"decode_ms_per_mtexel", to_json(row.decode_ms_per_mtexel)},
                        {"encode_cpu_ms_per_mtexel", to_json(row.encode_cpu_ms_per_mtexel)},
                        {"decode_cpu_ms_per_mtexel", to_json(row.decode_cpu_ms_per_mtexel)},
                        {"bits_per_sample", row.bits_per_sample},
                        {"ssim", row.ssim},
                        {"psnr", row.psnr}};
  if (row.encode_time_share) out["encode_time_share"] = *row.encode_time_share;
  if (row.decode_time_share) out["decode_time_share"] = *row.decode_time_share;
  if (row.equal_quality_share) out["equal_quality_share"] = *row.equal_quality_share;
  return out;
}

nlohmann::json to_json(const CodecPictureRow& row) {
  return {{"codec", name_of(row.codec)},
          {"atlas", absl::StrCat(row.width, "x", row.height)},
          {"used", row.used},
          {"mbits", row.mbits},
          {"mssim", row.mssim},
          {"psnr", row.psnr},
          {"mssim_truth_uncoded", row.truth_uncoded},
          {"mssim_truth_coded", row.truth_coded}};
}

}  // namespace

nlohmann::json to_json(const CodecStudyResult& result) {
  nlohmann::json run = run_json(result.command, result.device, result.settings.common);
  run["settings"]["mtexels"] = result.settings.mtexels;
  run["settings"]["bits-per-texel"] = result.settings.bits_per_texel;
  run["settings"]["rounds"] = result.settings.rounds;
  run["rows"] = nlohmann::json::array();
  for (const CodecRow& row : result.rows) run["rows"].push_back(to_json(row));
  run["pictures"] = nlohmann::json::array();
  for (const CodecPictureRow& row : result.pictures) run["pictures"].push_back(to_json(row));
  return run;
}

StatusOr<CodecStudyResult> run_codec_study(const CodecStudySettings& settings, Progress& progress) {
  CodecStudyResult result{.settings = settings};
  TESSERA_ASSIGN_OR_RETURN(const StudyScene on, load_study_scene(settings.common));
  result.device = on.description();
  TESSERA_ASSIGN_OR_RETURN(const auto truth,
                           TruthSource::create(on.shared, settings.common.scene, "none", 4));
  uint64_t steps = 0;
  for (const uint32_t mtexels : settings.mtexels) steps += (kCodecs.size() + 1) * mtexels;
  progress.begin("Mi texels", steps);
  for (const uint32_t mtexels : settings.mtexels) {
    SizeStudy study(settings, mtexels, result);
    for (const AtlasCodec codec : kCodecs) {
      TESSERA_RETURN_IF_ERROR(study.stream(on.shared, on.path, *truth, codec));
      progress.advance(mtexels);
    }
    TESSERA_RETURN_IF_ERROR(study.code());
    progress.advance(mtexels);
  }
  return result;
}

void add_options(CLI::App& app, CodecStudySettings& settings) {
  const std::vector<std::string> common = {"scene",  "path",       "start",  "size", "fov-y",
                                           "layout", "server-fps", "device", "json"};
  add_options(app, settings.common, common);
  app.add_option("--mtexels", settings.mtexels, "atlas sizes in Mi texels: 1, 2, 4, 8, 16 or 32")
      ->delimiter(',')
      ->check(CLI::IsMember({1, 2, 4, 8, 16, 32}))
      ->group("Codec")
      ->envname("TESSERA_BENCH_MTEXELS")
      ->capture_default_str();
  app.add_option("--bits-per-texel", settings.bits_per_texel, "of a full atlas, each frame")
      ->check(CLI::Range(0.05, 24.0))
      ->group("Codec")
      ->envname("TESSERA_BENCH_BITS_PER_TEXEL")
      ->capture_default_str();
  app.add_option("--rounds", settings.rounds, "pictures that each codec codes in turn")
      ->check(CLI::Range(1, 1000))
      ->group("Codec")
      ->envname("TESSERA_BENCH_ROUNDS")
      ->capture_default_str();
}

}  // namespace tessera::bench
