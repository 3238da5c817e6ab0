#include "bench/texel_shader.h"

#include <algorithm>
#include <numeric>

#include "bench/shaders/texel_shading.comp.spv.h"
#include "shading/gather_pass.h"
#include "shading/growing_buffer.h"
#include "shading/material_groups.h"

namespace tessera::bench {
namespace {

constexpr uint32_t kPoolColumns = 512;  // tiles
constexpr uint32_t kMaxGroupsX = 32768;

enum Binding : uint32_t { kTiles = 2, kInverseMap, kPatches, kPool };

// bench/shaders/texel_shading.comp
struct TileRecord {
  uint32_t instance, level, x, y;
};
struct PatchRecord {
  uint32_t first_triangle, count;
  uint32_t place, size;
};

uint32_t packed(uint32_t low, uint32_t high) {
  return low | high << 16;
}

}  // namespace

struct TexelShader::Impl {
  gpu::Device& device;
  const scene::GpuScene& scene;
  const shading::Lighting& lighting;
  const UniqueTexture& texture;
  shading::MaterialGroups groups;
  gpu::ComputePipeline pipeline;
  gpu::Buffer tiles, inverse_map, patches, readback;
  gpu::Image pool;
  uint32_t pool_rows = 0;             // tiles
  std::vector<uint32_t> first_patch;  // of an instance, in `patches`

