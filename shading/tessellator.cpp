#include "shading/tessellator.h"

#include <algorithm>

#include "atlas/addressing/addressing.h"
#include "gpu/commands.h"
#include "shading/shaders/patch.tesc.spv.h"
#include "shading/shaders/tessellator.tese.spv.h"
#include "shading/shaders/tessellator.vert.spv.h"

namespace tessera::shading {
namespace {

namespace addressing = atlas::addressing;

// Trial in shading/shaders/tessellator.glsl.
struct TrialRecord {
  int32_t level, samples;
  uint32_t first;
};
constexpr uint32_t kCounters = 2;  // before a trial's places: evaluations, elsewhere

uint32_t places_of(const Trial& trial) {
  return static_cast<uint32_t>(trial.level > 0 ? (trial.level + 1) * (trial.level + 1) : trial.samples);
}

uint32_t points_of(const Trial& trial) {
  return static_cast<uint32_t>(trial.level > 0 ? addressing::tessellation_vertices(trial.level)
                                               : trial.samples);
}

bool in_range(const Trial& trial) {
  if (trial.level != 0) return trial.level > 0 && trial.level <= addressing::kMaxTessellationLevel;
  return trial.samples >= 3 && trial.samples <= addressing::kMaxTessellationVertices;
}

std::string name_of(const Trial& trial) {
  return trial.level > 0 ? absl::StrFormat("at level %d", trial.level)
                         : absl::StrFormat("of %d samples", trial.samples);
}

StatusOr<std::vector<TrialRecord>> records_of(std::span<const Trial> trials) {
  std::vector<TrialRecord> records;
  uint32_t next = 0;
  for (const Trial& trial : trials) {
    if (!in_range(trial))
      return absl::InvalidArgumentError(absl::StrFormat(
          "tessellator: level %d must be 1..%d, or else the samples, %d, 3..%d", trial.level,
          addressing::kMaxTessellationLevel, trial.samples, addressing::kMaxTessellationVertices));
    records.push_back({trial.level, trial.samples, next});
    next += kCounters + places_of(trial);
  }
  return records;
}

void draw_all(gpu::Commands& commands, std::span<const Trial> trials) {
  uint32_t first = 0, points = 0;
  for (uint32_t i = 0; i < trials.size(); ++i) {
    if (points + points_of(trials[i]) > kMaxPointsADraw) {
      commands.draw(i - first, 1, first);
      first = i;
      points = 0;
    }
    points += points_of(trials[i]);
  }
  commands.draw(static_cast<uint32_t>(trials.size()) - first, 1, first);
}

std::vector<TrialMarks> read_marks(std::span<const Trial> trials, std::span<const TrialRecord> records,
                                   std::span<const uint32_t> words) {
  std::vector<TrialMarks> all;
  for (size_t i = 0; i < trials.size(); ++i) {
    const auto own = words.subspan(records[i].first, kCounters + places_of(trials[i]));
    const auto places = own.subspan(kCounters);
    all.push_back({own[0], own[1], {places.begin(), places.end()}});
  }
  return all;
}

// All levels, and numbers of samples whose outer levels are even and uneven.
std::vector<Trial> usual_trials() {
  constexpr int kStride = 31;
  std::vector<Trial> trials;
  for (int level = 1; level <= addressing::kMaxTessellationLevel; ++level) trials.push_back({.level = level});
  for (int samples = 3; samples <= addressing::kMaxTessellationVertices; samples += kStride)
    trials.push_back({.samples = samples});
  return trials;
}

}  // namespace

StatusOr<std::vector<TrialMarks>> run_tessellator(gpu::Device& device, std::span<const Trial> trials) {
  TESSERA_ASSIGN_OR_RETURN(const auto records, records_of(trials));
  if (records.empty()) return std::vector<TrialMarks>{};
  const uint64_t bytes = sizeof(uint32_t) * (records.back().first + kCounters + places_of(trials.back()));
  constexpr gpu::Binding kBindings[] = {{0, gpu::BindingKind::storage_buffer},
                                        {1, gpu::BindingKind::storage_buffer}};
  TESSERA_ASSIGN_OR_RETURN(const auto layout, gpu::BindLayout::create(device, kBindings));
  TESSERA_ASSIGN_OR_RETURN(const auto pipeline,
                           gpu::TessellationPipeline::create(device, {.name = "tessellator",
                                                                      .vertex = tessellator_vert,
                                                                      .control = patch_tesc,
                                                                      .evaluation = tessellator_tese,
                                                                      .layouts = {&layout}}));
  TESSERA_ASSIGN_OR_RETURN(
      const auto asked,
      gpu::Buffer::create_filled(device, std::as_bytes(std::span(records)), "tessellator trials"));
  TESSERA_ASSIGN_OR_RETURN(const auto marks,
                           gpu::Buffer::create(device, bytes, gpu::Memory::readback, "tessellator marks"));
  TESSERA_ASSIGN_OR_RETURN(auto group, gpu::BindGroup::create(device, layout));
  group.set(0, asked);
  group.set(1, marks);
  gpu::Commands commands = device.begin();
  commands.fill(marks, 0);
  commands.barrier();
  commands.begin_rendering({.width = 1, .height = 1});
  commands.bind(pipeline, {&group});
  draw_all(commands, trials);
  commands.end_rendering();
  TESSERA_RETURN_IF_ERROR(device.run(std::move(commands)));
  return read_marks(trials, records, marks.as<const uint32_t>());
}

bool fits(const Trial& trial, const TrialMarks& marks) {
  if (marks.elsewhere > 0) return false;
  const int side = trial.level + 1;
  for (int i = 0; i < static_cast<int>(marks.places.size()); ++i) {
    const bool has_sample = trial.level == 0 || addressing::l_contains({i % side, i / side}, trial.level);
    if ((marks.places[static_cast<size_t>(i)] > 0) != has_sample) return false;
  }
  return true;
}

Status check_tessellator(gpu::Device& device) {
  const std::vector<Trial> trials = usual_trials();
  TESSERA_ASSIGN_OR_RETURN(const std::vector<TrialMarks> marks, run_tessellator(device, trials));
  for (size_t i = 0; i < trials.size(); ++i) {
    if (!fits(trials[i], marks[i]))
      return absl::FailedPreconditionError(absl::StrFormat(
          "the tessellator of \"%s\" does not make the samples of a triangle %s, with %u "
          "evaluations for %u; gather by compute or raster instead",
          device.info().name, name_of(trials[i]), marks[i].evaluations, points_of(trials[i])));
  }
  return absl::OkStatus();
}

}  // namespace tessera::shading
