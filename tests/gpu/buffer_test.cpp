#include "gpu/buffer.h"

#include <algorithm>
#include <numeric>
#include <random>

#include "gpu_test.h"

namespace tessera::gpu {
namespace {

using BufferTest = GpuTest;

std::vector<uint32_t> read_words(Device& device, const Buffer& from) {
  const Buffer to = value(Buffer::create(device, from.size(), Memory::readback, "read"));
  Commands commands = device.begin();
  commands.copy(from, 0, to, 0, from.size());
  const Status done = device.run(std::move(commands));
  EXPECT_TRUE(done.ok()) << done;
  const auto words = to.as<uint32_t>();
  return {words.begin(), words.end()};
}

TEST_F(BufferTest, StartsAsZerosEvenInMemoryThatWasUsedBefore) {
  for (const Memory memory : {Memory::device, Memory::upload, Memory::readback}) {
    for (int round = 0; round < 2; ++round) {
      const Buffer target = buffer(4096, memory);
      EXPECT_THAT(read_words(device(), target), testing::Each(0u));
      Commands commands = device().begin();
      commands.fill(target, 0xffffffffu);
      run(std::move(commands));
    }
  }
}

TEST_F(BufferTest, CopiesARangeAndNothingElse) {
  std::vector<uint32_t> numbers(1000);
  std::iota(numbers.begin(), numbers.end(), 1);
  const Buffer from = filled(numbers);
  const Buffer to = buffer(4000);
  Commands commands = device().begin();
  commands.copy(from, 400, to, 800, 40);
  run(std::move(commands));
  const auto words = read_words(device(), to);
  for (uint32_t i = 0; i < 1000; ++i) EXPECT_EQ(words[i], i >= 200 && i < 210 ? i - 100 + 1 : 0) << i;
}

TEST_F(BufferTest, FillsARange) {
  const Buffer target = buffer(64);
  Commands commands = device().begin();
  commands.fill(target, 5, 16, 8);
  run(std::move(commands));
  const auto words = read_words(device(), target);
  for (uint32_t i = 0; i < 16; ++i) EXPECT_EQ(words[i], i == 4 || i == 5 ? 5u : 0u) << i;
}

TEST_F(BufferTest, EmptyBufferIsValid) {
  const Buffer empty = filled(std::vector<uint32_t>{});
  EXPECT_EQ(empty.size(), 0u);
  EXPECT_TRUE(empty.as<uint32_t>().empty());
}

TEST_F(BufferTest, SoftwareDevicesMapDeviceMemory) {
  EXPECT_NE(buffer(16).mapped(), nullptr);
}

TEST_F(BufferTest, ImpossibleSizeIsAStatusThatNamesTheBuffer) {
  const auto huge = Buffer::create(device(), 1ull << 46, Memory::device, "monster");
  ASSERT_FALSE(huge.ok());
  EXPECT_THAT(std::string(huge.status().message()), testing::HasSubstr("monster"));
}

TEST_F(BufferTest, AccountsForEveryByteInAnyOrderOfDestruction) {
  std::mt19937 random(1);
  std::vector<Buffer> buffers;
  uint64_t asked = 0;
  for (int i = 0; i < 300; ++i) {
    const uint64_t bytes = random() % (1 << 16) + 1;
    buffers.push_back(buffer(bytes));
    std::fill(buffers.back().as<uint8_t>().begin(), buffers.back().as<uint8_t>().end(), uint8_t(i));
    asked += bytes;
    if (i % 3 == 2) {
      const size_t victim = random() % buffers.size();
      asked -= buffers[victim].size();
      buffers.erase(buffers.begin() + static_cast<ptrdiff_t>(victim));
    }
    ASSERT_GE(device().memory_in_use(), asked);
  }
  // Ranges that overlap would have overwritten each other.
  for (const Buffer& b : buffers) {
    const auto bytes = b.as<uint8_t>();
    EXPECT_EQ(std::count(bytes.begin(), bytes.end(), bytes[0]), static_cast<ptrdiff_t>(bytes.size()));
  }
  EXPECT_GE(device().memory_peak(), device().memory_in_use());
  std::shuffle(buffers.begin(), buffers.end(), random);
  while (!buffers.empty()) buffers.pop_back();
  EXPECT_EQ(device().memory_in_use(), 0u);
}

}  // namespace
}  // namespace tessera::gpu
