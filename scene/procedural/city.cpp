// A grid of blocks with instanced houses and trees; as many blocks as the wanted triangle count takes.
#include <algorithm>
#include <cmath>

#include "scene/procedural.h"
#include "scene/procedural/builder.h"
#include "scene/procedural/shapes.h"

namespace tessera::scene {
namespace {

constexpr double kPitchM = 48;  // from road to road
constexpr float kRoadM = 8;
constexpr uint64_t kMaxTriangles = 500'000'000;

struct Part {
  uint32_t geometry, material;
};
using Thing = std::vector<Part>;  // placed with one node

struct HouseType {
  float width, depth, floors;
  bool gable;
  uint32_t walls;
};

class City {
 public:
  explicit City(uint64_t triangles)
      : wanted_(std::clamp<uint64_t>(triangles, 1, kMaxTriangles)), build_("city") {}

  std::shared_ptr<Scene> run() {
    make_materials();
    for (const HouseType& type : {HouseType{9, 8, 2, true, brick_}, HouseType{8, 9, 2, true, plaster_},
                                  HouseType{10, 9, 4, false, stone_}, HouseType{8, 8, 3, true, stone_},
                                  HouseType{9, 9, 5, false, brick_}}) {
      houses_.push_back(make_house(type));
    }
    make_ground();
    make_tree();
    place_blocks();
    build_.add_light({LightType::directional, vec3(1, 0.95f, 0.88f), 3}, dvec3(0), dvec3(-0.5, -0.8, -0.35));
    return build_.finish(0);
  }

 private:
  void make_materials() {
    brick_ = build_.add_material("brick", brick());
    plaster_ = build_.add_material("plaster", plaster());
    stone_ = build_.add_material("stone", stone());
    roof_ = build_.add_material("roof tiles", roof_tiles());
    wood_ = build_.add_material("wood", wood());
    road_ = build_.add_material("asphalt", asphalt());
    foliage_ = build_.add_cutout("foliage", foliage_mask(), 0.7f);
    Material glass;
    glass.name = "window";
    glass.base_color = vec4(0.03f, 0.04f, 0.06f, 1);
    glass.metallic = 0;
    glass.roughness = 0.08f;
    glass_ = build_.add_material(glass);
    Material grass;
    grass.name = "lawn";
    grass.base_color = vec4(0.08f, 0.16f, 0.04f, 1);
    grass.metallic = 0;
    lawn_ = build_.add_material(grass);
  }

  // One wall from `origin` along `right` with a row of windows a floor.
  static void add_facade(SourceMesh& walls, SourceMesh& frames, SourceMesh& panes, vec3 origin, vec3 right,
                         float floors) {
    const float width = glm::length(right), height = 3 * floors;
    const vec3 along = right / width, up(0, 1, 0), out = glm::cross(along, up);
    add_quad(walls, origin, right, height * up, 2, 1);
    const int windows = static_cast<int>(width / 2.4f);
    for (int f = 0; f < static_cast<int>(floors); ++f) {
      for (int w = 0; w < windows; ++w) {
        const float x = width * (static_cast<float>(w) + 0.5f) / static_cast<float>(windows);
        const vec3 low = origin + along * (x - 0.5f) + up * (3 * static_cast<float>(f) + 0.9f);
        add_quad(panes, low + 0.03f * out, along, 1.5f * up, 1, 0.75f);
        const vec3 middle = low + 0.5f * along + 0.75f * up + 0.04f * out;
        for (const float side : {-0.53f, 0.f, 0.53f}) {
          add_box(frames, middle + side * along, glm::abs(0.06f * along + 1.56f * up + 0.08f * out), 1, 0.8f);
        }
        for (const float rise : {-0.78f, 0.f, 0.78f}) {
          add_box(frames, middle + rise * up, glm::abs(1.12f * along + 0.06f * up + 0.09f * out), 1, 0.6f);
        }
      }
    }
  }

  static void add_gable(SourceMesh& walls, SourceMesh& roof, float w, float d, float h) {
    const float rise = 0.35f * d, over = 0.4f;
    for (const float side : {-1.f, 1.f}) {
      const vec3 eaves(-side * (0.5f * w + over), h - 0.14f, side * (0.5f * d + over));
      add_quad(roof, eaves, vec3(side * (w + 2 * over), 0, 0),
               vec3(0, rise + 0.28f, -side * (0.5f * d + over)), 2, 0.8f);
      add_surface(walls, 8, 6, vec2(d, rise) * 0.5f, [&](float u, float v) {
        return vec3(side * 0.5f * w, h + rise * v, side * d * (0.5f - u) * (1 - v));
      });
    }
  }

  Thing make_house(const HouseType& type) {
    const float w = type.width, d = type.depth, h = 3 * type.floors;
    SourceMesh walls, frames, panes, roof;
    add_facade(walls, frames, panes, vec3(-0.5f * w, 0, 0.5f * d), vec3(w, 0, 0), type.floors);
    add_facade(walls, frames, panes, vec3(0.5f * w, 0, -0.5f * d), vec3(-w, 0, 0), type.floors);
    add_facade(walls, frames, panes, vec3(0.5f * w, 0, 0.5f * d), vec3(0, 0, -d), type.floors);
    add_facade(walls, frames, panes, vec3(-0.5f * w, 0, -0.5f * d), vec3(0, 0, d), type.floors);
    if (type.gable) {
      add_gable(walls, roof, w, d, h);
      add_box(walls, vec3(0.25f * w, h + 0.3f * d, 0.1f * d), vec3(0.7f, 1.6f, 0.7f), 2, 0.5f);
    } else {
      add_box(roof, vec3(0, h + 0.15f, 0), vec3(w + 0.5f, 0.3f, d + 0.5f), 2, 1);
      for (int i = 0; i < 3; ++i)
        add_pipe(frames, vec3(i - 1, h, -1), vec3(i - 1, h + 2.5f, -1), 0.05f, 8, 3);
    }
    return {{build_.add_geometry("walls", walls), type.walls},
            {build_.add_geometry("window frames", frames), wood_},
            {build_.add_geometry("panes", panes), glass_},
            {build_.add_geometry("roof", roof), roof_}};
  }

