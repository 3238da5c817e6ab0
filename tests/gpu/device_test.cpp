#include "gpu/device.h"

#include <gtest/gtest-spi.h>

#include <algorithm>

#include "gpu_test.h"

namespace tessera::gpu {
namespace {

using testing::Each;
using testing::ElementsAre;
using testing::HasSubstr;

TEST(ListDevices, NamesEveryDeviceAndItsKind) {
  const auto devices = value(list_devices());
  ASSERT_FALSE(devices.empty());
  for (const DeviceInfo& info : devices) {
    EXPECT_FALSE(info.name.empty());
    EXPECT_FALSE(info.driver.empty());
    EXPECT_GT(info.max_storage_buffer_range, 0u);
  }
}

TEST(SelectDevice, UnknownNameIsAnErrorThatListsTheDevices) {
  const auto device = Device::create({.select = "no such device", .validation = false});
  EXPECT_EQ(device.status().code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(device.status().message()), HasSubstr("no such device"));
  EXPECT_THAT(std::string(device.status().message()), HasSubstr(value(list_devices())[0].name));
}

TEST(SelectDevice, NumberBeyondTheListIsAnError) {
  const auto count = value(list_devices()).size();
  const auto device = Device::create({.select = std::to_string(count), .validation = false});
  EXPECT_EQ(device.status().code(), absl::StatusCode::kNotFound);
}

TEST(SelectDevice, ByKindByNumberAndByPartOfTheNameInAnyCase) {
  const auto software = value(Device::create({.select = "cpu", .validation = false}));
  EXPECT_TRUE(software->info().software);

  const auto devices = value(list_devices());
  const auto first = value(Device::create({.select = "0", .validation = false}));
  EXPECT_EQ(first->info().name, devices[0].name);

  std::string part = software->info().name.substr(0, 4);
  for (char& c : part) c = static_cast<char>(std::toupper(c));
  const auto named = value(Device::create({.select = part, .validation = false}));
  EXPECT_EQ(named->info().name, software->info().name);
}

TEST(DeviceLifetime, ResourcesMayOutliveTheirDevice) {
  auto device = value(Device::create({.select = "cpu", .validation = true}));
  Buffer buffer = value(Buffer::create(*device, 64, Memory::upload, "survivor"));
  device.reset();
  buffer.as<uint32_t>()[0] = 7;
  EXPECT_EQ(buffer.as<uint32_t>()[0], 7u);
}

// Failures of `body`, which then are none of the running test.
template <class Body>
std::vector<std::string> failures_of(Body&& body) {
  testing::TestPartResultArray results;
  {
    const testing::ScopedFakeTestPartResultReporter intercept(
        testing::ScopedFakeTestPartResultReporter::INTERCEPT_ALL_THREADS, &results);
    body();
  }
  std::vector<std::string> messages;
  for (int i = 0; i < results.size(); ++i) messages.push_back(results.GetTestPartResult(i).message());
  return messages;
}

TEST(Validation, AFaultIsCountedAndFailsTheTest) {
  const auto device = value(Device::create({.select = "cpu", .validation = true}));
  const Image small =
      value(Image::create(*device, {.width = 4, .height = 4, .format = Format::r32_uint}, "small"));
  EXPECT_EQ(device->validation_messages(), 0u);
  const ColorAttachment color{.image = &small};
  Commands never_submitted = device->begin();
  const std::vector<std::string> failures = failures_of([&] {
    never_submitted.begin_rendering({.colors = {&color, 1}, .width = 8, .height = 8});
    never_submitted.end_rendering();
  });
  EXPECT_GT(device->validation_messages(), 0u) << "the target is larger than its image";
  EXPECT_EQ(failures.size(), device->validation_messages());
  EXPECT_THAT(failures, Each(HasSubstr("vulkan: ")));
}

// Whoever waits frees next what the device works on: an early return would be memory that it still writes.
TEST(DeviceWait, OutlastsAnySubmission) {
  const auto device = value(Device::create({.select = "cpu", .validation = true, .slow_ns = 1}));
  constexpr int64_t words = 1 << 22;
  const Buffer target = value(Buffer::create(*device, 4 * words, Memory::readback, "target"));
  // On a busy machine a submission may be done before the wait for it begins; that one says nothing.
  bool waited = false;
  for (uint32_t base = 0; base < 1600 && !waited; base += 16) {
    Commands commands = device->begin();
    for (uint32_t value = 1; value <= 16; ++value) {
      commands.fill(target, base + value);
      commands.barrier();
    }
    testing::internal::CaptureStdout();
    const Status status = device->run(std::move(commands));
    waited = testing::internal::GetCapturedStdout().find("works for") != std::string::npos;
    ASSERT_TRUE(status.ok()) << status;
    ASSERT_EQ(std::ranges::count(target.as<uint32_t>(), base + 16), words);
  }
  EXPECT_TRUE(waited);
}

using DeviceTest = GpuTest;

TEST_F(DeviceTest, WaitRefusesATicketThatWasNeverSubmitted) {
  const Ticket ticket = value(device().submit(device().begin()));
  EXPECT_EQ(device().wait(ticket + 1).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_TRUE(device().wait(ticket).ok());
  EXPECT_TRUE(device().wait(ticket).ok()) << "waiting twice is harmless";
}

TEST_F(DeviceTest, IntervalsAreThoseOfTheSubmissionThatWasWaitedFor) {
  const Buffer target = buffer(1 << 20);
  const auto submit = [&](std::vector<std::string> names) {
    Commands commands = device().begin();
    for (const std::string& name : names) {
      commands.begin_interval(name);
      commands.fill(target, 1);
      commands.barrier();
      commands.end_interval();
    }
    return value(device().submit(std::move(commands)));
  };
  const auto names = [&] {
    std::vector<std::string> result;
    for (const auto& interval : device().intervals()) result.push_back(interval.name);
    return result;
  };
  const Ticket first = submit({"a", "b"});
  const Ticket second = submit({"c"});
  ASSERT_TRUE(device().wait(first).ok());
  EXPECT_THAT(names(), ElementsAre("a", "b"));
  for (const auto& interval : device().intervals()) EXPECT_GT(interval.ms, 0.0) << interval.name;
  ASSERT_TRUE(device().wait(second).ok());
  EXPECT_THAT(names(), ElementsAre("c"));
}

TEST_F(DeviceTest, RecordingMistakesComeBackFromSubmit) {
  const Buffer small = buffer(16);
  Commands beyond = device().begin();
  beyond.copy(small, 8, small, 0, 16);
  EXPECT_EQ(device().submit(std::move(beyond)).status().code(), absl::StatusCode::kOutOfRange);

  Commands unbound = device().begin();
  unbound.dispatch(1);
  EXPECT_EQ(device().submit(std::move(unbound)).status().code(), absl::StatusCode::kFailedPrecondition);

  Commands unfinished = device().begin();
  unfinished.begin_interval("never ended");
  EXPECT_EQ(device().submit(std::move(unfinished)).status().code(), absl::StatusCode::kFailedPrecondition);

  Commands dropped = device().begin();
  dropped.fill(small, 1);
}

}  // namespace
}  // namespace tessera::gpu
