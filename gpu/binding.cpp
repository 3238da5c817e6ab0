// BindLayout and BindGroup.
#include <algorithm>
#include <array>

#include "gpu/impl.h"

namespace tessera::gpu {
namespace {

vk::DescriptorType descriptor_type(BindingKind kind) {
  switch (kind) {
    case BindingKind::storage_buffer:
      return vk::DescriptorType::eStorageBuffer;
    case BindingKind::uniform_buffer:
      return vk::DescriptorType::eUniformBuffer;
    case BindingKind::storage_image:
      return vk::DescriptorType::eStorageImage;
    case BindingKind::sampled_image:
      break;
  }
  return vk::DescriptorType::eCombinedImageSampler;
}

uint64_t max_range(const Core& core, BindingKind kind) {
  return kind == BindingKind::uniform_buffer ? core.limits.maxUniformBufferRange
                                             : core.limits.maxStorageBufferRange;
}

// Finds the slot that a set() means and marks it written; a wrong one leaves the group unusable.
BindGroup::Impl::Slot* claim(BindGroup::Impl& group, uint32_t binding, uint32_t element,
                             std::initializer_list<BindingKind> kinds) {
  const auto slot = std::find_if(group.slots.begin(), group.slots.end(),
                                 [&](const auto& s) { return s.binding.index == binding; });
  const bool right = slot != group.slots.end() && element < slot->binding.count &&
                     std::find(kinds.begin(), kinds.end(), slot->binding.kind) != kinds.end();
  if (!right) {
    group.misuse.Update(absl::InvalidArgumentError(
        absl::StrCat("BindGroup::set: binding ", binding, " element ", element,
                     " is not in the layout, or is of another kind than the resource")));
    return nullptr;
  }
  slot->written[element] = true;
  return &*slot;
}

void write_image(BindGroup::Impl& group, const BindGroup::Impl::Slot& slot, uint32_t element,
                 vk::ImageView view, vk::Sampler sampler) {
  const vk::DescriptorImageInfo info(sampler, view, vk::ImageLayout::eGeneral);
  vk::WriteDescriptorSet write(group.set, slot.binding.index, element, 1, descriptor_type(slot.binding.kind));
  write.pImageInfo = &info;
  group.core->device.updateDescriptorSets(write, {});
}

}  // namespace

StatusOr<BindLayout> BindLayout::create(Device& device, std::span<const Binding> bindings) {
  return guarded([&]() -> StatusOr<BindLayout> {
    BindLayout layout;
    layout.impl_ = std::make_unique<Impl>();
    layout.impl_->core = device.impl().core();
    layout.impl_->bindings.assign(bindings.begin(), bindings.end());
    std::vector<vk::DescriptorSetLayoutBinding> rows;
    for (const Binding& b : bindings) {
      rows.emplace_back(b.index, descriptor_type(b.kind), b.count, vk::ShaderStageFlagBits::eAll);
    }
    layout.impl_->layout = layout.impl_->core->device.createDescriptorSetLayout({{}, rows});
    return layout;
  });
}

BindLayout::BindLayout() = default;
BindLayout::BindLayout(BindLayout&&) noexcept = default;
BindLayout& BindLayout::operator=(BindLayout&&) noexcept = default;
BindLayout::~BindLayout() = default;

StatusOr<BindGroup> BindGroup::create(Device& device, const BindLayout& layout) {
  return guarded([&]() -> StatusOr<BindGroup> {
    BindGroup group;
    group.impl_ = std::make_unique<Impl>();
    Impl& impl = *group.impl_;
    impl.core = device.impl().core();
    std::vector<vk::DescriptorPoolSize> sizes;
    for (const Binding& b : layout.impl().bindings) {
      sizes.emplace_back(descriptor_type(b.kind), b.count);
      impl.slots.push_back({b, std::vector<bool>(b.count, false)});
    }
    // A pool of exactly one set: no fragmentation, and the set goes with its group.
    impl.pool = impl.core->device.createDescriptorPool({{}, 1, sizes});
    const vk::DescriptorSetLayout set_layout = *layout.impl().layout;
    auto sets = impl.core->device.allocateDescriptorSets({*impl.pool, set_layout});
    impl.set = sets.front().release();
    return group;
  });
}

Status BindGroup::Impl::usable() const {
  TESSERA_RETURN_IF_ERROR(misuse);
  for (const Slot& slot : slots) {
    const auto hole = std::find(slot.written.begin(), slot.written.end(), false);
    if (hole == slot.written.end()) continue;
    return absl::FailedPreconditionError(absl::StrCat("BindGroup: binding ", slot.binding.index, " element ",
                                                      hole - slot.written.begin(), " was never set"));
  }
  return absl::OkStatus();
}

void BindGroup::set(uint32_t binding, const Buffer& buffer) {
  const auto* slot = claim(*impl_, binding, 0, {BindingKind::storage_buffer, BindingKind::uniform_buffer});
  if (slot == nullptr) return;
  const uint64_t limit = max_range(*impl_->core, slot->binding.kind);
  if (buffer.size() > limit) {
    impl_->misuse.Update(absl::ResourceExhaustedError(
        absl::StrCat("BindGroup::set: binding ", binding, ": buffer `", buffer.impl().name, "` has ",
                     buffer.size(), " bytes; this device binds at most ", limit, ". Split it")));
    return;
  }
  const vk::DescriptorBufferInfo info(*buffer.impl().buffer, 0, VK_WHOLE_SIZE);
  vk::WriteDescriptorSet write(impl_->set, binding, 0, 1, descriptor_type(slot->binding.kind));
  write.pBufferInfo = &info;
  impl_->core->device.updateDescriptorSets(write, {});
}

void BindGroup::set(uint32_t binding, const Image& image) {
  set_mip(binding, image, 0);
}

void BindGroup::set(uint32_t binding, const Image& image, const Sampler& sampler, uint32_t array_element) {
  const auto* slot = claim(*impl_, binding, array_element, {BindingKind::sampled_image});
  if (slot == nullptr) return;
  write_image(*impl_, *slot, array_element, *image.impl().sampled, *sampler.impl().sampler);
}

void BindGroup::set_mip(uint32_t binding, const Image& image, uint32_t mip, uint32_t array_element) {
  const auto* slot = claim(*impl_, binding, array_element, {BindingKind::storage_image});
  if (slot == nullptr) return;
  if (mip >= image.impl().storage.size()) {
    impl_->misuse.Update(absl::InvalidArgumentError(
        absl::StrCat("BindGroup::set: binding ", binding, ": image `", image.impl().name,
                     "` has no storage view of mip level ", mip, " (ImageDesc::storage, mip_levels)")));
    return;
  }
  write_image(*impl_, *slot, array_element, *image.impl().storage[mip], {});
}

BindGroup::BindGroup() = default;
BindGroup::BindGroup(BindGroup&&) noexcept = default;
BindGroup& BindGroup::operator=(BindGroup&&) noexcept = default;
BindGroup::~BindGroup() = default;

}  // namespace tessera::gpu
