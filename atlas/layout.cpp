#include "atlas/layout.h"

#include "atlas/blocks/layout.h"
#include "atlas/coherent/layout.h"
#include "atlas/tessellated/layout.h"

namespace tessera::atlas {

LayoutSettings layout_settings(LayoutKind kind, uint32_t width, uint32_t height) {
  if (kind == LayoutKind::blocks) return blocks::settings_for(width, height);
  return {.kind = kind, .width = width, .height = height};
}

StatusOr<std::unique_ptr<Layout>> create_layout(const scene::Scene& scene, const LayoutSettings& settings) {
  if (settings.kind == LayoutKind::blocks) return blocks::Layout::create(scene, settings);
  if (settings.kind == LayoutKind::tessellated) return tessellated::Layout::create(scene, settings);
  return coherent::Layout::create(scene, settings);
}

}  // namespace tessera::atlas
