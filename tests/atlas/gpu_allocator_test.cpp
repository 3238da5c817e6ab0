#include "atlas/blocks/gpu_allocator.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "random_level.h"

namespace tessera::atlas::blocks {
namespace {

using testing::HasSubstr;

// Both allocators, fed the same requests; after every step they must agree in all that they know.
class Twins {
 public:
  Twins(gpu::Device& device, uint8_t superblock_log, uint32_t superblocks, uint32_t max_requests)
      : device_(device), superblock_log_(superblock_log), cpu_(superblock_log, superblocks) {
    auto gpu = GpuAllocator::create(device, superblock_log, superblocks, max_requests);
    EXPECT_TRUE(gpu.ok()) << gpu.status();
    gpu_ = std::move(*gpu);
    upload_ = buffer(max_requests * sizeof(GpuRequest), gpu::Memory::upload);
    readback_ = buffer(max_requests * sizeof(uint32_t), gpu::Memory::readback);
  }

  // Gives the requests' blocks.
  std::vector<BlockAddress> update(const std::vector<Request>& requests) {
    std::vector<BlockAddress> expected(requests.size());
    cpu_.update(requests, expected);
    const auto records = upload_.as<GpuRequest>();
    for (size_t i = 0; i < requests.size(); ++i) records[i] = to_gpu(requests[i], superblock_log_);
    gpu::Commands commands = device_.begin();
    commands.copy(upload_, 0, gpu_->requests(), 0, upload_.size());
    commands.barrier();
    gpu_->record_update(commands, static_cast<uint32_t>(requests.size()));
    commands.copy(gpu_->blocks(), 0, readback_, 0, readback_.size());
    run(std::move(commands));
    const auto blocks = readback_.as<uint32_t>();
    for (size_t i = 0; i < requests.size(); ++i)
      EXPECT_EQ(gpu_->block(blocks[i]), expected[i]) << "request " << i;
    return expected;
  }

  uint32_t recycle() {
    gpu::Commands commands = device_.begin();
    gpu_->record_recycle(commands);
    run(std::move(commands));
    return cpu_.recycle();
  }

  void reset() {
    gpu::Commands commands = device_.begin();
    gpu_->record_reset(commands);
    run(std::move(commands));
    cpu_.reset();
  }

  void check() const {
    const auto state = gpu_->read_state();
    ASSERT_TRUE(state.ok()) << state.status();
    const AllocatorState expected = cpu_.state();
    EXPECT_EQ(state->free_superblocks, expected.free_superblocks);
    EXPECT_EQ(state->used_texels, expected.used_texels);
    EXPECT_TRUE(state->stacks == expected.stacks);
    EXPECT_TRUE(state->carries == expected.carries);
  }

  AllocatorStats stats() const { return cpu_.stats(); }

 private:
  gpu::Buffer buffer(uint64_t bytes, gpu::Memory memory) {
    auto made = gpu::Buffer::create(device_, bytes, memory, "test");
    EXPECT_TRUE(made.ok()) << made.status();
    return std::move(*made);
  }
  void run(gpu::Commands commands) {
    const Status status = device_.run(std::move(commands));
    ASSERT_TRUE(status.ok()) << status;
  }

  gpu::Device& device_;
  uint8_t superblock_log_;
  Allocator cpu_;
  std::unique_ptr<GpuAllocator> gpu_;
  gpu::Buffer upload_, readback_;
};

class GpuAllocatorTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    auto device =
        gpu::Device::create({.select = "cpu", .validation = true, .validate_synchronization = true});
    ASSERT_TRUE(device.ok()) << device.status();
    device_ = *device;
  }
  static void TearDownTestSuite() { device_.reset(); }
  void TearDown() override {
    EXPECT_EQ(device_->validation_messages(), 0u);
    EXPECT_EQ(device_->memory_in_use(), 0u);
  }

  Twins twins(uint8_t superblock_log, uint32_t superblocks, uint32_t max_requests) {
    return {*device_, superblock_log, superblocks, max_requests};
  }

  static inline std::shared_ptr<gpu::Device> device_;
};

// Patches that come, go and change their level: one request each, in the order of the patches.
class Crowd {
 public:
  Crowd(uint32_t seed, uint8_t max_log, size_t patches) : random_(seed), max_log_(max_log), owned_(patches) {}

  // Patches that ask for nothing have an empty request if `all`, none otherwise.
  std::vector<Request> next(uint32_t churn_percent, uint32_t load_percent, bool all) {
    std::vector<Request> requests;
    asking_.clear();
    for (size_t i = 0; i < owned_.size(); ++i) {
      const bool changes = random_() % 100 < churn_percent;
      if (!changes && !all) continue;
      Request r;
      if (changes) {
        r = {.frees = owned_[i].block != Allocator::kNoBlock,
             .old_level = owned_[i].level,
             .old_block = owned_[i].block,
             .allocates = random_() % 100 < load_percent,
             .level = random_level(random_, max_log_)};
        owned_[i].block = Allocator::kNoBlock;
        owned_[i].level = r.level;
      }
      requests.push_back(r);
      asking_.push_back(i);
    }
    return requests;
  }

