#include "bench/gather_study.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

#include "atlas/layout.h"
#include "bench/streamer.h"
#include "bench/study_scene.h"
#include "bench/texel_shader.h"
#include "bench/texel_shading.h"
#include "pvs/visibility.h"
#include "server/shared_scene.h"
#include "shading/reference.h"
#include "shading/tessellator.h"

namespace tessera::bench {
namespace {

using atlas::Placement;
using shading::GatherPath;
using shading::GatherShape;
using shading::LoadShape;
using shading::LoadTriangle;

constexpr uint32_t kBlockSides[] = {2, 4, 8, 16, 32, 64, 128};
constexpr uint32_t kLevels[] = {1, 2, 4, 8, 16, 32, 64};
constexpr uint32_t kHalfWidths[] = {4, 8, 16, 32};
constexpr uint32_t kSlants[] = {4, 8, 16};  // base to height; both halves have the same share of the base
constexpr uint32_t kAtlasWidth = 4096, kAtlasHeight = 2048;
constexpr double kMtexel = 1 << 20;

// The newest run's, by name; samples of a pixel sum up.
double interval_ms(gpu::Device& device, std::string_view name) {
  double ms = 0;
  for (const auto& interval : device.intervals())
    if (interval.name == name) ms += interval.ms;
  return ms;
}

// What one round took.
struct ForwardTime {
  double depth_ms = 0, shading_ms = 0;
};

// One row in the making: a load, and how to shade it.
struct LoadTime {
  double gpu_ms = 0, list_ms = 0;
};
struct Case {
  GatherRow row;
  std::function<StatusOr<LoadTime>()> shade;
  std::vector<double> ns, ratio, ratio_shading, list_ms;
};

// Everything of one run.
class Study {
 public:
  Study(const GatherStudySettings& settings, Progress& progress) : settings_(settings), progress_(progress) {}
  StatusOr<GatherStudyResult> run();

 private:
  bool wants(std::string_view group) const {
    return settings_.groups.empty() || std::ranges::find(settings_.groups, group) != settings_.groups.end();
  }
  Status set_up();
  Status look();
  StatusOr<ForwardTime> forward();
  StatusOr<LoadTime> gather(const std::vector<Placement>& load, GatherPath path);
  Status add_shapes();
  Status add_layouts();
  Status add_texels();
  Status add_load(GatherRow row, std::vector<Placement> load);
  Status measure_round(bool counts);
  Status measure_costs();
  void finish();

