// The instance, and the choice among its devices.
#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <optional>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "base/log.h"
#include "gpu/core.h"

namespace tessera::gpu {
namespace {

constexpr const char* kValidationLayer = "VK_LAYER_KHRONOS_validation";

using Severity = vk::DebugUtilsMessageSeverityFlagBitsEXT;

VKAPI_ATTR VkBool32 VKAPI_CALL on_message(VkDebugUtilsMessageSeverityFlagBitsEXT severity,
                                          VkDebugUtilsMessageTypeFlagsEXT,
                                          const VkDebugUtilsMessengerCallbackDataEXT* data, void* counter) {
  ++*static_cast<std::atomic<uint32_t>*>(counter);
  const bool error = severity >= VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT;
  spdlog::log(error ? spdlog::level::err : spdlog::level::warn, "vulkan: {}", data->pMessage);
  return VK_FALSE;
}

Status require_validation_layer(const vk::raii::Context& context) {
  for (const vk::LayerProperties& layer : context.enumerateInstanceLayerProperties()) {
    if (std::string_view(layer.layerName) == kValidationLayer) return absl::OkStatus();
  }
  return absl::FailedPreconditionError(absl::StrCat(kValidationLayer,
                                                    " is not installed; install the package "
                                                    "vulkan-validationlayers or switch validation off"));
}

// Better devices first; 0 = software.
int rank(vk::PhysicalDeviceType type) {
  switch (type) {
    case vk::PhysicalDeviceType::eDiscreteGpu:
      return 4;
    case vk::PhysicalDeviceType::eIntegratedGpu:
      return 3;
    case vk::PhysicalDeviceType::eVirtualGpu:
      return 2;
    case vk::PhysicalDeviceType::eCpu:
      return 0;
    default:
      return 1;
  }
}

std::string listing(const std::vector<vk::raii::PhysicalDevice>& devices) {
  std::string text;
  for (size_t i = 0; i < devices.size(); ++i) {
    const DeviceInfo info = describe(devices[i]);
    absl::StrAppend(&text, i == 0 ? "" : ", ", i, " = \"", info.name, "\"",
                    info.software ? " (software)" : "");
  }
  return text.empty() ? "none" : text;
}

std::optional<size_t> parse_index(const std::string& text) {
  size_t index = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), index);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return index;
}

bool name_contains(const vk::PhysicalDeviceProperties& properties, const std::string& part) {
  const std::string name = absl::AsciiStrToLower(properties.deviceName.data());
  return absl::StrContains(name, absl::AsciiStrToLower(part));
}

std::optional<size_t> find_device(const std::vector<vk::raii::PhysicalDevice>& devices,
                                  const std::string& select) {
  if (const auto index = parse_index(select)) {
    return *index < devices.size() ? index : std::nullopt;
  }
  std::optional<size_t> best;
  for (size_t i = 0; i < devices.size(); ++i) {
    const vk::PhysicalDeviceProperties properties = devices[i].getProperties();
    if (properties.apiVersion < VK_API_VERSION_1_3) continue;
    const bool matches = select == "cpu" ? properties.deviceType == vk::PhysicalDeviceType::eCpu
                                         : name_contains(properties, select);
    if (!matches) continue;
    if (!best || rank(properties.deviceType) > rank(devices[*best].getProperties().deviceType)) best = i;
  }
  return best;
}

// Mesa's software device (22.3, LLVM 15) crashes in its 8-bit texture filters when a compute shader chooses a
// texture at run time; its float filters are sound, and more exact. The variable must stand before the driver
// is loaded; whoever has set it keeps their value.
void avoid_broken_software_filters() {
  setenv("GALLIVM_PERF", "no_aos_sampling", /*overwrite=*/0);
}

}  // namespace

StatusOr<std::unique_ptr<Instance>> create_instance(const DeviceOptions& options) {
  avoid_broken_software_filters();
  auto result = std::make_unique<Instance>();
  const vk::ApplicationInfo application("tessera", 1, nullptr, 0, VK_API_VERSION_1_3);
  vk::InstanceCreateInfo create({}, &application);
  if (!options.validation) {
    result->instance = result->context.createInstance(create);
    return result;
  }

  TESSERA_RETURN_IF_ERROR(require_validation_layer(result->context));
  const char* const extension = VK_EXT_DEBUG_UTILS_EXTENSION_NAME;
  create.setPEnabledLayerNames(kValidationLayer).setPEnabledExtensionNames(extension);
  const auto synchronization = vk::ValidationFeatureEnableEXT::eSynchronizationValidation;
  const vk::ValidationFeaturesEXT features(synchronization);
  if (options.validate_synchronization) create.pNext = &features;
  result->instance = result->context.createInstance(create);
  result->messenger =
      result->instance.createDebugUtilsMessengerEXT({{},
                                                     Severity::eWarning | Severity::eError,
                                                     vk::DebugUtilsMessageTypeFlagBitsEXT::eValidation,
                                                     on_message,
                                                     &result->messages});
  return result;
}

DeviceInfo describe(const vk::raii::PhysicalDevice& device) {
  const auto chain =
      device.getProperties2<vk::PhysicalDeviceProperties2, vk::PhysicalDeviceVulkan12Properties>();
  const vk::PhysicalDeviceProperties& core = chain.get<vk::PhysicalDeviceProperties2>().properties;
  const auto& v12 = chain.get<vk::PhysicalDeviceVulkan12Properties>();
  const vk::PhysicalDeviceFeatures features = device.getFeatures();
  return {.name = core.deviceName,
          .driver = absl::StrCat(v12.driverName.data(), " ", v12.driverInfo.data()),
          .software = core.deviceType == vk::PhysicalDeviceType::eCpu,
          .max_storage_buffer_range = core.limits.maxStorageBufferRange,
          .max_sampled_images = core.limits.maxPerStageDescriptorSampledImages,
          .tessellation_stores =
              features.tessellationShader != VK_FALSE && features.vertexPipelineStoresAndAtomics != VK_FALSE};
}

StatusOr<vk::raii::PhysicalDevice> select_device(const vk::raii::Instance& instance,
                                                 const std::string& select) {
  auto devices = instance.enumeratePhysicalDevices();
  const std::optional<size_t> chosen = find_device(devices, select);
  if (!chosen) {
    return absl::NotFoundError(absl::StrCat("no Vulkan 1.3 device matches \"", select,
                                            "\"; devices here: ", listing(devices),
                                            ". Select one by its number, part of its name, or \"cpu\""));
  }
  if (devices[*chosen].getProperties().apiVersion < VK_API_VERSION_1_3) {
    return absl::FailedPreconditionError(
        absl::StrCat("the Vulkan device \"", describe(devices[*chosen]).name, "\" is older than Vulkan 1.3"));
  }
  return std::move(devices[*chosen]);
}

StatusOr<std::vector<DeviceInfo>> list_devices() {
  return guarded([]() -> StatusOr<std::vector<DeviceInfo>> {
    DeviceOptions options;
    options.validation = false;
    TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<Instance> instance, create_instance(options));
    std::vector<DeviceInfo> infos;
    for (const auto& device : instance->instance.enumeratePhysicalDevices())
      infos.push_back(describe(device));
    return infos;
  });
}

}  // namespace tessera::gpu
