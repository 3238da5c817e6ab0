#include "bench/memory_speed.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <random>

#include "atlas/blocks/gpu_allocator.h"
#include "atlas/blocks/layout.h"
#include "base/time.h"

namespace tessera::bench {
namespace {

using atlas::LayoutSettings;
using atlas::Level;
using atlas::blocks::Allocator;
using atlas::blocks::BlockAddress;
using atlas::blocks::GpuAllocator;
using atlas::blocks::GpuRequest;
using atlas::blocks::Request;

constexpr double kFill = 0.7;    // of the atlas, by the visible patches
constexpr uint32_t kWarmUp = 3;  // frames that are not timed

uint64_t texel_count(Level level) {
  return uint64_t{1} << (level.log_w + level.log_h);
}

// All patches in one geometry, two triangles each.
scene::Scene scene_of(uint32_t patches) {
  scene::Scene scene;
  scene.geometries.resize(1);
  for (uint32_t i = 0; i < patches; ++i) {
    scene.geometries[0].patches.push_back({.first_triangle = 2 * i, .triangle_count = 2});
  }
  scene.materials.resize(1);
  scene.instances = {{.geometry = 0, .material = 0, .node = 0, .first_patch = 0}};
  scene.patch_count = patches;
  return scene;
}

// Patches of random footprints, of which half are visible; some leave every frame, and as many come.
class Crowd {
 public:
  Crowd(uint32_t visible, uint64_t seed) : random_(seed), footprints_(2 * visible), levels_(2 * visible) {
    std::uniform_real_distribution<float> log_side(0.5f, 3.5f);
    for (uint32_t i = 0; i < 2 * visible; ++i) {
      const float u = std::exp2(log_side(random_)), v = std::exp2(log_side(random_));
      footprints_[i] = {u, v, u * v};
      const auto log = [](float side) {
        return static_cast<uint8_t>(std::max(1L, std::lround(std::log2(side))));
      };
      levels_[i] = {std::max(log(u), log(v)), std::min(log(u), log(v))};
      (i % 2 ? visible_ : hidden_).push_back(i);
    }
  }

  void step(double churn) {
    const auto count = static_cast<size_t>(churn * static_cast<double>(visible_.size()));
    for (size_t i = 0; i < count; ++i) {
      std::swap(visible_[i],
                visible_[std::uniform_int_distribution<size_t>(i, visible_.size() - 1)(random_)]);
      std::swap(hidden_[i], hidden_[std::uniform_int_distribution<size_t>(i, hidden_.size() - 1)(random_)]);
      std::swap(visible_[i], hidden_[i]);
    }
  }

  size_t size() const { return levels_.size(); }
  // The level of every patch, {} where it is not visible.
  std::vector<Level> wishes() const {
    std::vector<Level> wishes(levels_.size());
    for (const uint32_t patch : visible_) wishes[patch] = levels_[patch];
    return wishes;
  }
  scene::VisiblePatches visible() const {
    scene::VisiblePatches out;
    for (const uint32_t patch : visible_) out.push_back({patch, footprints_[patch]});
    std::ranges::sort(out, {}, &scene::VisiblePatch::patch);
    return out;
  }
  uint64_t visible_texels() const {
    uint64_t texels = 0;
    for (const uint32_t patch : visible_) texels += texel_count(levels_[patch]);
    return texels;
  }

 private:
  std::mt19937_64 random_;
  std::vector<scene::Footprint> footprints_;
  std::vector<Level> levels_;
  std::vector<uint32_t> visible_, hidden_;
};

LayoutSettings atlas_for(uint64_t texels) {
  constexpr uint32_t kStep = 256;
  const auto side = static_cast<uint32_t>(std::ceil(std::sqrt(static_cast<double>(texels) / kFill) / kStep));
  return atlas::blocks::settings_for(kStep * side, kStep * side);
}

// The patches' blocks, with the management on the CPU.
class CpuMemory {
 public:
  CpuMemory(uint8_t superblock_log, uint32_t superblocks, size_t patches)
      : allocator_(superblock_log, superblocks),
        levels_(patches),
        blocks_(patches, Allocator::kNoBlock),
        found_(patches) {}

