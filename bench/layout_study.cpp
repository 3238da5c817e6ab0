#include "bench/layout_study.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "CLI/CLI.hpp"
#include "bench/image_io.h"
#include "bench/rate_client.h"
#include "bench/shading_streamer.h"
#include "bench/study_scene.h"
#include "bench/texel_picture.h"
#include "pvs/prediction.h"
#include "pvs/visibility.h"

namespace tessera::bench {
namespace {

constexpr char kLPacking[] = "l-packing", kTexelShading[] = "texel-shading";
constexpr uint64_t kMtexel = 1 << 20;

// Of the layouts by name, and of "l-packing": tessellated without Oversampling.
atlas::LayoutSettings layout_settings(const std::string& name, const Size& size) {
  const bool no_halves = name == kLPacking;
  const auto at = std::ranges::find(atlas::kLayoutNames, no_halves ? "tessellated" : name);
  const auto kind = static_cast<atlas::LayoutKind>(at - std::begin(atlas::kLayoutNames));
  atlas::LayoutSettings settings = atlas::layout_settings(kind, size.width, size.height);
  if (no_halves) settings.slantedness = std::numeric_limits<float>::infinity();
  return settings;
}

// Everything of one run.
class Study {
 public:
  Study(const LayoutStudySettings& settings, Progress& progress) : settings_(settings), progress_(progress) {}
  StatusOr<LayoutStudyResult> run();

 private:
  struct Case {
    std::string layout;
    Size atlas;
  };
  // Of one case: what its rows have in common, and for each bit rate what they have not.
  struct Series {
    LayoutRow row;
    ErrorMean error;
    std::vector<double> layout_ms, shading_ms, draw_ms;
    struct Rate {
      RateClient client;
      ErrorMean error;
      double atlas_kbit = 0;
    };
    std::vector<Rate> rates;
  };

  Status set_up();
  std::vector<Case> cases() const;
  Status measure(const Case& c);
  Status measure_texel_shading();
  // What has arrived of the client's poses when a frame is served, and the views that its session predicts.
  std::vector<TimedPose> poses_at(uint32_t index) const;
  std::vector<View> predicted_at(uint32_t index) const;
  Status serve(ShadingStreamer& streamer, uint32_t index, const Case& c, Series& series);
  Status code(const YuvView& atlas, uint32_t index, double meta_bits, Series& series) const;
  Status look(ShadingStreamer& streamer, uint32_t index, const Case& c, Series& series);
  void add_costs(const server::FrameStats& stats, Series& series) const;
  void add_rows(Series& series);

  uint32_t frame_count() const {
    const double frames = settings_.common.seconds * settings_.common.server_fps;
    return settings_.warm_up_frames + static_cast<uint32_t>(std::max(1L, std::lround(frames)));
  }
  bool is_scored(uint32_t index) const {
    return index >= settings_.warm_up_frames &&
           (index - settings_.warm_up_frames) % settings_.common.score_every == 0;
  }
  // Clock of the run; the scene's, too.
  TimeNs served_at(uint32_t index) const { return from_seconds(index / settings_.common.server_fps); }
  // When a frame reaches the client; it is shown for one period from then on, on average half of it.
  TimeNs shown_at(uint32_t index) const {
    const LoopbackSettings& s = settings_.common;
    return served_at(index) + from_ms(s.server_ms + s.delay_ms + 500 / s.server_fps);
  }
  Pose pose_at(TimeNs now) const {
    return on_->path.at(from_seconds(settings_.common.start_s + settings_.speed * to_seconds(now)));
  }

