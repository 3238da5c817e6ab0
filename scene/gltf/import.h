// The steps of load_gltf(), in this order. Each reads the checked document and fills its part of the scene.
#pragma once

#include <vector>

#include "scene/gltf/document.h"

namespace tessera::scene {

// The nodes of the file's scene, parents first. Returns the scene's node index of each glTF node, kNone if it
// is not in the scene. Cycles and nodes with two parents are errors.
StatusOr<std::vector<uint32_t>> import_nodes(const Document& document, Scene& scene);

// Sets Node::moves and Scene::animation_length_s too.
Status import_animations(const Document& document, const std::vector<uint32_t>& node_of, Scene& scene);

void import_lights(const Document& document, const std::vector<uint32_t>& node_of, Scene& scene);

// Materials and the textures that they use, decoded. Material i is the file's material i; one default
// material follows them, for primitives without one.
Status import_materials(const Document& document, Scene& scene, ImportNotes& notes);

// Geometries and instances. Primitives that refer to the same accessors become one geometry.
Status import_meshes(const Document& document, const std::vector<uint32_t>& node_of,
                     const ImportOptions& options, Scene& scene, ImportNotes& notes);

// Sets Node::moves from Scene::animations.
void mark_moving_nodes(Scene& scene);

}  // namespace tessera::scene