  // How many that asked for a block got none.
  uint32_t take(const std::vector<Request>& requests, const std::vector<BlockAddress>& blocks) {
    uint32_t failed = 0;
    for (size_t i = 0; i < requests.size(); ++i) {
      if (!requests[i].allocates) continue;
      owned_[asking_[i]].block = blocks[i];
      failed += blocks[i] == Allocator::kNoBlock;
    }
    return failed;
  }

  void forget() { std::fill(owned_.begin(), owned_.end(), Owned{}); }

 private:
  struct Owned {
    Level level;
    BlockAddress block = Allocator::kNoBlock;
  };
  std::mt19937 random_;
  uint8_t max_log_;
  std::vector<Owned> owned_;
  std::vector<size_t> asking_;
};

// Superblocks that hold about `blocks` random ones.
uint32_t superblocks_for(uint8_t log, uint32_t blocks) {
  std::mt19937 random(1);
  uint64_t texels = 0;
  for (uint32_t i = 0; i < blocks; ++i) {
    const Level level = random_level(random, log);
    texels += 1u << (level.log_w + level.log_h);
  }
  return static_cast<uint32_t>(texels >> (2 * log)) + log - 1;
}

TEST_F(GpuAllocatorTest, ThousandsOfRandomFramesEqualTheCpu) {
  for (uint8_t log = 1; log <= 8; ++log) {
    const uint32_t patches = 700, superblocks = superblocks_for(log, patches / 2);
    Twins both = twins(log, superblocks, patches);
    Crowd crowd(log, log, patches);
    uint32_t failed = 0, recycled = 0, exact = 0;
    for (int frame = 0; frame < 300; ++frame) {
      const uint32_t load_percent = frame / 15 % 4 * 30;
      const std::vector<Request> requests = crowd.next(1 + frame % 60, load_percent, frame % 2 == 0);
      failed += crowd.take(requests, both.update(requests));
      if (frame % 3 == 0) recycled += both.recycle();
      exact += both.stats().used_texels == both.stats().capacity_texels;
      if (frame % 97 == 96) {
        both.reset();
        crowd.forget();
      }
      if (frame % 10 == 9) both.check();
      ASSERT_FALSE(HasFailure()) << "superblocks of 2^" << int{log} << ", frame " << frame;
    }
    EXPECT_GT(failed, 0u) << "this run should also meet exhausted memory";
    EXPECT_GT(recycled, 0u);
    EXPECT_TRUE(exact > 0 || log > 1) << "and an atlas that is full to the last texel";
  }
}

// Ranks and prefix sums go over many workgroups, and over stretches of several for a lane.
TEST_F(GpuAllocatorTest, ManyRequestsEqualTheCpu) {
  constexpr uint32_t kPatches = 150'001;
  Twins both = twins(7, 256, kPatches);
  Crowd crowd(3, 4, kPatches);
  for (int frame = 0; frame < 6; ++frame) {
    const std::vector<Request> requests = crowd.next(frame == 0 ? 100 : 20, frame == 4 ? 5 : 60, true);
    crowd.take(requests, both.update(requests));
    if (frame >= 3) both.recycle();
    both.check();
    ASSERT_FALSE(HasFailure()) << "frame " << frame;
  }
}

TEST_F(GpuAllocatorTest, ExhaustedAndHealed) {
  Twins both = twins(5, 2, 100);
  std::vector<Request> requests(100, {.allocates = true, .level = {3, 2}});
  const std::vector<BlockAddress> blocks = both.update(requests);
  EXPECT_EQ(std::ranges::count(blocks, Allocator::kNoBlock), 100 - 64);
  both.check();
  for (size_t i = 0; i < requests.size(); ++i) {
    requests[i] = i < 36   ? Request{.frees = true, .old_level = {3, 2}, .old_block = blocks[i]}
                  : i < 64 ? Request{}
                           : Request{.allocates = true, .level = {3, 2}};
  }
  const std::vector<BlockAddress> healed = both.update(requests);
  EXPECT_EQ(std::ranges::count(healed.begin() + 64, healed.end(), Allocator::kNoBlock), 0);
  both.check();
}

TEST_F(GpuAllocatorTest, AnUpdateWithoutRequestsChangesNothing) {
  Twins both = twins(4, 3, 8);
  both.update({{.allocates = true, .level = {2, 1}}});
  both.update({});
  both.update(std::vector<Request>(8));
  both.check();
}

TEST_F(GpuAllocatorTest, RejectsWhatItCannotHold) {
  for (const auto& [log, superblocks, requests, what] :
       {std::tuple<uint8_t, uint32_t, uint32_t, const char*>{0, 1, 1, "superblock_log"},
        {9, 1, 1, "superblock_log"},
        {8, 0, 1, "superblocks"},
        {8, 1025, 1, "superblocks"},
        {8, 1, 0, "max_requests"},
        {8, 1, 5'000'000, "max_requests"}}) {
    const auto made = GpuAllocator::create(*device_, log, superblocks, requests);
    EXPECT_EQ(made.status().code(), absl::StatusCode::kInvalidArgument);
    EXPECT_THAT(made.status().message(), HasSubstr(what));
  }
}

}  // namespace
}  // namespace tessera::atlas::blocks
