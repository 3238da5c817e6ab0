#include "gpu/device.h"

#include <sys/resource.h>
#include <unistd.h>

#include <optional>
#include <thread>

#include "base/log.h"
#include "gpu/impl.h"

namespace tessera::gpu {
namespace {

std::unique_ptr<Recorder> make_recorder(const Core& core) {
  auto recorder = std::make_unique<Recorder>();
  recorder->pool = core.device.createCommandPool({vk::CommandPoolCreateFlagBits::eTransient, core.family});
  auto buffers = core.device.allocateCommandBuffers({*recorder->pool, vk::CommandBufferLevel::ePrimary, 2});
  recorder->setup = std::move(buffers[0]);
  recorder->main = std::move(buffers[1]);
  recorder->queries = core.device.createQueryPool({{}, vk::QueryType::eTimestamp, 2 * kMaxIntervals});
  return recorder;
}

void record_setup(Core& core, const vk::raii::CommandBuffer& cmd) {
  cmd.begin({vk::CommandBufferUsageFlagBits::eOneTimeSubmit});
  std::vector<vk::ImageMemoryBarrier2> images;
  for (const Core::NewImage& image : core.new_images) {
    vk::ImageMemoryBarrier2& barrier = images.emplace_back();
    barrier.dstStageMask = vk::PipelineStageFlagBits2::eAllCommands;
    barrier.dstAccessMask = vk::AccessFlagBits2::eMemoryRead | vk::AccessFlagBits2::eMemoryWrite;
    barrier.oldLayout = vk::ImageLayout::eUndefined;
    barrier.newLayout = vk::ImageLayout::eGeneral;
    barrier.image = image.image;
    barrier.subresourceRange = {image.aspect, 0, VK_REMAINING_MIP_LEVELS, 0, VK_REMAINING_ARRAY_LAYERS};
  }
  if (!images.empty()) cmd.pipelineBarrier2(vk::DependencyInfo().setImageMemoryBarriers(images));
  for (const vk::Buffer buffer : core.new_buffers) cmd.fillBuffer(buffer, 0, VK_WHOLE_SIZE, 0);
  if (!core.new_buffers.empty()) full_barrier(cmd);
  cmd.end();
}

// Where the device is software, its workers start here, one for each core; they inherit this thread's
// priority, so that whoever feeds the device and the network goes before them. A driver's own threads are no
// worse off.
template <class F>
auto on_background_thread(F&& work) {
  constexpr int kNice = 5;
  std::optional<decltype(work())> result;
  std::thread([&] {
    // A refusal changes nothing but waiting times. Linux: of this thread alone.
    (void)setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), kNice);
    result.emplace(work());
  }).join();
  return *std::move(result);
}

}  // namespace

DeviceImpl::DeviceImpl(std::shared_ptr<Core> core, DurationNs slow_ns)
    : core_(std::move(core)), slow_ns_(slow_ns) {
  const vk::SemaphoreTypeCreateInfo type(vk::SemaphoreType::eTimeline, 0);
  timeline_ = core_->device.createSemaphore(vk::SemaphoreCreateInfo({}, &type));
}

DeviceImpl::~DeviceImpl() {
  // A lost device has nothing left to wait for.
  const Status done = guarded([&] {
    core_->device.waitIdle();
    return absl::OkStatus();
  });
  done.IgnoreError();
}

std::unique_ptr<Recorder> DeviceImpl::take_recorder() {
  if (idle_.empty()) return make_recorder(*core_);
  std::unique_ptr<Recorder> recorder = std::move(idle_.back());
  idle_.pop_back();
  recorder->pool.reset();
  recorder->intervals.clear();
  return recorder;
}

Commands DeviceImpl::begin() {
  auto commands = std::make_unique<Commands::Impl>();
  commands->core = core_;
  commands->fail(guarded([&] {
    commands->recorder = take_recorder();
    commands->recorder->queries.reset(0, 2 * kMaxIntervals);
    commands->cmd().begin({vk::CommandBufferUsageFlagBits::eOneTimeSubmit});
    return absl::OkStatus();
  }));
  return Commands(std::move(commands));
}

StatusOr<Ticket> DeviceImpl::submit(Commands commands) {
  Commands::Impl& recorded = commands.impl();
  if (recorded.rendering) recorded.fail(absl::FailedPreconditionError("submit: end_rendering is missing"));
  if (recorded.in_interval) recorded.fail(absl::FailedPreconditionError("submit: end_interval is missing"));
  TESSERA_RETURN_IF_ERROR(recorded.status);
  return guarded([&]() -> StatusOr<Ticket> {
    std::unique_ptr<Recorder> recorder = std::move(recorded.recorder);
    full_barrier(recorder->main);
    recorder->main.end();
    std::vector<vk::CommandBufferSubmitInfo> buffers;
    if (!core_->new_images.empty() || !core_->new_buffers.empty()) {
      record_setup(*core_, recorder->setup);
      buffers.emplace_back(*recorder->setup);
    }
    buffers.emplace_back(*recorder->main);
    const vk::SemaphoreSubmitInfo reached(*timeline_, last_ + 1, vk::PipelineStageFlagBits2::eAllCommands);
    core_->queue.submit2(vk::SubmitInfo2({}, {}, buffers, reached));
    core_->new_images.clear();
    core_->new_buffers.clear();
    recorder->ticket = ++last_;
    in_flight_.push_back(std::move(recorder));
    return last_;
  });
}

