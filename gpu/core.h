// Private to gpu/: the Vulkan objects that every other one hangs on. Only gpu/*.cpp include this.
#pragma once

#include <atomic>
#include <memory>
#include <string>
#include <string_view>
#include <vector>
#include <vulkan/vulkan_raii.hpp>

#include "base/status.h"
#include "gpu/allocator.h"
#include "gpu/device.h"

namespace tessera::gpu {

// What an exception of Vulkan means to our callers.
Status to_status(const std::exception& error);

// The same error, with what it was about in front.
Status with_context(const Status& error, const std::string& context);

// Runs `body` (which returns a Status or StatusOr); an exception becomes its status. The one wall of the
// room.
template <class F>
auto guarded(F&& body) -> decltype(body()) {
  try {
    return body();
  } catch (const std::exception& error) {
    return to_status(error);
  }
}

// The instance and the validation layer's messages. Not movable: the messenger points at the counter.
struct Instance {
  vk::raii::Context context;
  vk::raii::Instance instance = nullptr;
  vk::raii::DebugUtilsMessengerEXT messenger = nullptr;
  std::atomic<uint32_t> messages = 0;
};

// Throws like vulkan_raii; a missing validation layer is a status.
StatusOr<std::unique_ptr<Instance>> create_instance(const DeviceOptions& options);
DeviceInfo describe(const vk::raii::PhysicalDevice& device);
StatusOr<vk::raii::PhysicalDevice> select_device(const vk::raii::Instance& instance,
                                                 const std::string& select);

// Shared by the Device and everything made from it, so that the order of their destruction does not matter.
struct Core {
  std::unique_ptr<Instance> instance;
  vk::raii::PhysicalDevice physical = nullptr;
  vk::raii::Device device = nullptr;
  vk::raii::Queue queue = nullptr;
  uint32_t family = 0;
  uint64_t timestamp_mask = ~0ull;
  vk::PhysicalDeviceLimits limits;
  DeviceInfo info;
  std::unique_ptr<Allocator> allocator;

  // What the next submission does first: new images go to the general layout, unmapped buffers are zeroed.
  struct NewImage {
    vk::Image image;
    vk::ImageAspectFlags aspect;
  };
  std::vector<NewImage> new_images;
  std::vector<vk::Buffer> new_buffers;

  uint64_t dispatches = 0, draws = 0;

  static StatusOr<std::shared_ptr<Core>> create(const DeviceOptions& options);

  // The name shows in validation messages and capture tools.
  template <class Handle>
  void set_name(Handle handle, std::string_view name) const {
    const auto raw = static_cast<typename Handle::CType>(handle);
    set_name(Handle::objectType, reinterpret_cast<uint64_t>(raw), name);
  }

 private:
  void set_name(vk::ObjectType type, uint64_t handle, std::string_view name) const;
};

}  // namespace tessera::gpu
