// A made-up result with every field set, for tests of what is written about results.
#pragma once

#include <cmath>

#include "bench/result.h"
#include "test_images.h"

namespace tessera::bench {

inline Picture sample_picture(const std::string& label) {
  Picture picture{.label = label, .display_frame = 7, .mssim = 0.9, .truth = textured(32, 20)};
  picture.shown = textured_disturbed(32, 20);
  picture.ssim = compare_images(picture.truth, picture.shown).ssim;
  return picture;
}

inline LoopbackResult sample_result() {
  LoopbackResult result;
  result.settings.scene = "dir/hall & <garden>.glb";
  result.command = "tessera-bench loopback --scene='hall & <garden>.glb'";
  result.device = {"software device", "driver 1", true};
  result.notes = {"BLEND is drawn opaque: 2 materials"};
  result.plan = "shadow pass: in, 1 directional light";

  Row row{.method = "tessera", .error = {.mssim = 0.96, .psnr = 33}};
  row.holes = 0.0004;
  row.coverage = 0.995;
  row.overestimation = 0.1;
  row.mbps_total = 18;
  row.frames_displayed = 60;
  row.durations_ms = {
      {"pose_uplink", {50, 50, 50}}, {"server_render", {33, 33, 33}}, {"downlink", {60, 70, 80}}};
  row.end_to_end_ms = {150, 160, 170};
  row.tiling_error_ms_max = 0.1;
  row.server_ms = 40;
  row.client_ms = 12;
  row.mssim_masked = 0.8765;
  row.violations = 0;
  row.samples_shaded = 1'000'000;
  result.rows = {
      row,
      {.method = "mesh-warp", .note = "depth is not counted", .error = {.mssim = 0.9}, .server_ms = 30},
      {.method = "plain-video", .error = {.mssim = 0.6}, .server_ms = 20}};
  result.split = {{"sampling", 0.98, 35, 0.02}, {"coding", 0.97, 34, 0.01}};
  for (int i = 0; i < 60; ++i) {
    DisplayRecord frame{.time_ns = i * kNsPerSecond / 60,
                        .frame = static_cast<uint32_t>(i / 2),
                        .age_ms = 100.0 + i % 2 * 16};
    frame.atlas_bytes = i % 2 ? 0 : 70000;
    frame.meta_bytes = i % 2 ? 0 : 5000;
    frame.mssim = {{"tessera", 0.96 + 0.01 * std::sin(i)}, {"mesh-warp", 0.9}, {"plain-video", 0.6}};
    result.frames.push_back(frame);
  }
  result.pictures = {sample_picture("first"), sample_picture("worst"), sample_picture("masked")};
  result.pictures[2].note = "enlarged twice";
  return result;
}

}  // namespace tessera::bench