  void make_tree() {
    SourceMesh trunk, crown;
    add_lathe(trunk, vec3(0), 2.6f, 10, 5, vec2(1, 2), [](float v) { return 0.22f - 0.1f * v; });
    for (int i = 0; i < 26; ++i) {
      const float turn = 2.399963f * static_cast<float>(i), y = 2.2f + 0.12f * static_cast<float>(i);
      const float spread = 1.35f * std::sin(3.1415927f * (static_cast<float>(i) + 3) / 31), size = 1.5f;
      const vec3 out(std::cos(turn), 0, std::sin(turn)), side(-std::sin(turn), 0, std::cos(turn));
      const vec3 tilt = glm::normalize(0.5f * out + vec3(0, 0.9f, 0));
      add_quad(crown, spread * out + vec3(0, y, 0) - 0.5f * size * (side + tilt), size * side, size * tilt,
               size, 0.75f);
    }
    tree_ = {{build_.add_geometry("trunk", trunk), wood_}, {build_.add_geometry("crown", crown), foliage_}};
  }

  void make_ground() {
    SourceMesh road, lawn;
    const auto p = static_cast<float>(kPitchM), half = 0.5f * kRoadM;
    // Two strips a block, half of each road belonging to either side's block.
    add_quad(road, vec3(-half, 0, p - half), vec3(kRoadM, 0, 0), vec3(0, 0, -p), 4, 2);
    add_quad(road, vec3(half, 0, half), vec3(p - kRoadM, 0, 0), vec3(0, 0, -kRoadM), 4, 2);
    add_box(lawn, vec3(0.5f * p, 0, 0.5f * p), vec3(p - kRoadM, 0.24f, p - kRoadM), 4, 2);
    ground_ = {{build_.add_geometry("road", road), road_}, {build_.add_geometry("lawn", lawn), lawn_}};
  }

  void place(const Thing& thing, const dvec3& at, double turn_rad, double scale = 1) {
    const uint32_t node = build_.add_node(at, glm::angleAxis(turn_rad, dvec3(0, 1, 0)), dvec3(scale));
    for (const Part& part : thing) {
      build_.place(part.geometry, part.material, node);
      placed_ += build_.triangle_count(part.geometry);
    }
  }

  // Houses face the roads on two sides of a block, trees stand between them.
  void place_block(int x, int z) {
    const dvec3 corner(x * kPitchM, 0, z * kPitchM);
    place(ground_, corner, 0);
    for (int i = 0; i < 6; ++i) {
      const bool far_row = i >= 3;
      const auto type = static_cast<size_t>(std::abs(7 * x + 3 * z + 2 * i)) % houses_.size();
      place(houses_[type], corner + dvec3(11 + 13 * (i % 3), 0.12, far_row ? 36 : 12),
            far_row ? 0 : 3.14159265);
    }
    for (int i = 0; i < 8; ++i) {
      place(tree_, corner + dvec3(7.5 + 4.7 * i, 0.12, 24 + 3.5 * ((5 * i + x) % 3 - 1)), 1.7 * i + x,
            0.8 + 0.12 * ((i + z * z) % 4));
    }
  }

  // In growing squares around the origin: the path runs through the middle.
  void place_blocks() {
    for (int ring = 0; placed_ < wanted_; ++ring) {
      for (int z = -ring - 1; z <= ring; ++z) {
        for (int x = -ring - 1; x <= ring; ++x) {
          const bool in_ring = std::max({x, z, -x - 1, -z - 1}) == ring;
          if (in_ring && placed_ < wanted_) place_block(x, z);
        }
      }
    }
  }

  uint64_t wanted_, placed_ = 0;
  SceneBuilder build_;
  std::vector<Thing> houses_;
  Thing tree_, ground_;
  uint32_t brick_, plaster_, stone_, roof_, wood_, road_, foliage_, glass_, lawn_;
};

}  // namespace

std::shared_ptr<Scene> make_city(uint64_t triangles) {
  return City(triangles).run();
}

CameraPath city_path() {
  constexpr double kSeconds = 30, kRate = 60, kTauD = 6.283185307179586;
  std::vector<TimedPose> poses;
  for (int i = 0; i <= kSeconds * kRate; ++i) {
    const double t = i / kRate;
    const dvec3 position(1.5 * std::sin(kTauD * t / 15), 1.7 + 0.02 * std::sin(kTauD * 1.8 * t),
                         20 - 1.4 * t);
    const double yaw = 0.8 * std::sin(kTauD * t / 9), pitch = 0.1 + 0.1 * std::sin(kTauD * t / 6);
    poses.push_back({from_seconds(t),
                     {position, look_along(dvec3(std::sin(yaw) * std::cos(pitch), std::sin(pitch),
                                                 -std::cos(yaw) * std::cos(pitch)))}});
  }
  return CameraPath(std::move(poses));
}

}  // namespace tessera::scene