  const GatherStudySettings settings_;
  Progress& progress_;
  GatherStudyResult result_;
  std::shared_ptr<gpu::Device> device_;
  std::shared_ptr<server::SharedScene> shared_;
  std::unique_ptr<scene::SceneInstant> instant_;
  std::unique_ptr<shading::ReferenceRenderer> reference_;
  std::unique_ptr<shading::Gather> gather_;
  View view_;
  bool tessellates_ = false;
  std::vector<uint32_t> ids_;         // of the picture, triangle + 1
  std::vector<uvec2> opaque_pixels_;  // spread over the picture
  uint64_t covered_ = 0;
  std::optional<UniqueTexture> texture_;
  std::unique_ptr<TexelShader> texel_shader_;
  std::vector<Case> cases_;
  std::vector<double> forward_ns_, shading_ns_;
};

Status Study::set_up() {
  const LoopbackSettings& common = settings_.common;
  TESSERA_ASSIGN_OR_RETURN(const StudyScene on, load_study_scene(common));
  device_ = on.device;
  shared_ = on.shared;
  const TimeNs time = from_seconds(common.start_s);
  view_ = client_view(common);
  view_.pose = on.path.at(time);
  TESSERA_ASSIGN_OR_RETURN(instant_, scene::SceneInstant::create(*device_, shared_->gpu_scene()));
  instant_->set(time, view_.pose.position);
  TESSERA_RETURN_IF_ERROR(shared_->lighting().update(*instant_));
  TESSERA_ASSIGN_OR_RETURN(
      reference_, shading::ReferenceRenderer::create(*device_, shared_->gpu_scene(), shared_->lighting()));
  TESSERA_ASSIGN_OR_RETURN(gather_,
                           shading::Gather::create(*device_, shared_->gpu_scene(), shared_->lighting(),
                                                   {.width = kAtlasWidth, .height = kAtlasHeight}));
  tessellates_ = shading::check_tessellator(*device_).ok();
  result_.settings = settings_;
  result_.device = on.description();
  return look();
}

// What the picture shows.
Status Study::look() {
  TESSERA_ASSIGN_OR_RETURN(shading::ReferenceImage image,
                           reference_->render(*instant_, view_, {.samples = 1, .ids = true}));
  ids_ = std::move(image.triangle_plus_one);
  const scene::Scene& scene = shared_->scene();
  const pvs::TriangleToPatch patch_of(scene);
  uint64_t masked = 0;
  for (size_t i = 0; i < ids_.size(); ++i) {
    if (ids_[i] == 0) continue;
    ++covered_;
    const uint32_t instance = scene.instance_of(patch_of[ids_[i] - 1]);
    const bool is_masked =
        scene.materials[scene.instances[instance].material].alpha_mode == scene::AlphaMode::mask;
    masked += is_masked;
    if (!is_masked) opaque_pixels_.emplace_back(i % view_.width, i / view_.width);
  }
  if (opaque_pixels_.empty())
    return absl::InvalidArgumentError(
        "gather: the view shows nothing opaque; choose another --start or --path");
  const auto pixels = static_cast<double>(ids_.size());
  result_.covered = static_cast<double>(covered_) / pixels;
  result_.masked = static_cast<double>(masked) / pixels;
  return absl::OkStatus();
}

StatusOr<ForwardTime> Study::forward() {
  TESSERA_RETURN_IF_ERROR(reference_->render(*instant_, view_, {.samples = 1}).status());
  return ForwardTime{interval_ms(*device_, "reference depth"), interval_ms(*device_, "reference color")};
}

StatusOr<LoadTime> Study::gather(const std::vector<Placement>& load, GatherPath path) {
  TESSERA_RETURN_IF_ERROR(
      gather_->choose(path == GatherPath::automatic ? shared_->gather_choice() : shading::only(path)));
  gpu::Commands commands = device_->begin();
  TESSERA_RETURN_IF_ERROR(gather_->record(commands, *instant_, view_, load));
  TESSERA_RETURN_IF_ERROR(device_->run(std::move(commands)));
  const shading::GatherStats& stats = gather_->stats();
  return LoadTime{stats.gpu_ms, stats.list_ms};
}

// A case for each path.
Status Study::add_load(GatherRow row, std::vector<Placement> placements) {
  const auto load = std::make_shared<std::vector<Placement>>(std::move(placements));
  TESSERA_RETURN_IF_ERROR(gather(*load, GatherPath::compute).status());
  const shading::GatherStats& stats = gather_->stats();
  row.samples = stats.samples;
  if (stats.half_samples > 0)
    row.outside = static_cast<double>(stats.half_samples_outside) / static_cast<double>(stats.half_samples);
  std::vector<GatherPath> paths(std::begin(shading::kGatherPaths), std::end(shading::kGatherPaths));
  if (row.group == "layouts") paths.push_back(GatherPath::automatic);  // others have one shape and size
  // It computes blocks.
  const bool only_blocks = row.group == "blocks" || (row.group == "layouts" && row.name != "tessellated");
  for (const GatherPath path : paths) {
    if (path == GatherPath::tessellation && (only_blocks || !tessellates_)) continue;
    row.path = name_of(path);
    cases_.push_back({.row = row, .shade = [this, load, path] { return gather(*load, path); }});
  }
  return absl::OkStatus();
}

Status Study::add_shapes() {
  const scene::Scene& scene = shared_->scene();
  const pvs::TriangleToPatch patch_of(scene);
  const auto triangle_at = [&](uvec2 pixel) -> LoadTriangle {
    const uint32_t triangle = ids_[size_t{pixel.y} * view_.width + pixel.x] - 1;
    const scene::PatchId patch = patch_of[triangle];
    const scene::Instance& instance = scene.instances[scene.instance_of(patch)];
    const scene::Patch& p = scene.geometries[instance.geometry].patches[patch - instance.first_patch];
    return {patch, triangle - instance.first_triangle - p.first_triangle};
  };
  const auto add = [&](GatherRow row, const LoadShape& shape, double samples_of_one) -> Status {
    const size_t count = std::clamp<size_t>(
        static_cast<size_t>(std::ceil(settings_.samples / samples_of_one)), 1, opaque_pixels_.size());
    std::vector<LoadTriangle> triangles;
    for (size_t i = 0; i < count; ++i)
      triangles.push_back(triangle_at(opaque_pixels_[i * opaque_pixels_.size() / count]));
    row.size = shape.size;
    return add_load(std::move(row),
                    make_load(shape, triangles, settings_.samples, kAtlasWidth, kAtlasHeight));
  };
  for (const uint32_t side : kBlockSides) {
    if (!wants("blocks")) break;
    TESSERA_RETURN_IF_ERROR(add({.group = "blocks", .name = absl::StrCat(side, "x", side)},
                                {GatherShape::block, side}, double{1} * side * side));
  }
  for (const uint32_t level : kLevels) {
    if (!wants("l")) break;
    TESSERA_RETURN_IF_ERROR(add({.group = "l", .name = absl::StrCat("level ", level)},
                                {GatherShape::l, level}, 0.75 * (level + 1) * (level + 1)));
  }
  for (const uint32_t across : kHalfWidths)
    for (const uint32_t slant : kSlants) {
      if (!wants("halves")) break;
      const uint32_t along = slant * across / 2;
      TESSERA_RETURN_IF_ERROR(
          add({.group = "halves", .name = absl::StrCat(across, ", slant ", slant), .slant = double(slant)},
              {GatherShape::half, across, along}, double{1} * across * along));
    }
  return absl::OkStatus();
}

// What the layouts make of the view, at the screen's resolution.
Status Study::add_layouts() {
  const scene::Scene& scene = shared_->scene();
  TESSERA_ASSIGN_OR_RETURN(const auto visibility,
                           pvs::Visibility::create(*device_, shared_->gpu_scene(), {}));
  TESSERA_ASSIGN_OR_RETURN(const scene::VisiblePatches visible,
                           visibility->determine(*instant_, {&view_, 1}, view_));
  for (size_t kind = 0; kind < std::size(atlas::kLayoutNames); ++kind) {
    atlas::LayoutSettings settings =
        atlas::layout_settings(static_cast<atlas::LayoutKind>(kind), kAtlasWidth, kAtlasHeight);
    settings.levels.min_bias = 0;
    TESSERA_ASSIGN_OR_RETURN(const auto layout, atlas::create_layout(scene, settings));
    layout->update(
        {.visible = visible, .eye = view_.pose.position, .transforms = instant_->instance_transforms()});
    const std::span<const Placement> placements = layout->placements();
    TESSERA_RETURN_IF_ERROR(add_load({.group = "layouts", .name = std::string(atlas::kLayoutNames[kind])},
                                     {placements.begin(), placements.end()}));
  }
  return absl::OkStatus();
}

Status Study::add_texels() {
  const auto& transforms = instant_->instance_transforms();
  TESSERA_ASSIGN_OR_RETURN(texture_,
                           UniqueTexture::create(shared_->scene(), transforms,
                                                 static_cast<uint64_t>(settings_.texture_mtexels * kMtexel)));
  TESSERA_ASSIGN_OR_RETURN(
      texel_shader_, TexelShader::create(*device_, shared_->gpu_scene(), shared_->lighting(), *texture_));
  const std::vector<TexelTile> visible = texture_->visible_tiles(ids_, view_, transforms);
  result_.texel_tiles = visible.size();
  for (const TexelTile& tile : visible) result_.texel_samples += texture_->samples(tile);
  result_.texels_per_metre = texture_->texels_per_metre();

  const size_t count = std::clamp<size_t>(settings_.samples / kTexelTileTexels, 1,
                                          std::min<size_t>(opaque_pixels_.size(), TexelShader::kMaxTiles));
  const auto tiles = std::make_shared<std::vector<TexelTile>>();
  GatherRow row{.group = "texels", .name = "8x8 tiles", .path = "compute", .size = kTexelTile};
  for (size_t i = 0; i < count; ++i) {
    const uvec2 pixel = opaque_pixels_[i * opaque_pixels_.size() / count];
    const TexelLookup at =
        texture_->lookup(ids_[size_t{pixel.y} * view_.width + pixel.x] - 1, view_, pixel, transforms);
    const uvec2 last = texture_->size(at.instance, at.level) - 1u;
    const uvec2 tile = glm::min(uvec2(glm::max(at.position + 0.5f, vec2(0))), last) / kTexelTile;
    tiles->push_back({at.instance, at.level, tile.x, tile.y});
    row.samples += texture_->samples(tiles->back());
  }
  row.empty = 1 - static_cast<double>(row.samples) / static_cast<double>(count * kTexelTileTexels);
  cases_.push_back({.row = row, .shade = [this, tiles]() -> StatusOr<LoadTime> {
                      TESSERA_ASSIGN_OR_RETURN(const ShadedTexels shaded,
                                               texel_shader_->shade(*instant_, view_, *tiles));
                      return LoadTime{.gpu_ms = shaded.gpu_ms};
                    }});
  return absl::OkStatus();
}

// A forward picture before and after each load: ratios are to the mean of the two, so that what drifts on the
// machine drifts for both.
Status Study::measure_round(bool counts) {
  std::vector<LoadTime> times;
  std::vector<ForwardTime> before;  // each load, and after the last
  std::vector<size_t> load_of;
  const auto look_forward = [&]() -> Status {
    TESSERA_ASSIGN_OR_RETURN(before.emplace_back(), forward());
    return absl::OkStatus();
  };
  for (size_t i = 0; i < cases_.size(); ++i) {
    const GatherRow& row = cases_[i].row;
    const bool new_load =
        i == 0 || row.group != cases_[i - 1].row.group || row.name != cases_[i - 1].row.name;
    if (new_load) TESSERA_RETURN_IF_ERROR(look_forward());
    load_of.push_back(before.size() - 1);
    TESSERA_ASSIGN_OR_RETURN(times.emplace_back(), cases_[i].shade());
    progress_.advance();
  }
  TESSERA_RETURN_IF_ERROR(look_forward());
  if (!counts) return absl::OkStatus();
  const double per_pixel = 1e6 / static_cast<double>(covered_);
  for (const ForwardTime& time : before) {
    forward_ns_.push_back((time.depth_ms + time.shading_ms) * per_pixel);
    shading_ns_.push_back(time.shading_ms * per_pixel);
  }
  const size_t first = forward_ns_.size() - before.size();
  for (size_t i = 0; i < cases_.size(); ++i) {
    Case& c = cases_[i];
    const size_t at = first + load_of[i];
    const double ns = 1e6 * times[i].gpu_ms / static_cast<double>(std::max<uint64_t>(1, c.row.samples));
    c.ns.push_back(ns);
    c.list_ms.push_back(times[i].list_ms);
    c.ratio.push_back(2 * ns / (forward_ns_[at] + forward_ns_[at + 1]));
    c.ratio_shading.push_back(2 * ns / (shading_ns_[at] + shading_ns_[at + 1]));
  }
  return absl::OkStatus();
}

Status Study::measure_costs() {
  const SteadyClock clock;
  const TimeNs begin = clock.now();
  TESSERA_ASSIGN_OR_RETURN(
      result_.costs, shading::measure_gather_costs(*device_, shared_->gpu_scene(), *instant_,
                                                   shared_->lighting(), {.samples = settings_.samples}));
  result_.costs_ms = to_ms(clock.now() - begin);
  result_.measured_choice = to_text(cheapest(result_.costs));
  result_.software_choice = to_text(shading::software_choice());
  return absl::OkStatus();
}

void Study::finish() {
  for (Case& c : cases_) {
    c.row.ns = spread_of(std::move(c.ns));
    c.row.list_ms = spread_of(std::move(c.list_ms));
    c.row.ratio = spread_of(std::move(c.ratio));
    c.row.ratio_shading = spread_of(std::move(c.ratio_shading));
    result_.rows.push_back(std::move(c.row));
  }
  result_.forward_ns = spread_of(std::move(forward_ns_));
  result_.shading_ns = spread_of(std::move(shading_ns_));
}

StatusOr<GatherStudyResult> Study::run() {
  TESSERA_RETURN_IF_ERROR(set_up());
  TESSERA_RETURN_IF_ERROR(add_shapes());
  if (wants("layouts")) TESSERA_RETURN_IF_ERROR(add_layouts());
  if (wants("texels")) TESSERA_RETURN_IF_ERROR(add_texels());
  progress_.begin("loads", (settings_.rounds + 1) * cases_.size());
  for (uint32_t round = 0; round <= settings_.rounds; ++round)
    TESSERA_RETURN_IF_ERROR(measure_round(round > 0));
  if (wants("costs")) TESSERA_RETURN_IF_ERROR(measure_costs());
  finish();
  return std::move(result_);
}

}  // namespace

GatherStudySettings::GatherStudySettings() {
  common.size = {1920, 1080};
}

Spread spread_of(std::vector<double> values) {
  if (values.empty()) return {};
  std::ranges::sort(values);
  const auto at = [&](double share) {
    const double rank = share * static_cast<double>(values.size() - 1);
    const auto below = static_cast<size_t>(rank);
    return std::lerp(values[below], values[std::min(below + 1, values.size() - 1)],
                     rank - static_cast<double>(below));
  };
  return {at(0.5), at(0.25), at(0.75)};
}

StatusOr<GatherStudyResult> run_gather_study(const GatherStudySettings& settings, Progress& progress) {
  return Study(settings, progress).run();
}

}  // namespace tessera::bench
