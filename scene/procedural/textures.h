// Textures computed from noise; all tile.
#pragma once

#include "scene/scene.h"

namespace tessera::scene {

// What a surface's textures are made from: colour, height (for the normal map) and roughness at each texel.
struct Surface {
  Texture color;               // sRGB; alpha for masks
  Texture normal;              // +Y up
  Texture metallic_roughness;  // glTF: G roughness, B metallic
};

Surface marble_tiles();  // 2 x 2 checkered tiles with joints
Surface stone();         // coursed blocks
Surface plaster();
Surface wood();
Surface brushed_metal();
Surface brick();
Surface roof_tiles();
Surface asphalt();

Texture leaf_mask();        // one leaf, alpha outside it 0
Texture foliage_mask();     // a bough of many leaves
Texture chain_link_mask();  // wire mesh

}  // namespace tessera::scene
