#include "atlas/blocks/gpu_allocator.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <numeric>
#include <vector>

#include "atlas/shaders/blocks_assign.comp.spv.h"
#include "atlas/shaders/blocks_count.comp.spv.h"
#include "atlas/shaders/blocks_find_empty.comp.spv.h"
#include "atlas/shaders/blocks_provision.comp.spv.h"
#include "atlas/shaders/blocks_recycle_stacks.comp.spv.h"
#include "atlas/shaders/blocks_recycle_superblocks.comp.spv.h"
#include "atlas/shaders/blocks_request.comp.spv.h"
#include "atlas/shaders/blocks_scan.comp.spv.h"

namespace tessera::atlas::blocks {
namespace {

// Also in atlas/shaders/blocks.glsl.
constexpr uint32_t kGroupSize = 256;
constexpr uint32_t kLevels = level_index({8, 8}) + 1, kKeys = 2 * kLevels;
constexpr uint32_t kWidths = 9;
constexpr uint32_t kNoPackedBlock = 0xffffffffu;

constexpr uint64_t kMaxTexels = 8192ull * 8192;
constexpr uint32_t kMaxRequests = 1u << 22;  // their lines, counted in 31 bits, are at most 256 each

enum AllocatorBinding : uint32_t {
  kRequests,
  kBlocks,
  kSlots,
  kGroupCounts,
  kState,
  kStacks,
  kFreeSuperblocks,
  kSuperblocks,
  kBindings
};

struct LevelRecord {
  uint32_t stack_start;
  int32_t stack_size, requested, slot_offset, slot_count, stack_top;
};
struct ColumnRecord {
  int32_t carry_offset;
  uint32_t carried, first, free_count;
};
struct StateRecord {
  std::array<LevelRecord, kLevels> levels;
  std::array<ColumnRecord, kWidths> columns;
  uint32_t free_superblocks, recycled;
};
struct SuperblockRecord {
  uint32_t used_texels, in_use;
};

struct Push {
  uint32_t requests, groups, superblock_log, superblocks;
};

constexpr uint32_t groups_for(uint32_t requests) {
  return (requests + kGroupSize - 1) / kGroupSize;
}

uint8_t packed_level(Level level) {
  return static_cast<uint8_t>(level.log_w | level.log_h << 4);
}

// visit(level)
template <typename Visit>
void for_each_level(uint8_t superblock_log, Visit visit) {
  for (uint8_t log_w = kMinLog; log_w <= superblock_log; ++log_w) {
    for (uint8_t log_h = kMinLog; log_h <= log_w; ++log_h) visit(Level{log_w, log_h});
  }
}

// An empty atlas: every stack has room for all blocks of its level.
StateRecord initial_state(uint8_t superblock_log, uint32_t superblocks, uint64_t& stack_entries) {
  StateRecord state{.free_superblocks = superblocks};
  stack_entries = 0;
  for_each_level(superblock_log, [&](Level level) {
    state.levels[level_index(level)].stack_start = static_cast<uint32_t>(stack_entries);
    stack_entries += (uint64_t{superblocks} << (2 * superblock_log)) >> (level.log_w + level.log_h);
  });
  for (uint8_t log_w = kMinLog; log_w <= superblock_log; ++log_w) {
    state.columns[log_w].carry_offset = 1 << (2 * (superblock_log - log_w));
  }
  return state;
}

template <typename Record>
StatusOr<gpu::Buffer> filled(gpu::Device& device, const std::vector<Record>& records, std::string_view name) {
  return gpu::Buffer::create_filled(device, std::as_bytes(std::span(records)), name);
}

Status check(uint8_t superblock_log, uint32_t superblocks, uint32_t max_requests) {
  if (superblock_log < kMinLog || superblock_log > 8) {
    return absl::InvalidArgumentError(
        absl::StrCat("block allocator: superblock_log is ", superblock_log, ", must be 1 to 8"));
  }
  if (superblocks == 0 || superblocks > kMaxTexels >> (2 * superblock_log)) {
    return absl::InvalidArgumentError(absl::StrCat("block allocator: ", superblocks,
                                                   " superblocks, must be 1 to what 8192x8192 texels hold"));
  }
  if (max_requests == 0 || max_requests > kMaxRequests) {
    return absl::InvalidArgumentError(
        absl::StrCat("block allocator: max_requests is ", max_requests, ", must be 1 to ", kMaxRequests));
  }
  return absl::OkStatus();
}

}  // namespace

GpuRequest to_gpu(const Request& request, uint8_t superblock_log) {
  GpuRequest out;
  if (request.frees) {
    out.old_block = request.old_block.superblock << (2 * superblock_log - 2) | request.old_block.index;
    out.levels = packed_level(request.old_level);
  }
  if (request.allocates) out.levels |= uint32_t{packed_level(request.level)} << 8;
  return out;
}

struct GpuAllocator::Impl {
  Impl(gpu::Device& d, uint8_t log, uint32_t count, uint32_t requests)
      : device(&d), superblock_log(log), superblocks(count), max_requests(requests) {}

