#include "bench/loopback.h"

#include <algorithm>
#include <cmath>
#include <future>
#include <span>

#include "base/log.h"
#include "bench/coverage_meter.h"
#include "bench/picture_streamer.h"
#include "bench/real_loopback.h"
#include "bench/scoring.h"
#include "bench/shading_streamer.h"
#include "bench/stream_simulation.h"
#include "bench/study_scene.h"
#include "bench/truth_source.h"
#include "pvs/visibility.h"

namespace tessera::bench {
namespace {

// Pixels a side of the picture of masked edges, and how much larger it is shown.
constexpr uint32_t kMaskedWindow = 240, kMaskedScale = 2;

double ms_since(TimeNs start) {
  return to_ms(SteadyClock().now() - start);
}

// Means of the error with one cause after another switched off (EVALUATION: split).
struct SplitMeans {
  ErrorMean coded, chroma_only, uncoded, fresh, seen;

  void add(const SplitErrors& errors) {
    chroma_only.add(errors.chroma_only);
    uncoded.add(errors.uncoded);
    fresh.add(errors.fresh);
    seen.add(errors.seen);
  }
  std::vector<SplitRow> rows() const {
    std::vector<SplitRow> rows;
    ImageError before = coded.mean();
    const auto off = [&](const char* cause, const ErrorMean& without) {
      const ImageError after = without.mean();
      rows.push_back({cause, after.mssim, after.psnr, after.mssim - before.mssim});
      before = after;
    };
    off("coding", chroma_only);
    off("chroma", uncoded);
    off("staleness", fresh);
    off("visibility", seen);
    rows.push_back({"sampling", 1.0, kMaxPsnrDb, 1.0 - before.mssim});
    return rows;
  }
};

// Everything of one run; its methods are the steps of a display frame.
class Loopback {
 public:
  Loopback(const LoopbackSettings& settings, Progress& progress) : settings_(settings), progress_(progress) {}

  StatusOr<LoopbackResult> run();

 private:
  struct Method {
    Row row;
    std::unique_ptr<Streamer> streamer;
    std::unique_ptr<StreamSimulation> simulation;
    ErrorMean error;
    EdgeSum near_masked;
    double draw_ms = 0;
  };

  Status set_up();
  Status add_baseline(PictureMethod method, const char* note);
  Status draw(Method& method, const DisplayMoment& moment, FramePictures* scored);
  Status render_truth(const DisplayMoment& moment, FramePictures& pictures, DisplayRecord& record);
  // Compares the pictures of the last scored frame, between these two beside whatever else goes on.
  void begin_scoring();
  void end_scoring();
  void keep_pictures(const FramePictures& pictures, const FrameScore& score);
  void keep_picture(Picture picture);
  Status frame(uint32_t index);
  StatusOr<uint32_t> estimate();
  void fill_rows();

  uint32_t frame_count() const {
    return static_cast<uint32_t>(std::lround(settings_.seconds * settings_.fps));
  }

  LoopbackSettings settings_;
  Progress& progress_;
  LoopbackResult result_;
  std::shared_ptr<gpu::Device> device_;
  std::shared_ptr<const scene::Scene> scene_;
  std::optional<CameraPath> path_;
  std::shared_ptr<server::SharedScene> shared_;
  std::unique_ptr<TruthSource> truth_;
  std::optional<pvs::TriangleToPatch> patch_of_;
  std::optional<MaskedTriangles> masked_;

