// What the atlas's codecs cost and what they spoil (experiment E10): H.264 and JPEG on the atlases of one
// scene, in turn, by size and by how much of the atlas holds samples.
#pragma once

#include "bench/progress.h"
#include "bench/result.h"
#include "bench/settings.h"

namespace tessera::bench {

struct CodecStudySettings {
  LoopbackSettings common;  // scene, path, start, fps, size, fov-y, server-fps, device, json
  std::vector<uint32_t> mtexels{1, 2, 4, 8};  // atlas sizes, Mi texels
  double bits_per_texel = 0.5;                // of a full atlas; one that is half empty has half the budget
  uint32_t rounds = 5;                        // each codes one picture by every codec
};

// One codec on one atlas size, the atlas filled up with samples of the scene or half empty.
struct CodecRow {
  AtlasCodec codec = AtlasCodec::h264;
  uint32_t width = 0, height = 0;
  double fill = 1;                                         // share of the texels that hold samples
  Percentiles encode_ms_per_mtexel, decode_ms_per_mtexel;  // of the whole atlas, by the clock on the wall
  Percentiles encode_cpu_ms_per_mtexel, decode_cpu_ms_per_mtexel;  // of all threads together
  double bits_per_sample = 0;
  double ssim = 0, psnr = 0;  // luma of the decoded atlas, over its samples
  // Half empty against full: median of the rounds' ratios of processor time, which other load on the machine
  // hardly changes; bits of a picture that is as good (PSNR).
  std::optional<double> encode_time_share, decode_time_share, equal_quality_share;
};

// The client's picture, the atlas as the session lays it out; means over a few frames.
struct CodecPictureRow {
  AtlasCodec codec = AtlasCodec::h264;
  uint32_t width = 0, height = 0;             // of the atlas
  double used = 0;                            // share of its texels
  double mbits = 0;                           // of the atlas: the largest of the frames
  double mssim = 0, psnr = 0;                 // against the picture of the atlas before coding
  double truth_uncoded = 0, truth_coded = 0;  // mssim of both against the forward reference renderer
};

struct CodecStudyResult {
  CodecStudySettings settings;
  std::string command;
  DeviceDescription device;
  std::vector<CodecRow> rows;
  std::vector<CodecPictureRow> pictures;
};

nlohmann::json to_json(const CodecStudyResult& result);

StatusOr<CodecStudyResult> run_codec_study(const CodecStudySettings& settings, Progress& progress);

// Adds this command's options.
void add_options(CLI::App& app, CodecStudySettings& settings);

}  // namespace tessera::bench