  Status create();
  Status create_patches();
  Status fit(uint32_t tile_count);
  uint64_t upload(std::span<const TexelTile> sorted);
  void record(gpu::Commands& commands, const scene::SceneInstant& instant, const View& viewer,
              std::span<const TexelTile> sorted);
  uint32_t material_of(const TexelTile& tile) const {
    return scene.scene().instances[tile.instance].material;
  }
};

Status TexelShader::Impl::create_patches() {
  std::vector<PatchRecord> records;
  const scene::Scene& s = scene.scene();
  for (uint32_t i = 0; i < s.instances.size(); ++i) {
    first_patch.push_back(static_cast<uint32_t>(records.size()));
    if (std::ranges::max(texture.size(i, 0).x, texture.size(i, 0).y) > 65535)
      return absl::InvalidArgumentError(
          absl::StrFormat("texel shading: the texture of instance %u has %ux%u texels, at most 65535 a side",
                          i, texture.size(i, 0).x, texture.size(i, 0).y));
    const scene::Geometry& geometry = s.geometries[s.instances[i].geometry];
    const uint32_t base = scene.first_index(s.instances[i].geometry) / 3;
    for (size_t p = 0; p < geometry.patches.size(); ++p) {
      const TexelRectangle& r = texture.patches(i)[p];
      records.push_back({base + geometry.patches[p].first_triangle, geometry.patches[p].triangle_count,
                         packed(r.x, r.y), packed(r.width, r.height)});
    }
  }
  TESSERA_ASSIGN_OR_RETURN(
      patches, gpu::Buffer::create_filled(device, std::as_bytes(std::span(records)), "texel patches"));
  groups.set(kPatches, patches);
  return absl::OkStatus();
}

Status TexelShader::Impl::create() {
  constexpr gpu::Binding kBindings[] = {{kTiles, gpu::BindingKind::storage_buffer},
                                        {kInverseMap, gpu::BindingKind::storage_buffer},
                                        {kPatches, gpu::BindingKind::storage_buffer},
                                        {kPool, gpu::BindingKind::storage_image}};
  TESSERA_ASSIGN_OR_RETURN(groups, shading::MaterialGroups::create(device, scene, kBindings));
  TESSERA_RETURN_IF_ERROR(create_patches());
  std::vector<gpu::Constant> constants = scene.constants();
  for (const gpu::Constant& c : lighting.constants()) constants.push_back(c);
  TESSERA_ASSIGN_OR_RETURN(
      pipeline, gpu::ComputePipeline::create(device, {.name = "texel shading",
                                                      .shader = texel_shading_comp,
                                                      .layouts = {&scene.layout(), &scene.instant_layout(),
                                                                  &lighting.layout(), &groups.layout()},
                                                      .push_bytes = sizeof(shading::PassPush),
                                                      .constants = constants}));
  return absl::OkStatus();
}

Status TexelShader::Impl::fit(uint32_t tile_count) {
  const auto grow = [&](uint32_t binding, gpu::Buffer& buffer, uint64_t bytes) -> Status {
    TESSERA_ASSIGN_OR_RETURN(const bool is_new,
                             shading::grow(device, buffer, bytes, gpu::Memory::upload, "texel shading"));
    if (is_new) groups.set(binding, buffer);
    return absl::OkStatus();
  };
  TESSERA_RETURN_IF_ERROR(grow(kTiles, tiles, tile_count * sizeof(TileRecord)));
  TESSERA_RETURN_IF_ERROR(grow(kInverseMap, inverse_map, tile_count * kTexelTileTexels * sizeof(uint32_t)));
  const uint32_t rows = std::max(1u, (tile_count + kPoolColumns - 1) / kPoolColumns);
  if (rows <= pool_rows) return absl::OkStatus();
  pool_rows = rows;
  const gpu::ImageDesc desc{.width = kPoolColumns * kTexelTile, .height = rows * kTexelTile, .storage = true};
  TESSERA_ASSIGN_OR_RETURN(pool, gpu::Image::create(device, desc, "texel pool"));
  groups.set(kPool, pool);
  TESSERA_ASSIGN_OR_RETURN(readback, gpu::Buffer::create(device, uint64_t{4} * desc.width * desc.height,
                                                         gpu::Memory::readback, "texel readback"));
  return absl::OkStatus();
}

// Returns how many texels show something.
uint64_t TexelShader::Impl::upload(std::span<const TexelTile> sorted) {
  std::vector<TileRecord> records;
  std::vector<uint32_t> map;
  uint64_t samples = 0;
  records.reserve(sorted.size());
  map.reserve(sorted.size() * kTexelTileTexels);
  for (const TexelTile& tile : sorted) {
    records.push_back({tile.instance, tile.level, tile.x, tile.y});
    const uvec2 end = texture.size(tile.instance, tile.level);
    for (uint32_t i = 0; i < kTexelTileTexels; ++i) {
      const uvec2 at(tile.x * kTexelTile + i % kTexelTile, tile.y * kTexelTile + i / kTexelTile);
      const bool inside = at.x < end.x && at.y < end.y;
      const uint32_t patch = inside ? texture.texel(tile.instance, tile.level, at).patch : scene::kNone;
      map.push_back(patch == scene::kNone ? scene::kNone : first_patch[tile.instance] + patch);
      samples += patch != scene::kNone;
    }
  }
  shading::write<TileRecord>(tiles, records);
  shading::write<uint32_t>(inverse_map, map);
  return samples;
}

// A dispatch a material.
void TexelShader::Impl::record(gpu::Commands& commands, const scene::SceneInstant& instant,
                               const View& viewer, std::span<const TexelTile> sorted) {
  shading::PassPush push = shading::pass_of(viewer, instant.origin());
  push.width = kPoolColumns;
  push.height = pool_rows;
  commands.begin_interval("texel shading");
  for (uint32_t begin = 0; begin < sorted.size(); begin = push.end_chunk) {
    const uint32_t material = material_of(sorted[begin]);
    const auto same = [&](const TexelTile& tile) { return material_of(tile) == material; };
    push.first_chunk = begin;
    push.end_chunk =
        static_cast<uint32_t>(std::find_if_not(sorted.begin() + begin, sorted.end(), same) - sorted.begin());
    commands.bind(pipeline, {&scene.group(), &instant.group(), &lighting.group(), &groups.of(material)});
    commands.push(push);
    const uint32_t count = push.end_chunk - begin, groups_x = std::min(count, kMaxGroupsX);
    commands.dispatch(groups_x, (count + groups_x - 1) / groups_x);
  }
  commands.barrier();
  commands.end_interval();
}

TexelShader::TexelShader(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
TexelShader::~TexelShader() = default;

StatusOr<std::unique_ptr<TexelShader>> TexelShader::create(gpu::Device& device, const scene::GpuScene& scene,
                                                           const shading::Lighting& lighting,
                                                           const UniqueTexture& texture) {
  auto impl = std::unique_ptr<Impl>(
      new Impl{.device = device, .scene = scene, .lighting = lighting, .texture = texture});
  TESSERA_RETURN_IF_ERROR(impl->create());
  return std::unique_ptr<TexelShader>(new TexelShader(std::move(impl)));
}

StatusOr<ShadedTexels> TexelShader::shade(const scene::SceneInstant& instant, const View& viewer,
                                          std::span<const TexelTile> tiles) {
  Impl& s = *impl_;
  if (tiles.size() > kMaxTiles)
    return absl::InvalidArgumentError(
        absl::StrFormat("texel shading: %u tiles at a time, at most %u", tiles.size(), kMaxTiles));
  std::vector<uint32_t> order(tiles.size());
  std::iota(order.begin(), order.end(), 0u);
  std::ranges::stable_sort(order, {}, [&](uint32_t i) { return s.material_of(tiles[i]); });
  std::vector<TexelTile> sorted;
  for (const uint32_t i : order) sorted.push_back(tiles[i]);

  TESSERA_RETURN_IF_ERROR(s.fit(static_cast<uint32_t>(tiles.size())));
  ShadedTexels result;
  result.samples = s.upload(sorted);
  gpu::Commands commands = s.device.begin();
  commands.clear(s.pool, {0, 0, 0, 0});
  commands.barrier();
  s.record(commands, instant, viewer, sorted);
  commands.copy_to_buffer(s.pool, s.readback);
  commands.barrier();
  TESSERA_RETURN_IF_ERROR(s.device.run(std::move(commands)));
  for (const auto& interval : s.device.intervals())
    if (interval.name == "texel shading") result.gpu_ms = interval.ms;

  const auto pool = s.readback.as<const uint32_t>();
  constexpr uint32_t kStride = kPoolColumns * kTexelTile;
  result.colors.resize(tiles.size() * kTexelTileTexels);
  for (uint32_t slot = 0; slot < order.size(); ++slot) {
    const uint32_t x = slot % kPoolColumns * kTexelTile, y = slot / kPoolColumns * kTexelTile;
    for (uint32_t row = 0; row < kTexelTile; ++row)
      std::copy_n(&pool[(y + row) * size_t{kStride} + x], kTexelTile,
                  &result.colors[size_t{order[slot]} * kTexelTileTexels + row * kTexelTile]);
  }
  return result;
}

}  // namespace tessera::bench