Status DeviceImpl::wait(Ticket ticket) {
  if (ticket > last_) {
    return absl::InvalidArgumentError(
        absl::StrCat("wait: ticket ", ticket, " was never submitted; the newest is ", last_));
  }
  return guarded([&]() -> Status {
    wait_until_done(ticket);
    while (!in_flight_.empty() && in_flight_.front()->ticket <= ticket) {
      if (in_flight_.front()->ticket == ticket) read_intervals(*in_flight_.front());
      idle_.push_back(std::move(in_flight_.front()));
      in_flight_.pop_front();
    }
    return absl::OkStatus();
  });
}

void DeviceImpl::wait_until_done(Ticket ticket) {
  const vk::SemaphoreWaitInfo info({}, *timeline_, ticket);
  DurationNs lasted = 0, patience = slow_ns_;
  while (core_->device.waitSemaphores(info, static_cast<uint64_t>(patience)) == vk::Result::eTimeout) {
    lasted += patience;
    patience = lasted;
    spdlog::warn("gpu: {} works for {:.3g} s already on one submission", core_->info.name,
                 to_seconds(lasted));
  }
}

void DeviceImpl::read_intervals(const Recorder& recorder) {
  intervals_.clear();
  const auto count = static_cast<uint32_t>(recorder.intervals.size());
  if (count == 0) return;
  const auto [result, ticks] =
      recorder.queries.getResults<uint64_t>(0, 2 * count, 2 * count * sizeof(uint64_t), sizeof(uint64_t),
                                            vk::QueryResultFlagBits::e64 | vk::QueryResultFlagBits::eWait);
  for (uint32_t i = 0; i < count; ++i) {
    const auto elapsed = static_cast<double>((ticks[2 * i + 1] - ticks[2 * i]) & core_->timestamp_mask);
    intervals_.push_back({recorder.intervals[i], elapsed * core_->limits.timestampPeriod * 1e-6});
  }
}

void full_barrier(const vk::raii::CommandBuffer& cmd) {
  const vk::MemoryBarrier2 barrier(
      vk::PipelineStageFlagBits2::eAllCommands, vk::AccessFlagBits2::eMemoryWrite,
      vk::PipelineStageFlagBits2::eAllCommands | vk::PipelineStageFlagBits2::eHost,
      vk::AccessFlagBits2::eMemoryRead | vk::AccessFlagBits2::eMemoryWrite | vk::AccessFlagBits2::eHostRead);
  cmd.pipelineBarrier2(vk::DependencyInfo().setMemoryBarriers(barrier));
}

StatusOr<std::shared_ptr<Device>> Device::create(const DeviceOptions& options) {
  TESSERA_ASSIGN_OR_RETURN(std::shared_ptr<Core> core,
                           on_background_thread([&] { return Core::create(options); }));
  return guarded([&]() -> StatusOr<std::shared_ptr<Device>> {
    return std::shared_ptr<Device>(
        new Device(std::make_unique<DeviceImpl>(std::move(core), options.slow_ns)));
  });
}

Device::Device(std::unique_ptr<DeviceImpl> impl) : impl_(std::move(impl)) {}
Device::~Device() = default;

const DeviceInfo& Device::info() const {
  return impl_->core()->info;
}
Commands Device::begin() {
  return impl_->begin();
}
StatusOr<Ticket> Device::submit(Commands commands) {
  return impl_->submit(std::move(commands));
}
Status Device::wait(Ticket ticket) {
  return impl_->wait(ticket);
}

Status Device::run(Commands commands) {
  TESSERA_ASSIGN_OR_RETURN(const Ticket ticket, submit(std::move(commands)));
  return wait(ticket);
}

std::vector<Device::Interval> Device::intervals() const {
  return impl_->intervals();
}
uint64_t Device::memory_in_use() const {
  return impl_->core()->allocator->in_use();
}
uint64_t Device::memory_peak() const {
  return impl_->core()->allocator->peak();
}
uint32_t Device::validation_messages() const {
  return impl_->core()->instance->messages;
}
uint64_t Device::dispatches_recorded() const {
  return impl_->core()->dispatches;
}
uint64_t Device::draws_recorded() const {
  return impl_->core()->draws;
}

}  // namespace tessera::gpu
