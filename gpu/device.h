// A headless Vulkan 1.3 device with one queue. The rest of the house sees Vulkan only through gpu/: these
// headers hide vulkan_raii.hpp and its exceptions, which end here as absl::Status with the failed call's
// name.
//
// Thread-safety: a Device may be used by one thread at a time (one render thread per device,
// docs/architecture.md).
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "base/status.h"
#include "base/time.h"

namespace tessera::gpu {

struct DeviceOptions {
  // "" = a hardware device if there is one, else software; "cpu" = software; a number = index in
  // list_devices(); else part of a device's name, case-insensitive.
  std::string select;
  // Load the validation layer (an error if it is not installed). On by default in debug builds.
#ifdef NDEBUG
  bool validation = false;
#else
  bool validation = true;
#endif
  // With `validation`: the layer also reports missing barriers (slow).
  bool validate_synchronization = false;
  // Work that lasts longer is logged as a warning, again whenever it has lasted twice as long.
  DurationNs slow_ns = 60 * kNsPerSecond;
};

struct DeviceInfo {
  std::string name;    // as the driver gives it
  std::string driver;  // driver name and version
  bool software = false;
  uint64_t max_storage_buffer_range = 0;  // bytes; 128 MiB on old lavapipe
  uint32_t max_sampled_images = 0;        // per stage
  bool tessellation_stores = false;       // has tessellation shaders, which may store: TessellationPipeline
};

class DeviceImpl;
class Commands;

// A point in the queue's work: reached when everything submitted up to it is done.
using Ticket = uint64_t;

class Device {
 public:
  static StatusOr<std::shared_ptr<Device>> create(const DeviceOptions& options);
  ~Device();

  const DeviceInfo& info() const;

  // A recorder for one submission. Record, then submit; a Commands is used once.
  Commands begin();
  // Hands the recorded work to the queue. Buffers, images and pipelines that it uses must live until it is
  // done.
  StatusOr<Ticket> submit(Commands commands);
  // Blocks until `ticket` is reached, however long that takes: until then the device uses what it was given.
  // Unavailable if the device is lost (a hung one, too, once its driver has given it up).
  Status wait(Ticket ticket);
  // submit + wait.
  Status run(Commands commands);

  // Named GPU intervals of the newest submission that has been waited for, in recording order.
  struct Interval {
    std::string name;
    double ms;
  };
  std::vector<Interval> intervals() const;

  // Bytes of device memory that gpu:: objects hold right now, and their peak.
  uint64_t memory_in_use() const;
  uint64_t memory_peak() const;
  // Messages (warnings and errors) from the validation layer so far; tests require 0.
  uint32_t validation_messages() const;
  // How many dispatches and draws were recorded so far: tests show that an omitted pass records none.
  uint64_t dispatches_recorded() const;
  uint64_t draws_recorded() const;

  DeviceImpl& impl() { return *impl_; }

 private:
  explicit Device(std::unique_ptr<DeviceImpl> impl);
  std::unique_ptr<DeviceImpl> impl_;
};

// Name, driver and kind of every Vulkan device, in index order.
StatusOr<std::vector<DeviceInfo>> list_devices();

}  // namespace tessera::gpu
