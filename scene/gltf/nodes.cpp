#include <cmath>

#include "scene/gltf/import.h"

namespace tessera::scene {
namespace {

std::string node_path(size_t node) {
  return absl::StrCat("/nodes/", node);
}

// Parent of each glTF node; -1 = root.
StatusOr<std::vector<int>> find_parents(const Document& document) {
  const auto& nodes = document.model().nodes;
  std::vector<int> parents(nodes.size(), -1);
  for (size_t i = 0; i < nodes.size(); ++i) {
    for (size_t c = 0; c < nodes[i].children.size(); ++c) {
      int& parent = parents[static_cast<size_t>(nodes[i].children[c])];
      if (parent >= 0) {
        return document.error(
            absl::StrFormat("/nodes/%d/children/%d", i, c),
            absl::StrFormat("node %d is a child of node %d already", nodes[i].children[c], parent));
      }
      parent = static_cast<int>(i);
    }
  }
  return parents;
}

// With one parent each, a node that no root leads to hangs on a cycle.
Status check_cycles(const Document& document, const std::vector<int>& parents) {
  const auto& nodes = document.model().nodes;
  std::vector<int> reached;
  for (size_t i = 0; i < nodes.size(); ++i) {
    if (parents[i] < 0) reached.push_back(static_cast<int>(i));
  }
  std::vector<bool> seen(nodes.size());
  for (size_t r = 0; r < reached.size(); ++r) {
    seen[static_cast<size_t>(reached[r])] = true;
    const auto& children = nodes[static_cast<size_t>(reached[r])].children;
    reached.insert(reached.end(), children.begin(), children.end());
  }
  for (size_t i = 0; i < nodes.size(); ++i) {
    if (!seen[i]) return document.error(node_path(i) + "/children", "the node is its own ancestor");
  }
  return absl::OkStatus();
}

StatusOr<std::vector<int>> scene_roots(const Document& document, const std::vector<int>& parents) {
  const tinygltf::Model& model = document.model();
  std::vector<int> roots;
  if (model.scenes.empty()) {
    for (size_t i = 0; i < parents.size(); ++i) {
      if (parents[i] < 0) roots.push_back(static_cast<int>(i));
    }
    return roots;
  }
  const auto scene = static_cast<size_t>(std::max(model.defaultScene, 0));
  std::vector<bool> seen(parents.size());
  for (size_t i = 0; i < model.scenes[scene].nodes.size(); ++i) {
    const int root = model.scenes[scene].nodes[i];
    const std::string path = absl::StrFormat("/scenes/%d/nodes/%d", scene, i);
    if (parents[static_cast<size_t>(root)] >= 0)
      return document.error(path, absl::StrFormat("node %d is not a root", root));
    if (seen[static_cast<size_t>(root)])
      return document.error(path, absl::StrFormat("node %d is listed twice", root));
    seen[static_cast<size_t>(root)] = true;
    roots.push_back(root);
  }
  return roots;
}

StatusOr<dmat4> read_matrix(const Document& document, const std::vector<double>& values,
                            const std::string& path) {
  dmat4 m;
  for (int i = 0; i < 16; ++i) m[i / 4][i % 4] = values[static_cast<size_t>(i)];
  if (m[0][3] != 0 || m[1][3] != 0 || m[2][3] != 0 || m[3][3] != 1) {
    return document.error(path + "/matrix",
                          "the last row is not 0 0 0 1: only affine transforms are supported");
  }
  return m;
}

StatusOr<Node> read_node(const Document& document, int index) {
  const tinygltf::Node& source = document.model().nodes[static_cast<size_t>(index)];
  const std::string path = node_path(static_cast<size_t>(index));
  Node node;
  node.name = source.name;
  if (!source.matrix.empty()) {
    TESSERA_ASSIGN_OR_RETURN(node.matrix, read_matrix(document, source.matrix, path));
  }
  if (!source.translation.empty())
    node.translation = {source.translation[0], source.translation[1], source.translation[2]};
  if (!source.scale.empty()) node.scale = {source.scale[0], source.scale[1], source.scale[2]};
  if (!source.rotation.empty()) {
    const dquat q(source.rotation[3], source.rotation[0], source.rotation[1], source.rotation[2]);
    const double length = glm::length(q);
    if (!std::isfinite(length) || length < 1e-6)
      return document.error(path + "/rotation", "is not a unit quaternion");
    node.rotation = q / length;
  }
  return node;
}

}  // namespace

StatusOr<std::vector<uint32_t>> import_nodes(const Document& document, Scene& scene) {
  const auto& nodes = document.model().nodes;
  TESSERA_ASSIGN_OR_RETURN(const std::vector<int> parents, find_parents(document));
  TESSERA_RETURN_IF_ERROR(check_cycles(document, parents));
  TESSERA_ASSIGN_OR_RETURN(std::vector<int> order, scene_roots(document, parents));
  std::vector<uint32_t> node_of(nodes.size(), kNone);
  for (size_t i = 0; i < order.size(); ++i) {
    const auto index = static_cast<size_t>(order[i]);
    TESSERA_ASSIGN_OR_RETURN(Node node, read_node(document, order[i]));
    node.parent = parents[index] < 0 ? kNone : node_of[static_cast<size_t>(parents[index])];
    node_of[index] = static_cast<uint32_t>(scene.nodes.size());
    scene.nodes.push_back(std::move(node));
    order.insert(order.end(), nodes[index].children.begin(), nodes[index].children.end());
  }
  return node_of;
}

void mark_moving_nodes(Scene& scene) {
  for (const AnimationChannel& channel : scene.animations) scene.nodes[channel.node].moves = true;
  for (Node& node : scene.nodes) {
    if (node.parent != kNone) node.moves |= scene.nodes[node.parent].moves;
  }
}

void import_lights(const Document& document, const std::vector<uint32_t>& node_of, Scene& scene) {
  const tinygltf::Model& model = document.model();
  for (size_t i = 0; i < model.nodes.size(); ++i) {
    const auto extension = model.nodes[i].extensions.find("KHR_lights_punctual");
    if (node_of[i] == kNone || extension == model.nodes[i].extensions.end()) continue;
    const tinygltf::Light& source =
        model.lights[static_cast<size_t>(extension->second.Get("light").GetNumberAsInt())];
    Light light;
    light.type = source.type == "directional" ? LightType::directional
                 : source.type == "spot"      ? LightType::spot
                                              : LightType::point;
    if (!source.color.empty()) light.color = vec3(source.color[0], source.color[1], source.color[2]);
    light.intensity = static_cast<float>(source.intensity);
    light.range = static_cast<float>(source.range);
    light.outer_cone_rad = static_cast<float>(source.spot.outerConeAngle);
    light.inner_cone_rad = std::min(static_cast<float>(source.spot.innerConeAngle), light.outer_cone_rad);
    light.node = node_of[i];
    scene.lights.push_back(light);
  }
}

}  // namespace tessera::scene