  Status create_buffers();
  Status create_pipelines();
  void dispatch(gpu::Commands& commands, const gpu::ComputePipeline& pipeline, uint32_t requests,
                uint32_t groups) const;

  gpu::Device* device;
  uint8_t superblock_log;
  uint32_t superblocks, max_requests;
  std::array<gpu::Buffer, kBindings> buffers;
  gpu::Buffer empty_state, all_superblocks;  // what a reset copies
  gpu::BindLayout layout;
  gpu::BindGroup group;
  gpu::ComputePipeline count, scan, request, provision, assign;
  gpu::ComputePipeline find_empty, recycle_stacks, recycle_superblocks;
};

Status GpuAllocator::Impl::create_buffers() {
  uint64_t stack_entries = 0;
  const StateRecord empty = initial_state(superblock_log, superblocks, stack_entries);
  const uint64_t limit = device->info().max_storage_buffer_range;
  if (stack_entries * sizeof(uint32_t) > limit) {
    return absl::InvalidArgumentError(absl::StrCat("block allocator: the stacks of ", superblocks,
                                                   " superblocks need ", stack_entries * sizeof(uint32_t),
                                                   " bytes, and a storage buffer of this device holds ",
                                                   limit, ": choose a smaller atlas"));
  }
  const auto make = [&](AllocatorBinding binding, uint64_t bytes, std::string_view name) -> Status {
    TESSERA_ASSIGN_OR_RETURN(buffers[binding],
                             gpu::Buffer::create(*device, bytes, gpu::Memory::device, name));
    return absl::OkStatus();
  };
  const uint64_t requests = max_requests;
  TESSERA_RETURN_IF_ERROR(make(kRequests, requests * sizeof(GpuRequest), "block requests"));
  TESSERA_RETURN_IF_ERROR(make(kBlocks, requests * sizeof(uint32_t), "assigned blocks"));
  TESSERA_RETURN_IF_ERROR(make(kSlots, requests * sizeof(int32_t), "block slots"));
  TESSERA_RETURN_IF_ERROR(make(kGroupCounts, uint64_t{kKeys} * groups_for(max_requests) * sizeof(int32_t),
                               "block request counts"));
  TESSERA_RETURN_IF_ERROR(make(kState, sizeof(StateRecord), "block allocator"));
  TESSERA_RETURN_IF_ERROR(make(kStacks, stack_entries * sizeof(uint32_t), "block stacks"));
  TESSERA_RETURN_IF_ERROR(
      make(kFreeSuperblocks, uint64_t{superblocks} * sizeof(uint32_t), "free superblocks"));
  TESSERA_RETURN_IF_ERROR(
      make(kSuperblocks, uint64_t{superblocks} * sizeof(SuperblockRecord), "superblocks"));
  TESSERA_ASSIGN_OR_RETURN(empty_state, filled(*device, std::vector{empty}, "empty block allocator"));
  std::vector<uint32_t> all(superblocks);
  std::iota(all.rbegin(), all.rend(), 0u);
  TESSERA_ASSIGN_OR_RETURN(all_superblocks, filled(*device, all, "all superblocks"));
  return absl::OkStatus();
}

Status GpuAllocator::Impl::create_pipelines() {
  std::vector<gpu::Binding> bindings;
  for (uint32_t b = 0; b < kBindings; ++b) bindings.push_back({b, gpu::BindingKind::storage_buffer});
  TESSERA_ASSIGN_OR_RETURN(layout, gpu::BindLayout::create(*device, bindings));
  TESSERA_ASSIGN_OR_RETURN(group, gpu::BindGroup::create(*device, layout));
  for (uint32_t b = 0; b < kBindings; ++b) group.set(b, buffers[b]);

  const auto make = [&](gpu::ComputePipeline& pipeline, const char* name, gpu::Spirv shader) -> Status {
    TESSERA_ASSIGN_OR_RETURN(
        pipeline,
        gpu::ComputePipeline::create(
            *device, {.name = name, .shader = shader, .layouts = {&layout}, .push_bytes = sizeof(Push)}));
    return absl::OkStatus();
  };
  TESSERA_RETURN_IF_ERROR(make(count, "blocks count", blocks_count_comp));
  TESSERA_RETURN_IF_ERROR(make(scan, "blocks scan", blocks_scan_comp));
  TESSERA_RETURN_IF_ERROR(make(request, "blocks request", blocks_request_comp));
  TESSERA_RETURN_IF_ERROR(make(provision, "blocks provision", blocks_provision_comp));
  TESSERA_RETURN_IF_ERROR(make(assign, "blocks assign", blocks_assign_comp));
  TESSERA_RETURN_IF_ERROR(make(find_empty, "blocks find empty", blocks_find_empty_comp));
  TESSERA_RETURN_IF_ERROR(make(recycle_stacks, "blocks recycle stacks", blocks_recycle_stacks_comp));
  return make(recycle_superblocks, "blocks recycle superblocks", blocks_recycle_superblocks_comp);
}

void GpuAllocator::Impl::dispatch(gpu::Commands& commands, const gpu::ComputePipeline& pipeline,
                                  uint32_t requests, uint32_t groups) const {
  commands.bind(pipeline, {&group});
  commands.push(Push{requests, groups_for(requests), superblock_log, superblocks});
  commands.dispatch(groups);
  commands.barrier();
}

StatusOr<std::unique_ptr<GpuAllocator>> GpuAllocator::create(gpu::Device& device, uint8_t superblock_log,
                                                             uint32_t superblocks, uint32_t max_requests) {
  TESSERA_RETURN_IF_ERROR(check(superblock_log, superblocks, max_requests));
  auto impl = std::make_unique<Impl>(device, superblock_log, superblocks, max_requests);
  TESSERA_RETURN_IF_ERROR(impl->create_buffers());
  TESSERA_RETURN_IF_ERROR(impl->create_pipelines());
  auto allocator = std::unique_ptr<GpuAllocator>(new GpuAllocator(std::move(impl)));
  gpu::Commands commands = device.begin();
  allocator->record_reset(commands);
  TESSERA_RETURN_IF_ERROR(device.run(std::move(commands)));
  return allocator;
}

GpuAllocator::GpuAllocator(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
GpuAllocator::~GpuAllocator() = default;

const gpu::Buffer& GpuAllocator::requests() const {
  return impl_->buffers[kRequests];
}
const gpu::Buffer& GpuAllocator::blocks() const {
  return impl_->buffers[kBlocks];
}

BlockAddress GpuAllocator::block(uint32_t packed) const {
  if (packed == kNoPackedBlock) return Allocator::kNoBlock;
  const int index_bits = 2 * impl_->superblock_log - 2;
  return {packed >> index_bits, packed & ((1u << index_bits) - 1)};
}

void GpuAllocator::record_update(gpu::Commands& commands, uint32_t requests) const {
  assert(requests <= impl_->max_requests);
  if (requests == 0) return;
  const uint32_t groups = groups_for(requests);
  impl_->dispatch(commands, impl_->count, requests, groups);
  impl_->dispatch(commands, impl_->scan, requests, kKeys);
  impl_->dispatch(commands, impl_->request, requests, groups);
  impl_->dispatch(commands, impl_->provision, requests, 1);
  impl_->dispatch(commands, impl_->assign, requests, groups);
}

void GpuAllocator::record_recycle(gpu::Commands& commands) const {
  impl_->dispatch(commands, impl_->find_empty, 0, 1);
  impl_->dispatch(commands, impl_->recycle_stacks, 0, kLevels);
  impl_->dispatch(commands, impl_->recycle_superblocks, 0, 1);
}

void GpuAllocator::record_reset(gpu::Commands& commands) const {
  const auto& buffers = impl_->buffers;
  commands.copy(impl_->empty_state, 0, buffers[kState], 0, impl_->empty_state.size());
  commands.copy(impl_->all_superblocks, 0, buffers[kFreeSuperblocks], 0, impl_->all_superblocks.size());
  commands.fill(buffers[kSuperblocks], 0);
  commands.barrier();
}

StatusOr<AllocatorState> GpuAllocator::read_state() const {
  gpu::Device& device = *impl_->device;
  gpu::Commands commands = device.begin();
  std::array<gpu::Buffer, kBindings> copies;
  for (const uint32_t b : {kState, kStacks, kFreeSuperblocks, kSuperblocks}) {
    const uint64_t bytes = impl_->buffers[b].size();
    TESSERA_ASSIGN_OR_RETURN(copies[b],
                             gpu::Buffer::create(device, bytes, gpu::Memory::readback, "allocator copy"));
    commands.copy(impl_->buffers[b], 0, copies[b], 0, bytes);
  }
  TESSERA_RETURN_IF_ERROR(device.run(std::move(commands)));

  const StateRecord& record = copies[kState].as<StateRecord>().front();
  AllocatorState state;
  const auto free = copies[kFreeSuperblocks].as<uint32_t>().first(record.free_superblocks);
  state.free_superblocks.assign(free.begin(), free.end());
  for (const SuperblockRecord& s : copies[kSuperblocks].as<SuperblockRecord>())
    state.used_texels.push_back(s.used_texels);
  state.stacks.resize(level_index({impl_->superblock_log, impl_->superblock_log}) + 1);
  for_each_level(impl_->superblock_log, [&](Level level) {
    const LevelRecord& stack = record.levels[level_index(level)];
    for (const uint32_t packed :
         copies[kStacks].as<uint32_t>().subspan(stack.stack_start, static_cast<size_t>(stack.stack_size))) {
      state.stacks[level_index(level)].push_back(block(packed));
    }
  });
  for (uint8_t log_w = impl_->superblock_log; log_w >= kMinLog; --log_w) {
    const ColumnRecord& column = record.columns[log_w];
    state.carries.push_back({column.carried, column.carry_offset});
  }
  return state;
}

}  // namespace tessera::atlas::blocks
