// Private to gpu/: what stands behind the pointers of the public headers.
#pragma once

#include <deque>

#include "gpu/commands.h"
#include "gpu/core.h"

namespace tessera::gpu {

// Each Impl holds the Core first, so that it goes last.
struct Buffer::Impl {
  std::shared_ptr<Core> core;
  Allocation memory;
  vk::raii::Buffer buffer = nullptr;
  std::string name;
  ~Impl();
};

struct Image::Impl {
  std::shared_ptr<Core> core;
  Allocation memory;
  vk::raii::Image image = nullptr;
  vk::raii::ImageView attachment = nullptr;  // mip 0 of layer 0
  vk::raii::ImageView sampled = nullptr;     // everything
  std::vector<vk::raii::ImageView> storage;  // one a mip level; empty unless ImageDesc::storage
  vk::ImageAspectFlags aspect;
  std::string name;
  ~Impl();
};

struct Sampler::Impl {
  std::shared_ptr<Core> core;
  vk::raii::Sampler sampler = nullptr;
};

struct BindLayout::Impl {
  std::shared_ptr<Core> core;
  vk::raii::DescriptorSetLayout layout = nullptr;
  std::vector<Binding> bindings;
};

struct BindGroup::Impl {
  std::shared_ptr<Core> core;
  vk::raii::DescriptorPool pool = nullptr;
  vk::DescriptorSet set;
  struct Slot {
    Binding binding;
    std::vector<bool> written;
  };
  std::vector<Slot> slots;
  Status misuse;  // the first wrong set(); reported when the group is bound

  Status usable() const;
};

struct PipelineObjects {
  std::shared_ptr<Core> core;
  vk::raii::PipelineLayout layout = nullptr;
  vk::raii::Pipeline pipeline = nullptr;
  uint32_t push_bytes = 0;
  uint32_t sets = 0;
  std::string name;
};

struct ComputePipeline::Impl : PipelineObjects {};

struct RasterPipeline::Impl : PipelineObjects {
  Cull cull = Cull::none;
};

struct TessellationPipeline::Impl : PipelineObjects {};

constexpr uint32_t kMaxIntervals = 128;  // a submission

// The command buffers and queries of one submission; used again once it is done.
struct Recorder {
  vk::raii::CommandPool pool = nullptr;
  vk::raii::CommandBuffer setup = nullptr;  // runs first: new images and buffers
  vk::raii::CommandBuffer main = nullptr;
  vk::raii::QueryPool queries = nullptr;
  std::vector<std::string> intervals;
  Ticket ticket = 0;
};

struct Commands::Impl {
  std::shared_ptr<Core> core;
  std::unique_ptr<Recorder> recorder;
  // The first mistake; the rest of the recording is ignored and submit() returns it.
  Status status;
  const PipelineObjects* pipeline = nullptr;  // the last one bound, and its kind
  vk::PipelineBindPoint bind_point = vk::PipelineBindPoint::eCompute;
  bool rendering = false;
  bool in_interval = false;

  const vk::raii::CommandBuffer& cmd() const { return recorder->main; }
  bool ok() const { return status.ok(); }
  void fail(Status mistake) { status.Update(std::move(mistake)); }
};

class DeviceImpl {
 public:
  DeviceImpl(std::shared_ptr<Core> core, DurationNs slow_ns);
  ~DeviceImpl();

  const std::shared_ptr<Core>& core() const { return core_; }
  Commands begin();
  StatusOr<Ticket> submit(Commands commands);
  Status wait(Ticket ticket);
  const std::vector<Device::Interval>& intervals() const { return intervals_; }

 private:
  std::unique_ptr<Recorder> take_recorder();
  void wait_until_done(Ticket ticket);
  void read_intervals(const Recorder& recorder);

  std::shared_ptr<Core> core_;
  const DurationNs slow_ns_;
  vk::raii::Semaphore timeline_ = nullptr;
  Ticket last_ = 0;
  std::deque<std::unique_ptr<Recorder>> in_flight_;  // by ticket
  std::vector<std::unique_ptr<Recorder>> idle_;
  Ticket intervals_of_ = 0;
  std::vector<Device::Interval> intervals_;
};

// Everything before is finished and visible to everything after, the CPU included.
void full_barrier(const vk::raii::CommandBuffer& cmd);
vk::Format vulkan_format(Format format);

}  // namespace tessera::gpu
