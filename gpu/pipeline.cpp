#include "gpu/pipeline.h"

#include "gpu/impl.h"

namespace tessera::gpu {
namespace {

constexpr uint32_t kMaxPushBytes = 128;

// VkSpecializationInfo with the arrays that it points at.
struct Specialization {
  std::vector<vk::SpecializationMapEntry> entries;
  std::vector<uint32_t> values;
  vk::SpecializationInfo info;

  explicit Specialization(const std::vector<Constant>& constants) {
    for (const Constant& constant : constants) {
      const auto offset = static_cast<uint32_t>(values.size() * sizeof(uint32_t));
      entries.emplace_back(constant.id, offset, sizeof(uint32_t));
      values.push_back(constant.value);
    }
    info.setMapEntries(entries).setData<uint32_t>(values);
  }
  Specialization(const Specialization&) = delete;
};

vk::raii::ShaderModule create_module(const Core& core, Spirv code) {
  return core.device.createShaderModule({{}, code.size_bytes(), code.data()});
}

template <class Desc>
void create_layout(PipelineObjects& out, Device& device, const Desc& desc) {
  out.core = device.impl().core();
  out.name = desc.name;
  out.push_bytes = (desc.push_bytes + 3) / 4 * 4;
  out.sets = static_cast<uint32_t>(desc.layouts.size());
  std::vector<vk::DescriptorSetLayout> sets;
  for (const BindLayout* layout : desc.layouts) sets.push_back(*layout->impl().layout);
  vk::PipelineLayoutCreateInfo info({}, sets);
  const vk::PushConstantRange push(vk::ShaderStageFlagBits::eAll, 0, out.push_bytes);
  if (out.push_bytes > 0) info.setPushConstantRanges(push);
  out.layout = out.core->device.createPipelineLayout(info);
}

template <class Pipeline, class Desc, class Body>
StatusOr<Pipeline> create_pipeline(const Desc& desc, Body&& body) {
  if (desc.push_bytes > kMaxPushBytes) {
    return absl::InvalidArgumentError(absl::StrCat("pipeline `", desc.name, "`: ", desc.push_bytes,
                                                   " bytes of push constants; the most is ", kMaxPushBytes));
  }
  StatusOr<Pipeline> created = guarded(std::forward<Body>(body));
  if (created.ok()) return created;
  return with_context(created.status(), absl::StrCat("pipeline `", desc.name, "`"));
}

vk::PipelineDepthStencilStateCreateInfo depth_state(const RasterPipelineDesc& desc) {
  vk::PipelineDepthStencilStateCreateInfo state;
  state.depthTestEnable = desc.depth.has_value();
  state.depthWriteEnable = desc.depth.has_value() && desc.depth_write;
  state.depthCompareOp = vk::CompareOp::eGreaterOrEqual;
  return state;
}

vk::PipelineRasterizationStateCreateInfo rasterization_state(const RasterPipelineDesc& desc) {
  vk::PipelineRasterizationStateCreateInfo state;
  state.depthClampEnable = desc.depth_clamp;
  state.frontFace = vk::FrontFace::eCounterClockwise;
  state.depthBiasEnable = desc.depth_bias != 0 || desc.depth_bias_slope != 0;
  state.depthBiasConstantFactor = desc.depth_bias;
  state.depthBiasSlopeFactor = desc.depth_bias_slope;
  state.lineWidth = 1;
  return state;
}

vk::PipelineMultisampleStateCreateInfo multisample_state(const RasterPipelineDesc& desc) {
  vk::PipelineMultisampleStateCreateInfo state;
  state.rasterizationSamples = desc.samples == 4 ? vk::SampleCountFlagBits::e4 : vk::SampleCountFlagBits::e1;
  state.sampleShadingEnable = desc.sample_shading;
  state.minSampleShading = 1;
  return state;
}

using Stages = std::vector<vk::PipelineShaderStageCreateInfo>;

vk::raii::Pipeline create_raster(const Core& core, vk::PipelineLayout layout, const Stages& stages,
                                 const RasterPipelineDesc& desc) {
  const vk::PipelineVertexInputStateCreateInfo no_vertex_buffers;
  const vk::PipelineInputAssemblyStateCreateInfo triangles({}, vk::PrimitiveTopology::eTriangleList);
  const vk::PipelineViewportStateCreateInfo viewport({}, 1, nullptr, 1, nullptr);
  const auto rasterization = rasterization_state(desc);
  const auto multisample = multisample_state(desc);
  const auto depth = depth_state(desc);

  using Channel = vk::ColorComponentFlagBits;
  vk::PipelineColorBlendAttachmentState overwrite;
  overwrite.colorWriteMask = Channel::eR | Channel::eG | Channel::eB | Channel::eA;
  const std::vector<vk::PipelineColorBlendAttachmentState> blends(desc.colors.size(), overwrite);
  const auto blend = vk::PipelineColorBlendStateCreateInfo().setAttachments(blends);

  const std::array states = {vk::DynamicState::eViewport, vk::DynamicState::eScissor,
                             vk::DynamicState::eCullMode};
  const auto dynamic = vk::PipelineDynamicStateCreateInfo().setDynamicStates(states);

  std::vector<vk::Format> formats;
  for (const Format format : desc.colors) formats.push_back(vulkan_format(format));
  auto rendering = vk::PipelineRenderingCreateInfo().setColorAttachmentFormats(formats);
  if (desc.depth) rendering.depthAttachmentFormat = vulkan_format(*desc.depth);

  vk::GraphicsPipelineCreateInfo info;
  info.setPNext(&rendering).setStages(stages).setLayout(layout);
  info.setPVertexInputState(&no_vertex_buffers).setPInputAssemblyState(&triangles);
  info.setPViewportState(&viewport).setPRasterizationState(&rasterization);
  info.setPMultisampleState(&multisample).setPDepthStencilState(&depth);
  info.setPColorBlendState(&blend).setPDynamicState(&dynamic);
  return core.device.createGraphicsPipeline(nullptr, info);
}

vk::raii::Pipeline create_tessellation(const Core& core, vk::PipelineLayout layout, const Stages& stages) {
  const vk::PipelineVertexInputStateCreateInfo no_vertex_buffers;
  const vk::PipelineInputAssemblyStateCreateInfo patches({}, vk::PrimitiveTopology::ePatchList);
  const vk::PipelineTessellationStateCreateInfo one_vertex({}, 1);
  vk::PipelineRasterizationStateCreateInfo rasterization;
  rasterization.rasterizerDiscardEnable = VK_TRUE;
  rasterization.lineWidth = 1;
  const vk::PipelineRenderingCreateInfo no_attachments;
  // Not used, but a state that is not dynamic would undo what was set for the raster draws that follow.
  const std::array states = {vk::DynamicState::eViewport, vk::DynamicState::eScissor};
  const auto dynamic = vk::PipelineDynamicStateCreateInfo().setDynamicStates(states);

  vk::GraphicsPipelineCreateInfo info;
  info.setPNext(&no_attachments).setStages(stages).setLayout(layout);
  info.setPVertexInputState(&no_vertex_buffers).setPInputAssemblyState(&patches);
  info.setPTessellationState(&one_vertex).setPRasterizationState(&rasterization);
  info.setPDynamicState(&dynamic);
  return core.device.createGraphicsPipeline(nullptr, info);
}

}  // namespace

StatusOr<ComputePipeline> ComputePipeline::create(Device& device, const ComputePipelineDesc& desc) {
  return create_pipeline<ComputePipeline>(desc, [&]() -> StatusOr<ComputePipeline> {
    ComputePipeline pipeline;
    pipeline.impl_ = std::make_unique<Impl>();
    create_layout(*pipeline.impl_, device, desc);
    const Core& core = *pipeline.impl_->core;
    const Specialization constants(desc.constants);
    const vk::raii::ShaderModule shader = create_module(core, desc.shader);
    const vk::PipelineShaderStageCreateInfo stage({}, vk::ShaderStageFlagBits::eCompute, *shader, "main",
                                                  &constants.info);
    pipeline.impl_->pipeline =
        core.device.createComputePipeline(nullptr, {{}, stage, *pipeline.impl_->layout});
    core.set_name(*pipeline.impl_->pipeline, desc.name);
    return pipeline;
  });
}

ComputePipeline::ComputePipeline() = default;
ComputePipeline::ComputePipeline(ComputePipeline&&) noexcept = default;
ComputePipeline& ComputePipeline::operator=(ComputePipeline&&) noexcept = default;
ComputePipeline::~ComputePipeline() = default;

StatusOr<RasterPipeline> RasterPipeline::create(Device& device, const RasterPipelineDesc& desc) {
  return create_pipeline<RasterPipeline>(desc, [&]() -> StatusOr<RasterPipeline> {
    RasterPipeline pipeline;
    pipeline.impl_ = std::make_unique<Impl>();
    pipeline.impl_->cull = desc.cull;
    create_layout(*pipeline.impl_, device, desc);
    const Core& core = *pipeline.impl_->core;
    const Specialization constants(desc.constants);
    const vk::raii::ShaderModule vertex = create_module(core, desc.vertex);
    vk::raii::ShaderModule fragment = nullptr;
    using Stage = vk::ShaderStageFlagBits;
    Stages stages = {{{}, Stage::eVertex, *vertex, "main", &constants.info}};
    if (!desc.fragment.empty()) {
      fragment = create_module(core, desc.fragment);
      stages.push_back({{}, Stage::eFragment, *fragment, "main", &constants.info});
    }
    pipeline.impl_->pipeline = create_raster(core, *pipeline.impl_->layout, stages, desc);
    core.set_name(*pipeline.impl_->pipeline, desc.name);
    return pipeline;
  });
}

RasterPipeline::RasterPipeline() = default;
RasterPipeline::RasterPipeline(RasterPipeline&&) noexcept = default;
RasterPipeline& RasterPipeline::operator=(RasterPipeline&&) noexcept = default;
RasterPipeline::~RasterPipeline() = default;

StatusOr<TessellationPipeline> TessellationPipeline::create(Device& device,
                                                            const TessellationPipelineDesc& desc) {
  if (!device.info().tessellation_stores) {
    return absl::FailedPreconditionError(
        absl::StrCat("pipeline `", desc.name, "`: the Vulkan device \"", device.info().name,
                     "\" lacks tessellationShader or vertexPipelineStoresAndAtomics"));
  }
  return create_pipeline<TessellationPipeline>(desc, [&]() -> StatusOr<TessellationPipeline> {
    TessellationPipeline pipeline;
    pipeline.impl_ = std::make_unique<Impl>();
    create_layout(*pipeline.impl_, device, desc);
    const Core& core = *pipeline.impl_->core;
    const Specialization constants(desc.constants);
    const vk::raii::ShaderModule vertex = create_module(core, desc.vertex);
    const vk::raii::ShaderModule control = create_module(core, desc.control);
    const vk::raii::ShaderModule evaluation = create_module(core, desc.evaluation);
    using Stage = vk::ShaderStageFlagBits;
    const Stages stages = {{{}, Stage::eVertex, *vertex, "main", &constants.info},
                           {{}, Stage::eTessellationControl, *control, "main", &constants.info},
                           {{}, Stage::eTessellationEvaluation, *evaluation, "main", &constants.info}};
    pipeline.impl_->pipeline = create_tessellation(core, *pipeline.impl_->layout, stages);
    core.set_name(*pipeline.impl_->pipeline, desc.name);
    return pipeline;
  });
}

TessellationPipeline::TessellationPipeline() = default;
TessellationPipeline::TessellationPipeline(TessellationPipeline&&) noexcept = default;
TessellationPipeline& TessellationPipeline::operator=(TessellationPipeline&&) noexcept = default;
TessellationPipeline::~TessellationPipeline() = default;

}  // namespace tessera::gpu
