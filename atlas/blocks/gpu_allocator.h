// The block allocator as compute passes (thesis 3.4), with the results of Allocator (strategy reference) bit
// for bit: threads number requests by prefix sums where the thesis uses atomic counters, so that a block
// never depends on their order. For callers whose requests and blocks stay on the device; the layout, whose
// patches and placements are the CPU's, uses Allocator.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "atlas/blocks/allocator.h"
#include "base/status.h"
#include "gpu/commands.h"
#include "gpu/device.h"

namespace tessera::atlas::blocks {

// A Request as the device reads it. A level is log_w | log_h << 4, 0 = none.
struct GpuRequest {
  uint32_t old_block = 0xffffffffu;
  uint32_t levels = 0;  // the freed one | the allocated one << 8
};
GpuRequest to_gpu(const Request& request, uint8_t superblock_log);

// Not thread-safe. Recorded work must be done before it is destroyed.
class GpuAllocator {
 public:
  // As Allocator's constructor. `max_requests`: of an update, 1 to 4 million. InvalidArgument for other
  // values, for an atlas of more than 8192x8192 texels, or if a stack of all blocks does not fit a storage
  // buffer.
  static StatusOr<std::unique_ptr<GpuAllocator>> create(gpu::Device& device, uint8_t superblock_log,
                                                        uint32_t superblocks, uint32_t max_requests);
  ~GpuAllocator();

  // Device memory, max_requests elements each. GpuRequest[]: what the next update reads.
  const gpu::Buffer& requests() const;
  // uint32[]: what an update wrote; see block().
  const gpu::Buffer& blocks() const;
  BlockAddress block(uint32_t packed) const;  // of an element of blocks()

  // Allocator::update, recycle and reset. The first `count` requests; those that neither free nor allocate
  // are allowed, so that every patch may have one. Each leaves a barrier behind itself.
  void record_update(gpu::Commands& commands, uint32_t count) const;
  void record_recycle(gpu::Commands& commands) const;
  void record_reset(gpu::Commands& commands) const;

  // Copies everything to the CPU and waits for it: for tests and diagnosis.
  StatusOr<AllocatorState> read_state() const;

 private:
  struct Impl;
  explicit GpuAllocator(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera::atlas::blocks
