// A software device with the validation layer, shared by a suite; every test must leave the layer silent.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "gpu/commands.h"
#include "gpu/device.h"

namespace tessera::gpu {

template <class T>
T value(StatusOr<T> result) {
  if (!result.ok()) throw std::runtime_error(result.status().ToString());
  return *std::move(result);
}

class GpuTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    device_ = value(Device::create({.select = "cpu", .validation = true, .validate_synchronization = true}));
  }
  static void TearDownTestSuite() { device_.reset(); }
  void TearDown() override {
    EXPECT_EQ(device_->validation_messages(), 0u);
    EXPECT_EQ(device_->memory_in_use(), 0u) << "a resource of this test is not accounted for";
  }

  static Device& device() { return *device_; }

  static void run(Commands commands) {
    const Status status = device_->run(std::move(commands));
    ASSERT_TRUE(status.ok()) << status;
  }

  static Buffer buffer(uint64_t bytes, Memory memory = Memory::device) {
    return value(Buffer::create(*device_, bytes, memory, "test buffer"));
  }
  template <class T>
  static Buffer filled(const std::vector<T>& data) {
    return value(Buffer::create_filled(*device_, std::as_bytes(std::span(data)), "test data"));
  }
  static Image image(const ImageDesc& desc) { return value(Image::create(*device_, desc, "test image")); }

  // One mip level of one layer, read back.
  template <class T>
  static std::vector<T> read(const Image& from, size_t count, uint32_t mip = 0, uint32_t layer = 0) {
    const Buffer to = buffer(count * sizeof(T), Memory::readback);
    Commands commands = device_->begin();
    commands.copy_to_buffer(from, to, 0, mip, layer);
    run(std::move(commands));
    const auto texels = to.as<T>();
    return {texels.begin(), texels.end()};
  }
  template <class T>
  static void write(const Image& to, const std::vector<T>& texels, uint32_t layer = 0) {
    const Buffer from = filled(texels);
    Commands commands = device_->begin();
    commands.copy_to_image(from, 0, to, 0, layer);
    run(std::move(commands));
  }

 private:
  static inline std::shared_ptr<Device> device_;
};

}  // namespace tessera::gpu