  // Gives the times of the phases, and of all.
  std::pair<DurationNs, DurationNs> update(std::span<const Level> wishes) {
    const TimeNs begin = clock_.now();
    find_requests(wishes);
    const TimeNs found = clock_.now();
    out_.resize(requests_.size());
    allocator_.update(requests_, out_);
    const TimeNs done = clock_.now();
    for (size_t i = 0; i < changed_count_; ++i) {
      blocks_[found_[i]] = out_[i];
      levels_[found_[i]] = wishes[found_[i]];
    }
    return {done - found, clock_.now() - begin};
  }

  // Of the last update.
  std::span<const uint32_t> changed() const { return std::span(found_).first(changed_count_); }
  std::span<const Request> requests() const { return requests_; }
  std::span<const BlockAddress> assigned() const { return out_; }

 private:
  void find_requests(std::span<const Level> wishes) {
    // Without a branch on what is as good as random: a wrong guess costs more than the rest.
    size_t count = 0;
    for (uint32_t patch = 0; patch < levels_.size(); ++patch) {
      found_[count] = patch;
      count += std::bit_cast<uint16_t>(wishes[patch]) != std::bit_cast<uint16_t>(levels_[patch]) ? 1u : 0u;
    }
    changed_count_ = count;
    requests_.clear();
    for (const uint32_t patch : changed()) {
      requests_.push_back({.frees = blocks_[patch] != Allocator::kNoBlock,
                           .old_level = levels_[patch],
                           .old_block = blocks_[patch],
                           .allocates = wishes[patch] != Level{},
                           .level = wishes[patch]});
    }
  }

  SteadyClock clock_;
  Allocator allocator_;
  std::vector<Level> levels_;
  std::vector<BlockAddress> blocks_;
  std::vector<Request> requests_;
  std::vector<uint32_t> found_;  // as long as all patches
  size_t changed_count_ = 0;     // the front of found_
  std::vector<BlockAddress> out_;
};

// The device's allocator, with a request for every patch, as a pass over all patches would write them.
class GpuMemory {
 public:
  static StatusOr<std::unique_ptr<GpuMemory>> create(gpu::Device& device, uint8_t superblock_log,
                                                     uint32_t superblocks, uint32_t patches) {
    auto memory = std::unique_ptr<GpuMemory>(new GpuMemory(device, superblock_log, patches));
    TESSERA_ASSIGN_OR_RETURN(memory->allocator_,
                             GpuAllocator::create(device, superblock_log, superblocks, patches));
    TESSERA_ASSIGN_OR_RETURN(memory->upload_,
                             gpu::Buffer::create(device, patches * sizeof(GpuRequest), gpu::Memory::upload,
                                                 "memory bench requests"));
    TESSERA_ASSIGN_OR_RETURN(memory->readback_,
                             gpu::Buffer::create(device, patches * sizeof(uint32_t), gpu::Memory::readback,
                                                 "memory bench blocks"));
    return memory;
  }

  // Device time in ms.
  StatusOr<double> update(const CpuMemory& cpu) {
    const auto records = upload_.as<GpuRequest>();
    std::ranges::fill(records, GpuRequest{});
    for (size_t i = 0; i < cpu.changed().size(); ++i) {
      records[cpu.changed()[i]] = to_gpu(cpu.requests()[i], superblock_log_);
    }
    gpu::Commands commands = device_.begin();
    commands.copy(upload_, 0, allocator_->requests(), 0, upload_.size());
    commands.barrier();
    commands.begin_interval("block allocation");
    allocator_->record_update(commands, patches_);
    commands.end_interval();
    commands.copy(allocator_->blocks(), 0, readback_, 0, readback_.size());
    TESSERA_RETURN_IF_ERROR(device_.run(std::move(commands)));
    return device_.intervals().front().ms;
  }

