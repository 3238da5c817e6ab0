#include "gpu/core.h"

#include <algorithm>
#include <array>
#include <span>
#include <string>

#include "base/log.h"

namespace tessera::gpu {
namespace {

struct Features {
  vk::PhysicalDeviceFeatures core;
  vk::PhysicalDeviceVulkan11Features v11;
  vk::PhysicalDeviceVulkan12Features v12;
  vk::PhysicalDeviceVulkan13Features v13;
};

enum class Need { always, on_hardware, no };

struct FeatureRow {
  const char* name;
  vk::Bool32& (*field)(Features&);
  Need need;
};

// clang-format off
#define TESSERA_FEATURE(group, name, need) \
  {#name, [](Features& f) -> vk::Bool32& { return f.group.name; }, Need::need}
// clang-format on

const FeatureRow kFeatures[] = {
    TESSERA_FEATURE(core, multiDrawIndirect, always),
    TESSERA_FEATURE(core, drawIndirectFirstInstance, always),
    TESSERA_FEATURE(core, sampleRateShading, always),
    TESSERA_FEATURE(core, depthClamp, always),
    TESSERA_FEATURE(core, fragmentStoresAndAtomics, always),
    TESSERA_FEATURE(core, shaderStorageBufferArrayDynamicIndexing, always),
    TESSERA_FEATURE(core, shaderStorageImageWriteWithoutFormat, always),
    TESSERA_FEATURE(core, shaderStorageImageExtendedFormats, always),
    TESSERA_FEATURE(v11, shaderDrawParameters, always),
    TESSERA_FEATURE(v12, timelineSemaphore, always),
    TESSERA_FEATURE(v12, hostQueryReset, always),
    TESSERA_FEATURE(v12, drawIndirectCount, always),
    TESSERA_FEATURE(v12, scalarBlockLayout, always),
    TESSERA_FEATURE(v13, dynamicRendering, always),
    TESSERA_FEATURE(v13, synchronization2, always),
    TESSERA_FEATURE(v13, maintenance4, always),
    // lavapipe 22.3 does not claim these two, and yet does the first correctly (tests/gpu/compute_test.cpp).
    TESSERA_FEATURE(core, shaderSampledImageArrayDynamicIndexing, on_hardware),
    TESSERA_FEATURE(core, shaderStorageImageArrayDynamicIndexing, on_hardware),
    // DeviceInfo::tessellation_stores.
    TESSERA_FEATURE(core, tessellationShader, no),
    TESSERA_FEATURE(core, vertexPipelineStoresAndAtomics, no),
    // gl_PrimitiveID in fragment shaders counts as geometry shading.
    TESSERA_FEATURE(core, geometryShader, no),
    TESSERA_FEATURE(core, shaderInt64, no),
    TESSERA_FEATURE(core, shaderInt16, no),
    TESSERA_FEATURE(core, shaderClipDistance, no),
    TESSERA_FEATURE(core, shaderStorageImageReadWithoutFormat, no),
    TESSERA_FEATURE(v11, storageBuffer16BitAccess, no),
    TESSERA_FEATURE(v12, storageBuffer8BitAccess, no),
    TESSERA_FEATURE(v12, shaderInt8, no),
    TESSERA_FEATURE(v12, shaderFloat16, no),
    TESSERA_FEATURE(v12, shaderSampledImageArrayNonUniformIndexing, no),
    TESSERA_FEATURE(v13, shaderDemoteToHelperInvocation, no),
    TESSERA_FEATURE(v13, shaderTerminateInvocation, no),
    TESSERA_FEATURE(v13, shaderIntegerDotProduct, no),
};

#undef TESSERA_FEATURE

Features supported_features(const vk::raii::PhysicalDevice& physical) {
  const auto chain =
      physical.getFeatures2<vk::PhysicalDeviceFeatures2, vk::PhysicalDeviceVulkan11Features,
                            vk::PhysicalDeviceVulkan12Features, vk::PhysicalDeviceVulkan13Features>();
  return {chain.get<vk::PhysicalDeviceFeatures2>().features, chain.get<vk::PhysicalDeviceVulkan11Features>(),
          chain.get<vk::PhysicalDeviceVulkan12Features>(), chain.get<vk::PhysicalDeviceVulkan13Features>()};
}

// The rows of kFeatures that the device has; an error names every required one that it lacks.
StatusOr<Features> wanted_features(const vk::raii::PhysicalDevice& physical) {
  Features supported = supported_features(physical);
  Features wanted;
  std::string missing;
  const bool software = describe(physical).software;
  for (const FeatureRow& row : kFeatures) {
    const vk::Bool32 has = row.field(supported);
    row.field(wanted) = has;
    const bool required = row.need == Need::always || (row.need == Need::on_hardware && !software);
    if (required && has == VK_FALSE) absl::StrAppend(&missing, missing.empty() ? "" : ", ", row.name);
  }
  if (missing.empty()) return wanted;
  return absl::FailedPreconditionError(absl::StrCat("the Vulkan device \"", describe(physical).name,
                                                    "\" lacks ", missing, "; select another device"));
}

StatusOr<uint32_t> find_queue_family(const vk::raii::PhysicalDevice& physical) {
  const vk::QueueFlags needed = vk::QueueFlagBits::eGraphics | vk::QueueFlagBits::eCompute;
  const auto families = physical.getQueueFamilyProperties();
  for (uint32_t i = 0; i < families.size(); ++i) {
    if ((families[i].queueFlags & needed) == needed) return i;
  }
  return absl::FailedPreconditionError(absl::StrCat("the Vulkan device \"", describe(physical).name,
                                                    "\" has no graphics queue; select another device"));
}

vk::raii::Device create_device(const vk::raii::PhysicalDevice& physical, uint32_t family, Features features) {
  const float priority = 1;
  const vk::DeviceQueueCreateInfo queue({}, family, 1, &priority);
  vk::PhysicalDeviceFeatures2 enabled(features.core);
  enabled.pNext = &features.v11;
  features.v11.pNext = &features.v12;
  features.v12.pNext = &features.v13;
  features.v13.pNext = nullptr;
  vk::DeviceCreateInfo create({}, queue);
  create.pNext = &enabled;
  return physical.createDevice(create);
}

}  // namespace

Status to_status(const std::exception& error) {
  const auto* vulkan = dynamic_cast<const vk::SystemError*>(&error);
  if (vulkan == nullptr) return absl::InternalError(error.what());
  switch (static_cast<vk::Result>(vulkan->code().value())) {
    case vk::Result::eErrorDeviceLost:
      return absl::UnavailableError(absl::StrCat(error.what(), " (the device is lost; make a new one)"));
    case vk::Result::eErrorOutOfHostMemory:
    case vk::Result::eErrorOutOfDeviceMemory:
    case vk::Result::eErrorTooManyObjects:
      return absl::ResourceExhaustedError(error.what());
    case vk::Result::eErrorIncompatibleDriver:
      return absl::FailedPreconditionError(
          absl::StrCat(error.what(), " (no Vulkan 1.3 driver is installed; mesa-vulkan-drivers has one)"));
    default:
      return absl::InternalError(error.what());
  }
}

Status with_context(const Status& error, const std::string& context) {
  return Status(error.code(), absl::StrCat(context, ": ", error.message()));
}

StatusOr<std::shared_ptr<Core>> Core::create(const DeviceOptions& options) {
  return guarded([&]() -> StatusOr<std::shared_ptr<Core>> {
    auto core = std::make_shared<Core>();
    TESSERA_ASSIGN_OR_RETURN(core->instance, create_instance(options));
    TESSERA_ASSIGN_OR_RETURN(core->physical, select_device(core->instance->instance, options.select));
    TESSERA_ASSIGN_OR_RETURN(core->family, find_queue_family(core->physical));
    TESSERA_ASSIGN_OR_RETURN(const Features features, wanted_features(core->physical));
    core->device = create_device(core->physical, core->family, features);
    core->queue = core->device.getQueue(core->family, 0);
    core->info = describe(core->physical);
    const vk::PhysicalDeviceProperties properties = core->physical.getProperties();
    core->limits = properties.limits;
    const uint32_t bits = core->physical.getQueueFamilyProperties()[core->family].timestampValidBits;
    core->timestamp_mask = bits == 64 ? ~0ull : (1ull << bits) - 1;
    const bool shares_memory =
        core->info.software || properties.deviceType == vk::PhysicalDeviceType::eIntegratedGpu;
    core->allocator = std::make_unique<Allocator>(core->physical, core->device, shares_memory);
    spdlog::debug("gpu: {} ({})", core->info.name, core->info.driver);
    return core;
  });
}

void Core::set_name(vk::ObjectType type, uint64_t handle, std::string_view name) const {
  if (!*instance->messenger) return;
  const std::string terminated(name);
  device.setDebugUtilsObjectNameEXT({type, handle, terminated.c_str()});
}

}  // namespace tessera::gpu
