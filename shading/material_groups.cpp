#include "shading/material_groups.h"

#include <cstring>

#include "gpu/commands.h"
#include "scene/gpu_records.h"
#include "shading/shaders/material_copy.comp.spv.h"

namespace tessera::shading {
namespace {

constexpr uint32_t kCopyBinding = 1;  // set 1 of material_copy.comp

// The scene's material records, as the device has them.
StatusOr<std::vector<scene::MaterialRecord>> read_materials(gpu::Device& device,
                                                            const scene::GpuScene& scene) {
  const auto count = static_cast<uint32_t>(scene.scene().materials.size());
  std::vector<scene::MaterialRecord> records(count);
  if (count == 0) return records;
  const gpu::Binding binding{kCopyBinding, gpu::BindingKind::storage_buffer};
  TESSERA_ASSIGN_OR_RETURN(const auto layout, gpu::BindLayout::create(device, {&binding, 1}));
  TESSERA_ASSIGN_OR_RETURN(auto group, gpu::BindGroup::create(device, layout));
  const uint64_t bytes = count * sizeof(scene::MaterialRecord);
  TESSERA_ASSIGN_OR_RETURN(const auto copies,
                           gpu::Buffer::create(device, bytes, gpu::Memory::readback, "material copies"));
  group.set(kCopyBinding, copies);
  TESSERA_ASSIGN_OR_RETURN(const auto pipeline,
                           gpu::ComputePipeline::create(device, {.name = "material copy",
                                                                 .shader = material_copy_comp,
                                                                 .layouts = {&scene.layout(), &layout},
                                                                 .push_bytes = sizeof(uint32_t),
                                                                 .constants = scene.constants()}));
  gpu::Commands commands = device.begin();
  commands.bind(pipeline, {&scene.group(), &group});
  commands.push(count);
  commands.dispatch((count + 63) / 64);
  commands.barrier();
  TESSERA_RETURN_IF_ERROR(device.run(std::move(commands)));
  std::memcpy(records.data(), copies.mapped(), bytes);
  return records;
}

}  // namespace

StatusOr<MaterialGroups> MaterialGroups::create(gpu::Device& device, const scene::GpuScene& scene,
                                                std::span<const gpu::Binding> bindings) {
  MaterialGroups result;
  std::vector<gpu::Binding> all{{0, gpu::BindingKind::uniform_buffer}};
  all.insert(all.end(), bindings.begin(), bindings.end());
  TESSERA_ASSIGN_OR_RETURN(result.layout_, gpu::BindLayout::create(device, all));
  TESSERA_ASSIGN_OR_RETURN(const auto materials, read_materials(device, scene));
  for (const scene::MaterialRecord& material : materials) {
    TESSERA_ASSIGN_OR_RETURN(auto record,
                             gpu::Buffer::create(device, sizeof(material), gpu::Memory::upload, "material"));
    std::memcpy(record.mapped(), &material, sizeof(material));
    TESSERA_ASSIGN_OR_RETURN(auto group, gpu::BindGroup::create(device, result.layout_));
    group.set(0, record);
    result.records_.push_back(std::move(record));
    result.groups_.push_back(std::move(group));
  }
  return result;
}

void MaterialGroups::set(uint32_t binding, const gpu::Buffer& buffer) {
  for (gpu::BindGroup& group : groups_) group.set(binding, buffer);
}

void MaterialGroups::set(uint32_t binding, const gpu::Image& image) {
  for (gpu::BindGroup& group : groups_) group.set(binding, image);
}

}  // namespace tessera::shading