  uint64_t count_differing(const CpuMemory& cpu) const {
    const auto blocks = readback_.as<uint32_t>();
    uint64_t differing = 0;
    for (size_t i = 0; i < cpu.changed().size(); ++i)
      differing += allocator_->block(blocks[cpu.changed()[i]]) != cpu.assigned()[i];
    return differing;
  }

 private:
  GpuMemory(gpu::Device& device, uint8_t superblock_log, uint32_t patches)
      : device_(device), superblock_log_(superblock_log), patches_(patches) {}

  gpu::Device& device_;
  uint8_t superblock_log_;
  uint32_t patches_;
  std::unique_ptr<GpuAllocator> allocator_;
  gpu::Buffer upload_, readback_;
};

// Times of the frames of one row.
struct Samples {
  std::vector<double> phases, cpu, gpu, layout;
};

StatusOr<SpeedRow> measure_row(gpu::Device& device, uint32_t patches, const SpeedSettings& settings,
                               uint64_t seed, Progress& progress) {
  Crowd crowd(patches, seed);
  const LayoutSettings layout_settings = atlas_for(crowd.visible_texels());
  const uint8_t log = layout_settings.superblock_log;
  SpeedRow row{.patches = patches, .atlas_texels = uint64_t{layout_settings.width} * layout_settings.height};
  const auto superblocks = static_cast<uint32_t>(row.atlas_texels >> (2 * log));
  const scene::Scene scene = scene_of(2 * patches);
  TESSERA_ASSIGN_OR_RETURN(const auto layout, atlas::blocks::Layout::create(scene, layout_settings));
  CpuMemory cpu(log, superblocks, crowd.size());
  TESSERA_ASSIGN_OR_RETURN(const auto gpu, GpuMemory::create(device, log, superblocks, 2 * patches));

  const SteadyClock clock;
  Samples samples;
  for (uint32_t frame = 0; frame < kWarmUp + settings.frames; ++frame) {
    if (frame > 0) crowd.step(settings.churn);
    const auto [phases_ns, cpu_ns] = cpu.update(crowd.wishes());
    TESSERA_ASSIGN_OR_RETURN(const double gpu_ms, gpu->update(cpu));
    const scene::VisiblePatches visible = crowd.visible();
    const TimeNs begin = clock.now();
    layout->update({.visible = visible});
    const TimeNs end = clock.now();
    row.differing_blocks += gpu->count_differing(cpu);
    for (size_t i = 0; i < cpu.requests().size(); ++i)
      row.out_of_memory += cpu.requests()[i].allocates && cpu.assigned()[i] == Allocator::kNoBlock;
    progress.advance();
    if (frame < kWarmUp) continue;
    row.requests = static_cast<uint32_t>(cpu.requests().size());
    samples.phases.push_back(to_ms(phases_ns));
    samples.cpu.push_back(to_ms(cpu_ns));
    samples.gpu.push_back(gpu_ms);
    samples.layout.push_back(to_ms(end - begin));
  }
  row.phases = percentiles(std::move(samples.phases));
  row.cpu = percentiles(std::move(samples.cpu));
  row.gpu = percentiles(std::move(samples.gpu));
  row.layout = percentiles(std::move(samples.layout));
  return row;
}

}  // namespace

double SpeedRow::phases_ns_per_request() const {
  return requests ? 1e6 * phases.p50 / requests : 0;
}

StatusOr<std::vector<SpeedRow>> measure_speed(gpu::Device& device, const SpeedSettings& settings,
                                              uint64_t seed, Progress& progress) {
  std::vector<SpeedRow> rows;
  for (const uint32_t patches : settings.patches) {
    if (patches == 0) continue;
    progress.begin(absl::StrCat(patches, " visible patches"), kWarmUp + settings.frames);
    TESSERA_ASSIGN_OR_RETURN(SpeedRow row, measure_row(device, patches, settings, seed, progress));
    rows.push_back(row);
  }
  return rows;
}

}  // namespace tessera::bench