  std::vector<Method> methods_;  // ours first
  ShadingStreamer* ours_ = nullptr;
  CoverageMeter coverage_;
  SplitMeans split_;
  double holes_sum_ = 0, server_ms_sum_ = 0;
  uint64_t scored_ = 0, stale_ = 0, server_frames_ = 0, samples_ = 0;
  double worst_mssim_ = 2;
  uint64_t most_masked_edges_ = 0;  // in one picture's window
  std::optional<FramePictures> unscored_;
  std::future<FrameScore> scoring_;  // of unscored_; last, so that it ends first
};

Status Loopback::set_up() {
  TESSERA_ASSIGN_OR_RETURN(StudyScene on, load_study_scene(settings_));
  result_.settings = settings_;
  result_.device = on.description();
  TESSERA_ASSIGN_OR_RETURN(truth_, on.truth(settings_));
  device_ = on.device;
  scene_ = on.scene;
  shared_ = on.shared;
  path_.emplace(std::move(on.path));
  if (scene_->features.alpha_blend)
    result_.notes.push_back("blended materials are drawn opaque, in the truth too");
  patch_of_.emplace(*scene_);
  masked_.emplace(*scene_);

  TESSERA_ASSIGN_OR_RETURN(std::unique_ptr<ShadingStreamer> ours,
                           ShadingStreamer::create(shared_, settings_));
  ours_ = ours.get();
  result_.plan = ours_->session().plan().to_string();
  result_.notes.push_back("encoder: " + ours_->session().encoder());
  methods_.push_back({.row = {.method = ours->name()}, .streamer = std::move(ours)});
  if (settings_.wants_baseline("mesh-warp")) {
    TESSERA_RETURN_IF_ERROR(
        add_baseline(PictureMethod::mesh_warp, "depth travels uncoded and is not counted"));
  }
  if (settings_.wants_baseline("plain-video"))
    TESSERA_RETURN_IF_ERROR(add_baseline(PictureMethod::plain_video, ""));
  for (Method& method : methods_) {
    method.simulation = std::make_unique<StreamSimulation>(*method.streamer, *path_, settings_);
  }
  return ours_->meter_coverage(coverage_, [this](TimeNs t) { return methods_[0].simulation->pose_at(t); });
}

Status Loopback::add_baseline(PictureMethod method, const char* note) {
  TESSERA_ASSIGN_OR_RETURN(std::unique_ptr<PictureStreamer> streamer,
                           PictureStreamer::create(method, shared_, *truth_, settings_));
  methods_.push_back({.row = {.method = streamer->name(), .note = note}, .streamer = std::move(streamer)});
  return absl::OkStatus();
}

void Loopback::keep_picture(Picture picture) {
  std::erase_if(result_.pictures, [&](const Picture& p) { return p.label == picture.label; });
  result_.pictures.push_back(std::move(picture));
}

Status Loopback::draw(Method& method, const DisplayMoment& moment, FramePictures* scored) {
  const TimeNs start = SteadyClock().now();
  TESSERA_ASSIGN_OR_RETURN(Image8 shown, method.streamer->draw(moment.view));
  method.draw_ms += ms_since(start);
  ++method.row.frames_displayed;
  if (!moment.fresh) ++method.row.frames_stale;
  if (scored) scored->shown.push_back(std::move(shown));
  return absl::OkStatus();
}

Status Loopback::render_truth(const DisplayMoment& moment, FramePictures& pictures, DisplayRecord& record) {
  TESSERA_ASSIGN_OR_RETURN(pictures.truth, truth_->truth(moment.view, moment.path_time_ns));
  const shading::ReferenceImage& truth = *pictures.truth;
  const auto has_triangle = [&](uint32_t triangle) { return ours_->has_patch((*patch_of_)[triangle]); };
  record.holes = hole_share(truth.triangle_plus_one, truth.covered, has_triangle);
  holes_sum_ += record.holes;
  ++scored_;
  coverage_.add_seen(moment.now_ns, visible_patches(*scene_, truth.triangle_plus_one,
                                                    truth_->instant().instance_transforms(), moment.view));
  if (!settings_.split) return absl::OkStatus();

  SplitPictures& split = pictures.split.emplace();
  TESSERA_ASSIGN_OR_RETURN(split.chroma_only, ours_->draw_uncoded_420(moment.view));
  TESSERA_ASSIGN_OR_RETURN(split.uncoded, ours_->draw_uncoded(moment.view));
  TESSERA_ASSIGN_OR_RETURN(split.fresh, ours_->draw_fresh(moment.view, truth_->instant()));
  // Visibility off: what the client could not know is filled in from the truth.
  split.seen = split.fresh;
  for (size_t i = 0; i < truth.triangle_plus_one.size(); ++i) {
    const uint32_t id = truth.triangle_plus_one[i];
    if (id != 0 && !has_triangle(id - 1)) std::copy_n(&truth.color.rgba[4 * i], 4, &split.seen.rgba[4 * i]);
  }
  return absl::OkStatus();
}

void Loopback::begin_scoring() {
  if (!unscored_) return;
  scoring_ = std::async(std::launch::async, [this] { return score(*unscored_, *masked_); });
}

void Loopback::end_scoring() {
  if (!unscored_) return;
  const FrameScore score = scoring_.get();
  const FramePictures& pictures = *unscored_;
  DisplayRecord& record = result_.frames[pictures.index];
  for (size_t i = 0; i < methods_.size(); ++i) {
    Method& method = methods_[i];
    const ImageError& error = score.methods[i].error;
    method.error.add(error);
    record.mssim[method.row.method] = error.mssim;
    record.psnr[method.row.method] = error.psnr;
    if (!score.near_masked.empty()) method.near_masked.add(score.near_masked[i]);
  }
  if (score.split) split_.add(*score.split);
  keep_pictures(pictures, score);
  unscored_.reset();
}

void Loopback::keep_pictures(const FramePictures& pictures, const FrameScore& score) {
  const Image8 &truth = pictures.truth->color, &shown = pictures.shown[0];
  const Comparison& c = score.methods[0];
  const auto keep = [&](const char* label) {
    keep_picture({label, "", pictures.index, c.error.mssim, truth, shown, c.ssim});
  };
  if (pictures.index == 0) keep("first");
  if (pictures.index == frame_count() / 2) keep("middle");
  if (c.error.mssim < worst_mssim_) {
    worst_mssim_ = c.error.mssim;
    keep("worst");
  }
  if (score.masked_edges.empty()) return;
  const Window window = busiest_window(score.masked_edges, truth.width, truth.height, kMaskedWindow);
  if (window.edges <= most_masked_edges_) return;
  most_masked_edges_ = window.edges;
  keep_picture(
      {"masked",
       absl::StrFormat("%u x %u pixels from (%u, %u) on, %u times enlarged; of the pixels within 2 px of "
                       "masked silhouettes in the whole frame",
                       window.width, window.height, window.x, window.y, kMaskedScale),
       pictures.index, score.near_masked[0].mean(), enlarged(truth, window, kMaskedScale),
       enlarged(shown, window, kMaskedScale), enlarged(c.ssim, window, kMaskedScale)});
}

// What is measured (the server's frame, the client's picture) runs alone; the rest of the work shares the
// processor with the comparisons of the frame before.
Status Loopback::frame(uint32_t index) {
  const bool scored = index % settings_.score_every == 0;
  FramePictures pictures{.index = index};
  FramePictures* const to_score = scored ? &pictures : nullptr;
  DisplayRecord record;

  StreamSimulation& simulation = *methods_[0].simulation;
  const uint64_t rendered_before = simulation.frames_rendered();
  TESSERA_ASSIGN_OR_RETURN(const DisplayMoment moment, simulation.next_display());
  if (simulation.frames_rendered() != rendered_before) {
    const server::FrameStats& stats = ours_->last_stats();
    server_ms_sum_ += stats.times.total_ms();
    samples_ += stats.gather.samples;
    ++server_frames_;
  }
  const FrameRecord& shown = simulation.shown_frames().back();
  record.time_ns = from_seconds(index / settings_.fps);
  record.frame = moment.frame;
  record.age_ms = to_ms(moment.now_ns - shown.pose_sent);
  if (moment.fresh) {
    record.atlas_bytes = shown.atlas_bytes;
    record.meta_bytes = shown.meta_bytes;
  }
  TESSERA_RETURN_IF_ERROR(draw(methods_[0], moment, to_score));

  begin_scoring();
  if (scored) TESSERA_RETURN_IF_ERROR(render_truth(moment, pictures, record));
  std::vector<DisplayMoment> moments;
  for (Method& method : std::span(methods_).subspan(1)) {
    TESSERA_ASSIGN_OR_RETURN(moments.emplace_back(), method.simulation->next_display());
  }
  end_scoring();

  for (size_t i = 0; i < moments.size(); ++i) {
    TESSERA_RETURN_IF_ERROR(draw(methods_[i + 1], moments[i], to_score));
  }
  result_.frames.push_back(std::move(record));
  if (scored) unscored_ = std::move(pictures);
  return absl::OkStatus();
}

void Loopback::fill_rows() {
  for (Method& method : methods_) {
    Row& row = method.row;
    const StreamSimulation& simulation = *method.simulation;
    row.error = method.error.mean();
    if (method.near_masked.pixels) row.mssim_masked = method.near_masked.mean();
    row.mbps_atlas = simulation.megabits_per_second(Channel::atlas);
    row.mbps_meta = simulation.megabits_per_second(Channel::meta);
    row.mbps_total = row.mbps_atlas + row.mbps_meta;
    row.client_ms = method.draw_ms / std::max<double>(1, static_cast<double>(row.frames_displayed));

    const std::vector<FrameRecord>& shown = simulation.shown_frames();
    add_durations(shown, row);
    if (!shown.empty()) row.frames_lost = shown.back().frame + 1 - shown.size();
  }

  Row& ours = methods_[0].row;
  const CoverageMeter::Result coverage = coverage_.result();
  ours.holes = holes_sum_ / std::max<double>(1, static_cast<double>(scored_));
  ours.coverage = coverage.coverage;
  ours.coverage_without_prediction = coverage.coverage_without_prediction;
  ours.overestimation = coverage.overestimation;
  ours.violations = ours_->violations();
  ours.server_ms = server_ms_sum_ / std::max<double>(1, static_cast<double>(server_frames_));
  ours.samples_shaded = samples_ / std::max<uint64_t>(1, server_frames_);
  ours.peak_rss_mib = peak_rss_mib();
  ours.device_mib = static_cast<double>(device_->memory_peak()) / (1 << 20);
  for (Method& method : methods_) result_.rows.push_back(method.row);
  result_.records = methods_[0].simulation->shown_frames();
  if (settings_.split) {
    split_.coded = methods_[0].error;
    result_.split = split_.rows();
  }
}

// Draws the first display frames and tells from them how long the others will take; how many there were.
// Display frame 0 brings the first server frames with it, and compilers warm up; a whole round of server
// frames and of scored ones follows.
StatusOr<uint32_t> Loopback::estimate() {
  const auto server_period = static_cast<uint32_t>(std::ceil(settings_.fps / settings_.server_fps));
  const uint32_t period = std::max({1u, server_period, settings_.score_every});
  const uint32_t first = std::min(2u, frame_count()), end = std::min(first + period, frame_count());
  for (uint32_t i = 0; i < first; ++i) TESSERA_RETURN_IF_ERROR(frame(i));
  const TimeNs start = SteadyClock().now();
  for (uint32_t i = first; i < end; ++i) TESSERA_RETURN_IF_ERROR(frame(i));
  const double frame_s = end > first ? 1e-3 * ms_since(start) / (end - first) : 0;
  progress_.estimate(frame_s * (frame_count() - end));
  return end;
}

StatusOr<LoopbackResult> Loopback::run() {
  TESSERA_RETURN_IF_ERROR(set_up());
  if (frame_count() == 0) return absl::InvalidArgumentError("--seconds and --fps give no display frame");
  TESSERA_ASSIGN_OR_RETURN(const uint32_t done, estimate());
  if (settings_.estimate_only) {
    result_.frames.clear();
    result_.pictures.clear();
    return std::move(result_);
  }
  progress_.begin("display frames", frame_count() - done);
  for (uint32_t i = done; i < frame_count(); ++i) {
    TESSERA_RETURN_IF_ERROR(frame(i));
    progress_.advance();
  }
  begin_scoring();
  end_scoring();
  fill_rows();
  return std::move(result_);
}

}  // namespace

StatusOr<LoopbackResult> run_loopback(const LoopbackSettings& settings, Progress& progress) {
  if (settings.clock == "real") return run_real_loopback(settings, progress);
  if (settings.sessions != 1) return absl::InvalidArgumentError("--sessions needs --clock real");
  return Loopback(settings, progress).run();
}

}  // namespace tessera::bench
