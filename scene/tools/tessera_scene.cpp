// tessera-scene: what is in a scene file, and whether it can be used.
#include <CLI/CLI.hpp>
#include <chrono>
#include <iostream>
#include <nlohmann/json.hpp>

#include "base/log.h"
#include "scene/gltf.h"
#include "scene/procedural.h"

namespace {

using nlohmann::json;
using tessera::StatusOr;
namespace scene = tessera::scene;

constexpr int kOk = 0, kInvalid = 1, kUsage = 2;

struct Arguments {
  std::string spec;
  bool as_json = false;
  float max_edge_m = 0;
};

struct Loaded {
  std::shared_ptr<scene::Scene> scene;
  scene::ImportNotes notes;
  double seconds = 0;
};

bool is_file(const std::string& spec) {
  return spec.ends_with(".glb") || spec.ends_with(".gltf");
}

StatusOr<Loaded> load(const Arguments& arguments) {
  const auto start = std::chrono::steady_clock::now();
  Loaded loaded;
  scene::ImportOptions options;
  options.max_edge_m = arguments.max_edge_m;
  TESSERA_ASSIGN_OR_RETURN(
      loaded.scene, is_file(arguments.spec)
                        ? scene::load_gltf(std::filesystem::path(arguments.spec), options, &loaded.notes)
                        : scene::load_scene(arguments.spec));
  loaded.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return loaded;
}

json counts_of(const scene::Scene& s) {
  size_t meshlets = 0;
  for (const scene::Geometry& g : s.geometries) meshlets += g.meshlets.size();
  return {{"geometries", s.geometries.size()},
          {"instances", s.instances.size()},
          {"nodes", s.nodes.size()},
          {"materials", s.materials.size()},
          {"textures", s.textures.size()},
          {"lights", s.lights.size()},
          {"animation_channels", s.animations.size()},
          {"meshlets", meshlets},
          {"unique_triangles", s.features.unique_triangles},
          {"instanced_triangles", s.features.instanced_triangles},
          {"instanced_patches", s.features.instanced_patches}};
}

// Shares of the patches with one, two and three triangles, over unique geometries.
json patch_shares_of(const scene::Scene& s) {
  std::array<uint64_t, 4> patches{};
  uint64_t all = 0;
  for (const scene::Geometry& g : s.geometries) {
    for (const scene::Patch& p : g.patches) ++patches[p.triangle_count], ++all;
  }
  const auto share = [&](int n) {
    return static_cast<double>(patches[static_cast<size_t>(n)]) / static_cast<double>(all);
  };
  return {{"one_triangle", share(1)}, {"two_triangles", share(2)}, {"three_triangles", share(3)}};
}

json features_of(const scene::Features& f) {
  return {{"directional_lights", f.directional_lights},
          {"point_lights", f.point_lights},
          {"spot_lights", f.spot_lights},
          {"alpha_mask", f.alpha_mask},
          {"alpha_blend", f.alpha_blend},
          {"double_sided", f.double_sided},
          {"unlit", f.unlit},
          {"normal_maps", f.normal_maps},
          {"metallic_roughness_maps", f.metallic_roughness_maps},
          {"emissive", f.emissive},
          {"occlusion_maps", f.occlusion_maps},
          {"vertex_colors", f.vertex_colors},
          {"second_texcoord", f.second_texcoord},
          {"rigid_animation", f.rigid_animation},
          {"mirrored_instances", f.mirrored_instances},
          {"largest_triangle_m2", f.largest_triangle_m2},
          {"most_slanted_triangle", f.most_slanted_triangle}};
}

json memory_of(const scene::Scene& s) {
  uint64_t geometry = 0, textures = 0;
  for (const scene::Geometry& g : s.geometries) {
    geometry += g.vertices.size() * sizeof(scene::Vertex) + g.indices.size() * sizeof(uint32_t) +
                g.patches.size() * sizeof(scene::Patch) + g.meshlets.size() * sizeof(scene::Meshlet);
  }
  for (const scene::Texture& t : s.textures) textures += t.rgba.size();
  return {{"geometry_bytes", geometry}, {"texture_bytes", textures}};
}

json report_of(const Arguments& arguments, const Loaded& loaded) {
  const tessera::Aabb box = loaded.scene->world_bounds(0);
  return {
      {"schema", "tessera.scene.v1"},
      {"scene", arguments.spec},
      {"seconds", loaded.seconds},
      {"counts", counts_of(*loaded.scene)},
      {"patch_shares", patch_shares_of(*loaded.scene)},
      {"features", features_of(loaded.scene->features)},
      {"bounds", {{"min", {box.min.x, box.min.y, box.min.z}}, {"max", {box.max.x, box.max.y, box.max.z}}}},
      {"memory", memory_of(*loaded.scene)},
      {"animation_length_s", loaded.scene->animation_length_s},
      {"notes", loaded.notes.notes}};
}

void print_section(const std::string& title, const json& section) {
  std::cout << title << "\n";
  for (const auto& [key, value] : section.items()) {
    std::cout << "  " << key << std::string(key.size() < 26 ? 26 - key.size() : 1, ' ') << value << "\n";
  }
}

void print_text(const json& report) {
  std::cout << report["scene"].get<std::string>() << ": loaded in " << report["seconds"] << " s\n";
  for (const char* section : {"counts", "patch_shares", "features", "bounds", "memory"})
    print_section(section, report[section]);
  std::cout << "notes\n";
  for (const auto& note : report["notes"]) std::cout << "  " << note.get<std::string>() << "\n";
}

int fail(const Arguments& arguments, const tessera::Status& status) {
  if (arguments.as_json) {
    std::cout << json{{"schema", "tessera.scene.v1"},
                      {"scene", arguments.spec},
                      {"valid", false},
                      {"error", status.message()}}
                     .dump(2)
              << "\n";
  } else {
    std::cerr << status.message() << "\n";
  }
  return kInvalid;
}

int info(const Arguments& arguments) {
  const StatusOr<Loaded> loaded = load(arguments);
  if (!loaded.ok()) return fail(arguments, loaded.status());
  const json report = report_of(arguments, *loaded);
  arguments.as_json ? void(std::cout << report.dump(2) << "\n") : print_text(report);
  return kOk;
}

int validate(const Arguments& arguments) {
  const StatusOr<Loaded> loaded = load(arguments);
  if (!loaded.ok()) return fail(arguments, loaded.status());
  if (arguments.as_json) {
    std::cout << json{{"schema", "tessera.scene.v1"},
                      {"scene", arguments.spec},
                      {"valid", true},
                      {"notes", loaded->notes.notes}}
                     .dump(2)
              << "\n";
    return kOk;
  }
  for (const std::string& note : loaded->notes.notes) std::cout << "note: " << note << "\n";
  std::cout << arguments.spec << ": valid\n";
  return kOk;
}

void add_arguments(CLI::App& command, Arguments& arguments) {
  command
      .add_option("FILE", arguments.spec, "A .glb or .gltf file, gallery[:detail 0..2] or city[:triangles]")
      ->required();
  command.add_flag("--json", arguments.as_json, "Print JSON");
  command.add_option(
      "--max-edge", arguments.max_edge_m,
      "Split edges longer than this many metres (0: as far as 15 % more triangles allow; < 0: never)");
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("tessera-scene: looks into scenes and checks them", "tessera-scene");
  app.footer(
      "Examples:\n"
      "  tessera-scene info chair.glb\n"
      "  tessera-scene info gallery:2 --json\n"
      "  tessera-scene validate upload.glb && echo usable\n\n"
      "Exit codes: 0 the scene is valid, 1 it is not (the message names the place), 2 wrong usage.");
  app.require_subcommand(1);
  Arguments arguments;
  CLI::App* info_command =
      app.add_subcommand("info", "Counts, features, bounds, memory, and notes of the import");
  CLI::App* validate_command = app.add_subcommand("validate", "Says whether the scene can be used");
  add_arguments(*info_command, arguments);
  add_arguments(*validate_command, arguments);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? kOk : kUsage;
  }
  tessera::init_logging("warn");
  return info_command->parsed() ? info(arguments) : validate(arguments);
}