  const LayoutStudySettings settings_;
  Progress& progress_;
  LayoutStudyResult result_;
  std::optional<StudyScene> on_;
  std::unique_ptr<TruthSource> truth_;
  std::optional<pvs::TriangleToPatch> patch_of_;
};

Status Study::set_up() {
  const LoopbackSettings& common = settings_.common;
  TESSERA_ASSIGN_OR_RETURN(StudyScene on, load_study_scene(common));
  on_.emplace(std::move(on));
  TESSERA_ASSIGN_OR_RETURN(truth_, on_->truth(common));
  patch_of_.emplace(*on_->scene);
  result_.settings = settings_;
  result_.device = on_->description();
  for (uint32_t i = 0; i < frame_count(); ++i) result_.frames += is_scored(i);
  return absl::OkStatus();
}

std::vector<Study::Case> Study::cases() const {
  std::vector<Case> out;
  if (std::ranges::find(settings_.layouts, kTexelShading) != settings_.layouts.end())
    out.push_back({kTexelShading, {}});
  for (const Size& atlas : settings_.atlases) {
    for (const std::string& layout : settings_.layouts)
      if (layout != kTexelShading) out.push_back({layout, atlas});  // it has no atlas
  }
  return out;
}

std::vector<TimedPose> Study::poses_at(uint32_t index) const {
  const LoopbackSettings& s = settings_.common;
  std::vector<TimedPose> poses;
  const TimeNs newest = served_at(index) - from_ms(s.delay_ms);
  for (int back = 7; back >= 0; --back) {
    const TimeNs at = newest - from_seconds(back / s.fps);
    poses.push_back({at, pose_at(at)});
  }
  return poses;
}

std::vector<View> Study::predicted_at(uint32_t index) const {
  const std::vector<TimedPose> poses = poses_at(index);
  pvs::PredictionSettings prediction = session_settings(settings_.common).prediction;
  const TimeNs newest = poses.back().time_ns;
  prediction.horizon_ns = shown_at(index) - newest + from_seconds(1 / settings_.common.server_fps);
  return pvs::predict_views(poses, newest, client_view(settings_.common), prediction);
}

Status Study::serve(ShadingStreamer& streamer, uint32_t index, const Case& c, Series& series) {
  const std::vector<TimedPose> poses = poses_at(index);
  const ServeRequest request{.number = index,
                             .poses = poses,
                             .round_trip_ns = shown_at(index) - poses.back().time_ns,
                             .scene_time_ns = served_at(index)};
  TESSERA_ASSIGN_OR_RETURN(const std::vector<Packet> packets, streamer.serve(request));
  double meta_bits = 0;
  for (const Packet& packet : packets) {
    TESSERA_RETURN_IF_ERROR(streamer.deliver(packet.channel, packet.bytes));
    if (packet.channel == Channel::meta) meta_bits += 8.0 * static_cast<double>(packet.bytes.size());
  }
  if (streamer.newest_frame() != index)
    return absl::InternalError(
        absl::StrCat("layout ", c.layout, ": frame ", index, " did not come out whole"));
  if (index >= settings_.warm_up_frames) series.row.meta_kbit += 0.001 * meta_bits;
  return code(streamer.session().yuv(), index, meta_bits, series);
}

Status Study::code(const YuvView& atlas, uint32_t index, double meta_bits, Series& series) const {
  for (Series::Rate& rate : series.rates) {
    TESSERA_ASSIGN_OR_RETURN(const double bits, rate.client.serve(index, atlas, meta_bits));
    if (index >= settings_.warm_up_frames) rate.atlas_kbit += 0.001 * bits;
  }
  return absl::OkStatus();
}

void Study::add_costs(const server::FrameStats& stats, Series& series) const {
  LayoutRow& row = series.row;
  const double texels = static_cast<double>(row.width) * row.height;
  const auto samples = static_cast<double>(stats.gather.samples);
  row.samples += samples;
  row.outside_share += static_cast<double>(stats.gather.half_samples_outside) / std::max(1.0, samples);
  row.fill += (samples - static_cast<double>(stats.gather.color_samples)) / texels;
  row.bias += stats.layout.bias;
  row.blocks += stats.layout.blocks;
  row.colors += stats.layout.colors;
  row.out_of_memory += stats.layout.colors_out_of_memory;
  row.changed += stats.layout.changed;
  series.layout_ms.push_back(stats.times.layout_ms);
  series.shading_ms.push_back(stats.times.shading_ms);
}

Status Study::look(ShadingStreamer& streamer, uint32_t index, const Case& c, Series& series) {
  View view = client_view(settings_.common);
  view.pose = pose_at(shown_at(index));
  TESSERA_ASSIGN_OR_RETURN(const RenderedImage truth, truth_->truth(view, shown_at(index)));
  TESSERA_ASSIGN_OR_RETURN(Image8 shown, streamer.draw_uncoded(view));
  const SteadyClock clock;
  const TimeNs begin = clock.now();
  TESSERA_RETURN_IF_ERROR(streamer.display().draw(view).status());
  series.draw_ms.push_back(to_ms(clock.now() - begin));
  const Comparison compared = compare_images(truth->color, shown);
  series.error.add(compared.error);
  series.row.holes += hole_share(truth->triangle_plus_one, truth->covered, [&](uint32_t triangle) {
    return streamer.has_patch((*patch_of_)[triangle]);
  });
  if (index == settings_.warm_up_frames && c.atlas == settings_.atlases.back()) {
    result_.pictures.push_back({absl::StrFormat("%s, %dx%d", c.layout, c.atlas.width, c.atlas.height),
                                compared.error.mssim, truth->color, std::move(shown),
                                dssim_picture(compared.ssim), streamer.uncoded_atlas()});
  }
  for (Series::Rate& rate : series.rates) {
    TESSERA_ASSIGN_OR_RETURN(const Image8 coded, streamer.draw_atlas(rate.client.atlas(), view));
    rate.error.add(compare_luma(truth->color, coded));
  }
  return absl::OkStatus();
}

// One for each bit rate, or one alone where nothing is coded.
void Study::add_rows(Series& series) {
  LayoutRow& row = series.row;
  const double counted = frame_count() - settings_.warm_up_frames;
  for (double* sum : {&row.samples, &row.outside_share, &row.fill, &row.bias, &row.blocks, &row.colors,
                      &row.out_of_memory, &row.changed, &row.meta_kbit})
    *sum /= counted;
  row.holes /= result_.frames;
  row.error = series.error.mean();
  row.layout_ms = percentiles(series.layout_ms);
  row.shading_ms = percentiles(series.shading_ms);
  row.draw_ms = percentiles(series.draw_ms);
  if (series.rates.empty()) result_.rows.push_back(row);
  for (size_t i = 0; i < series.rates.size(); ++i) {
    row.bitrate_mbps = settings_.bitrates_mbps[i];
    row.atlas_kbit = series.rates[i].atlas_kbit / counted;
    row.coded = series.rates[i].error.mean();
    result_.rows.push_back(row);
  }
}

Status Study::measure(const Case& c) {
  LoopbackSettings common = settings_.common;
  common.atlas = c.atlas;
  common.codec = AtlasCodec::raw;  // bit rates have coders of their own
  server::SessionSettings session = session_settings(common);
  session.layout = layout_settings(c.layout, c.atlas);
  TESSERA_ASSIGN_OR_RETURN(const auto streamer, ShadingStreamer::create(on_->shared, common, session));
  Series series{.row = {.layout = c.layout, .width = c.atlas.width, .height = c.atlas.height}};
  for (const double mbps : settings_.bitrates_mbps) {
    TESSERA_ASSIGN_OR_RETURN(RateClient client, RateClient::create(common, mbps));
    series.rates.push_back({std::move(client)});
  }
  for (uint32_t i = 0; i < frame_count(); ++i) {
    TESSERA_RETURN_IF_ERROR(serve(*streamer, i, c, series));
    if (i >= settings_.warm_up_frames) add_costs(streamer->last_stats(), series);
    if (is_scored(i)) TESSERA_RETURN_IF_ERROR(look(*streamer, i, c, series));
    progress_.advance();
  }
  add_rows(series);
  return absl::OkStatus();
}

// Nothing of it is streamed: its texture is too large. Its pictures are what a client would show that has
// all of it, shaded a moment ago; its samples are those that a server would shade for it: of everything that
// the predicted views see, as in TSS.
Status Study::measure_texel_shading() {
  const TimeNs begin = shown_at(settings_.warm_up_frames);
  View view = client_view(settings_.common);
  view.pose = pose_at(begin);
  // Sets the scene's moment.
  TESSERA_RETURN_IF_ERROR(truth_->render(view, begin, {.samples = 1, .ids = true}).status());
  const std::vector<dmat4> transforms = truth_->instant().instance_transforms();
  TESSERA_ASSIGN_OR_RETURN(
      const UniqueTexture texture,
      UniqueTexture::create(*on_->scene, transforms, settings_.texture_mtexels * kMtexel));
  TESSERA_ASSIGN_OR_RETURN(const auto shader, TexelShader::create(*on_->device, on_->shared->gpu_scene(),
                                                                  on_->shared->lighting(), texture));
  LayoutRow& row = result_.rows.emplace_back(LayoutRow{.layout = kTexelShading});
  ErrorMean error;
  double picture_samples = 0;
  for (uint32_t i = 0; i < frame_count(); ++i) {
    progress_.advance();
    if (!is_scored(i)) continue;
    view.pose = pose_at(shown_at(i));
    TESSERA_ASSIGN_OR_RETURN(const RenderedImage truth, truth_->truth(view, shown_at(i)));
    TESSERA_ASSIGN_OR_RETURN(TexelPicture shown,
                             draw_texels(texture, *shader, *truth_, view, predicted_at(i), shown_at(i)));
    const Comparison compared = compare_images(truth->color, shown.image);
    error.add(compared.error);
    row.samples += static_cast<double>(shown.samples_ahead) / result_.frames;
    picture_samples += static_cast<double>(shown.samples) / result_.frames;
    if (i == settings_.warm_up_frames)
      result_.pictures.push_back({kTexelShading,
                                  compared.error.mssim,
                                  truth->color,
                                  std::move(shown.image),
                                  dssim_picture(compared.ssim),
                                  {}});
  }
  row.picture_samples = picture_samples;
  row.error = error.mean();
  return absl::OkStatus();
}

StatusOr<LayoutStudyResult> Study::run() {
  TESSERA_RETURN_IF_ERROR(set_up());
  const std::vector<Case> all = cases();
  progress_.begin("frames", all.size() * frame_count());
  for (const Case& c : all)
    TESSERA_RETURN_IF_ERROR(c.layout == kTexelShading ? measure_texel_shading() : measure(c));
  return std::move(result_);
}

std::vector<Point> error_by_samples(const std::vector<LayoutRow>& rows, const std::string& layout) {
  std::vector<Point> points;
  for (const LayoutRow& row : rows)
    if (row.layout == layout) points.push_back({std::log(row.samples), row.error.dssim()});
  return points;
}

std::vector<Point> bits_by_error(const std::vector<LayoutRow>& rows, const LayoutRow& like,
                                 const std::string& layout) {
  std::vector<Point> points;
  for (const LayoutRow& row : rows)
    if (row.layout == layout && row.width == like.width && row.height == like.height && row.coded)
      points.push_back({row.coded->mssim, std::log(row.atlas_kbit + row.meta_kbit)});
  return points;
}

nlohmann::json to_json(const LayoutRow& row) {
  nlohmann::json out = {{"layout", row.layout},
                        {"atlas", absl::StrCat(row.width, "x", row.height)},
                        {"samples", row.samples},
                        {"outside_share", row.outside_share},
                        {"fill", row.fill},
                        {"bias", row.bias},
                        {"blocks", row.blocks},
                        {"colors", row.colors},
                        {"out_of_memory", row.out_of_memory},
                        {"changed", row.changed},
                        {"mssim", row.error.mssim},
                        {"dssim", row.error.dssim()},
                        {"psnr", row.error.psnr},
                        {"holes", row.holes},
                        {"atlas_kbit", row.atlas_kbit},
                        {"meta_kbit", row.meta_kbit},
                        {"layout_ms", to_json(row.layout_ms)},
                        {"shading_ms", to_json(row.shading_ms)},
                        {"draw_ms", to_json(row.draw_ms)}};
  if (row.picture_samples) out["picture_samples"] = *row.picture_samples;
  if (row.bitrate_mbps) out["bitrate_mbps"] = *row.bitrate_mbps;
  if (row.coded) out["mssim_coded"] = row.coded->mssim;
  return out;
}

nlohmann::json to_json(const LayoutComparison& c) {
  nlohmann::json out = {
      {"layout", c.layout}, {"other", c.other}, {"atlas", absl::StrCat(c.width, "x", c.height)}};
  if (c.bitrate_mbps) out["bitrate_mbps"] = *c.bitrate_mbps;
  if (c.dssim_ratio) out["dssim_ratio"] = *c.dssim_ratio;
  if (c.bits_ratio) out["bits_ratio"] = *c.bits_ratio;
  return out;
}

std::string ratio_text(std::optional<double> ratio) {
  return ratio ? absl::StrFormat("%.3f", *ratio) : "-";
}

}  // namespace

std::optional<double> interpolate(std::vector<Point> points, double x) {
  std::ranges::sort(points, {}, &Point::x);
  const auto right = std::ranges::lower_bound(points, x, {}, &Point::x);
  if (right == points.end()) return std::nullopt;
  if (right->x == x) return right->y;
  if (right == points.begin()) return std::nullopt;
  const Point& left = right[-1];
  return left.y + (right->y - left.y) * (x - left.x) / (right->x - left.x);
}

std::vector<LayoutComparison> compare_layouts(const std::vector<LayoutRow>& rows, const std::string& other) {
  std::vector<LayoutComparison> out;
  const std::vector<Point> errors = error_by_samples(rows, other);
  for (const LayoutRow& row : rows) {
    if (row.layout == other) continue;
    LayoutComparison c{row.layout, other, row.width, row.height, row.bitrate_mbps, {}, {}};
    if (const auto dssim = interpolate(errors, std::log(row.samples)); dssim && *dssim > 0)
      c.dssim_ratio = row.error.dssim() / *dssim;
    if (row.coded) {
      if (const auto log_kbit = interpolate(bits_by_error(rows, row, other), row.coded->mssim))
        c.bits_ratio = (row.atlas_kbit + row.meta_kbit) / std::exp(*log_kbit);
    }
    out.push_back(c);
  }
  return out;
}

std::string to_text(const LayoutStudyResult& result) {
  std::string text = absl::StrFormat("%-13s %-10s %7s %9s %6s %7s %5s %7s %7s %8s %9s %8s %8s %8s\n",
                                     "layout", "atlas", "Mbit/s", "samples", "fill", "outside", "bias",
                                     "mssim", "coded", "kbit", "meta kbit", "layout", "shading", "draw ms");
  for (const LayoutRow& r : result.rows) {
    absl::StrAppendFormat(
        &text, "%-13s %-10s %7s %9.0f %5.1f%% %6.1f%% %5.2f %7.4f %7s %8.1f %9.1f %8.1f %8.1f %8.1f\n",
        r.layout, absl::StrCat(r.width, "x", r.height),
        r.bitrate_mbps ? absl::StrFormat("%g", *r.bitrate_mbps) : "-", r.samples, 100 * r.fill,
        100 * r.outside_share, r.bias, r.error.mssim, r.coded ? absl::StrFormat("%.4f", r.coded->mssim) : "-",
        r.atlas_kbit + r.meta_kbit, r.meta_kbit, r.layout_ms.p50, r.shading_ms.p50, r.draw_ms.p50);
  }
  for (const LayoutRow& r : result.rows)
    if (r.picture_samples)
      absl::StrAppendFormat(&text, "%s: the scored pictures read %.0f of these samples\n", r.layout,
                            *r.picture_samples);
  for (const std::string& other : result.settings.layouts) {
    for (const LayoutComparison& c : compare_layouts(result.rows, other)) {
      if (!c.dssim_ratio && !c.bits_ratio) continue;
      absl::StrAppendFormat(&text, "%s / %s, %dx%d%s: DSSIM at equal samples %s, bits at equal error %s\n",
                            c.layout, c.other, c.width, c.height,
                            c.bitrate_mbps ? absl::StrFormat(", %g Mbit/s", *c.bitrate_mbps) : "",
                            ratio_text(c.dssim_ratio), ratio_text(c.bits_ratio));
    }
  }
  return text;
}

LayoutStudySettings default_layout_study_settings() {
  LayoutStudySettings settings;
  settings.common.seconds = 2;
  settings.common.score_every = 6;
  settings.common.split = true;  // pictures without coding
  return settings;
}

std::vector<std::string> layout_study_options() {
  return {"scene",     "path",     "start",  "seconds",     "fps",   "size",        "fov-y", "server-fps",
          "server-ms", "delay-ms", "device", "score-every", "truth", "truth-cache", "json",  "report"};
}

nlohmann::json to_json(const LayoutStudyResult& result) {
  nlohmann::json run = run_json(result.command, result.device, result.settings.common);
  run["settings"]["texture-mtexels"] = result.settings.texture_mtexels;
  run["settings"]["speed"] = result.settings.speed;
  run["frames"] = result.frames;
  run["rows"] = nlohmann::json::array();
  for (const LayoutRow& row : result.rows) run["rows"].push_back(to_json(row));
  run["comparisons"] = nlohmann::json::array();
  for (const std::string& other : result.settings.layouts)
    for (const LayoutComparison& c : compare_layouts(result.rows, other))
      run["comparisons"].push_back(to_json(c));
  return run;
}

StatusOr<LayoutStudyResult> run_layout_study(const LayoutStudySettings& settings, Progress& progress) {
  return Study(settings, progress).run();
}

void add_options(CLI::App& app, LayoutStudySettings& settings) {
  const std::vector<std::string> common = layout_study_options();
  add_options(app, settings.common, common);
  std::vector<std::string> names(std::begin(atlas::kLayoutNames), std::end(atlas::kLayoutNames));
  for (const char* more : {kLPacking, kTexelShading}) names.emplace_back(more);
  app.add_option("--layouts", settings.layouts,
                 "which to measure; l-packing: tessellated without Oversampling; texel-shading: a baseline")
      ->check(CLI::IsMember(names))
      ->delimiter(',')
      ->group("Server")
      ->envname("TESSERA_BENCH_LAYOUTS")
      ->capture_default_str();
  app.add_option("--atlases", settings.atlases, "sizes in texels, of each layout; multiples of 256")
      ->delimiter(',')
      ->group("Server")
      ->envname("TESSERA_BENCH_ATLASES")
      ->capture_default_str();
  app.add_option("--bitrates-mbps", settings.bitrates_mbps,
                 "of H.264, atlas and meta together; default: nothing is coded")
      ->delimiter(',')
      ->check(CLI::PositiveNumber)
      ->group("Server")
      ->envname("TESSERA_BENCH_BITRATES_MBPS");
  app.add_option("--texture-mtexels", settings.texture_mtexels,
                 "of texel shading's unique textures, Mi texels")
      ->check(CLI::Range(1, 65536))
      ->group("Server")
      ->envname("TESSERA_BENCH_TEXTURE_MTEXELS")
      ->capture_default_str();
  app.add_option("--speed", settings.speed, "of the camera on its path; 1 = as recorded")
      ->check(CLI::Range(0.0, 100.0))
      ->group("Client")
      ->envname("TESSERA_BENCH_SPEED")
      ->capture_default_str();
}

}  // namespace tessera::bench
