// The demo's scene: a sunlit hall, 24 m long along z, 10 m wide, 6 m high.
#include <algorithm>
#include <cmath>

#include "scene/procedural.h"
#include "scene/procedural/builder.h"
#include "scene/procedural/shapes.h"

namespace tessera::scene {
namespace {

constexpr float kHalfWidth = 5, kHalfLength = 12, kHeight = 6, kColumnX = 3;
constexpr int kColumns = 6;  // in each row
constexpr float kColumnSpacing = 4;
constexpr double kLoopSeconds = 16;

float column_z(int i) {
  return kColumnSpacing * (static_cast<float>(i) - 0.5f * (kColumns - 1));
}

// What `detail` scales.
struct Detail {
  float cell_m;          // quads of flat surfaces
  uint32_t sides, rows;  // of columns
  uint32_t pipe_sides, sphere, knot, leaves, leaf_rows;
};
constexpr Detail kDetails[] = {
    {8, 8, 1, 5, 8, 24, 10, 1}, {1.2f, 24, 6, 8, 24, 96, 40, 2}, {0.4f, 80, 16, 14, 64, 280, 110, 4}};

class Gallery {
 public:
  explicit Gallery(int detail) : d_(kDetails[std::clamp(detail, 0, 2)]), build_("gallery") {}

  std::shared_ptr<Scene> run() {
    make_materials();
    add_shell();
    add_colonnade();
    add_pipes();
    add_railing();
    add_fence();
    add_plants();
    add_exhibits();
    add_fans();
    add_cart();
    add_lights();
    return build_.finish(kLoopSeconds);
  }

 private:
  uint32_t plain(const std::string& name, vec3 color, float metallic, float roughness,
                 vec3 emissive = vec3(0)) {
    Material m;
    m.name = name;
    m.base_color = vec4(color, 1);
    m.metallic = metallic;
    m.roughness = roughness;
    m.emissive = emissive;
    return build_.add_material(m);
  }

  void make_materials() {
    floor_ = build_.add_material("marble", marble_tiles());
    stone_ = build_.add_material("stone", stone());
    plaster_ = build_.add_material("plaster", plaster());
    wood_ = build_.add_material("wood", wood());
    steel_ = build_.add_material("brushed steel", brushed_metal());
    copper_ = plain("copper", vec3(0.95f, 0.5f, 0.3f), 1, 0.28f);
    gold_ = plain("gold", vec3(1, 0.72f, 0.3f), 1, 0.2f);
    red_ = plain("red plastic", vec3(0.6f, 0.03f, 0.03f), 0, 0.25f);
    blue_ = plain("blue plastic", vec3(0.03f, 0.1f, 0.5f), 0, 0.35f);
    clay_ = plain("clay", vec3(0.45f, 0.18f, 0.09f), 0, 0.85f);
    iron_ = plain("painted iron", vec3(0.05f, 0.06f, 0.06f), 0, 0.45f);
    lamp_ = plain("lamp", vec3(0.9f), 0, 0.5f, vec3(1, 0.72f, 0.4f));
    leaf_ = build_.add_cutout("leaf", leaf_mask(), 0.6f);
    fence_ = build_.add_cutout("chain link", chain_link_mask(), 0.4f);
  }

  void add_shell() {
    const float w = kHalfWidth, l = kHalfLength, h = kHeight, cell = d_.cell_m;
    SourceMesh floor, walls, roof, beams;
    add_quad(floor, vec3(-w, 0, l), vec3(2 * w, 0, 0), vec3(0, 0, -2 * l), 2, cell);
    add_quad(walls, vec3(-w, 0, l), vec3(0, 0, -2 * l), vec3(0, h, 0), 2, cell);
    add_quad(walls, vec3(-w, 0, -l), vec3(2 * w, 0, 0), vec3(0, h, 0), 2, cell);
    add_quad(walls, vec3(w, 0, l), vec3(-2 * w, 0, 0), vec3(0, h, 0), 2, cell);
    // The sunny side: a parapet, piers and a lintel around open windows.
    add_box(walls, vec3(w + 0.2f, 0.5f, 0), vec3(0.4f, 1, 2 * l), 2, cell);
    add_box(walls, vec3(w + 0.2f, h - 0.6f, 0), vec3(0.4f, 1.2f, 2 * l), 2, cell);
    for (int i = 0; i <= kColumns; ++i) {
      add_box(walls, vec3(w + 0.2f, 2.9f, column_z(i) - 0.5f * kColumnSpacing), vec3(0.4f, 3.8f, 0.7f), 2,
              cell);
    }
    // The roof leaves a skylight over the nave.
    for (const float side : {-1.f, 1.f}) {
      add_box(roof, vec3(side * (0.5f * w + 0.6f), h + 0.15f, 0), vec3(w - 1.2f, 0.3f, 2 * l), 2, cell);
    }
    for (int i = 0; i < kColumns; ++i) {
      add_box(beams, vec3(0, h - 0.15f, column_z(i)), vec3(2 * w, 0.3f, 0.24f), 1, 2 * cell);
    }
    build_.add("floor", floor, floor_);
    build_.add("walls", walls, plaster_);
    build_.add("roof", roof, plaster_);
    build_.add("beams", beams, wood_);
  }

  void add_colonnade() {
    SourceMesh shaft, blocks, arch;
    add_fluted_shaft(shaft, vec3(0, 0.35f, 0), 0.34f, 3.3f, d_.sides / 4, d_.sides, d_.rows);
    add_box(blocks, vec3(0, 0.12f, 0), vec3(0.95f, 0.24f, 0.95f));
    add_lathe(blocks, vec3(0, 0.24f, 0), 0.12f, d_.sides, std::max(2u, d_.rows / 2), vec2(3, 0.2f),
              [](float v) { return 0.44f - 0.09f * v * v; });
    add_lathe(blocks, vec3(0, 3.6f, 0), 0.2f, d_.sides, std::max(2u, d_.rows / 2), vec2(3, 0.2f),
              [](float v) { return 0.29f + 0.15f * v * v; });
    add_box(blocks, vec3(0, 3.9f, 0), vec3(0.95f, 0.2f, 0.95f));
    add_arch(arch, vec3(0, 4, 0), vec3(0, 0, 1), 0.5f * kColumnSpacing - 0.42f, 0.28f, 0.5f, d_.sides);
    const uint32_t shaft_geometry = build_.add_geometry("shaft", shaft),
                   blocks_geometry = build_.add_geometry("base and capital", blocks);
    const uint32_t arch_geometry = build_.add_geometry("arch", arch);
    for (const float side : {-1.f, 1.f}) {
      for (int i = 0; i < kColumns; ++i) {
        const uint32_t node = build_.add_node(dvec3(side * kColumnX, 0, column_z(i)));
        build_.place(shaft_geometry, stone_, node);
        build_.place(blocks_geometry, stone_, node);
        if (i + 1 < kColumns) {
          build_.place(arch_geometry, stone_,
                       build_.add_node(dvec3(side * kColumnX, 0, column_z(i) + 0.5f * kColumnSpacing)));
        }
      }
    }
  }

  // Thin and long: the most slanted triangles of the scene.
  void add_pipes() {
    SourceMesh copper, steel;
    const float x = -kHalfWidth + 0.12f;
    for (int i = 0; i < 5; ++i) {
      const float y = 3.2f + 0.16f * static_cast<float>(i);
      add_pipe(i % 2 ? steel : copper, vec3(x, y, -kHalfLength), vec3(x, y, kHalfLength),
               0.022f + 0.008f * static_cast<float>(i % 3), d_.pipe_sides, d_.rows / 2 + 1);
    }
    for (int i = 0; i < 8; ++i) {
      const float z = -10.5f + 3 * static_cast<float>(i);
      add_pipe(i % 2 ? copper : steel, vec3(x, 0, z), vec3(x, 3.2f + 0.16f * static_cast<float>(i % 5), z),
               0.02f, d_.pipe_sides, 2);
    }
    build_.add("copper pipes", copper, copper_);
    build_.add("steel pipes", steel, steel_);
  }

  void add_railing() {
    SourceMesh rails, posts;
    const float x = 4.75f;
    for (const float y : {0.35f, 0.65f, 0.95f}) {
      add_pipe(rails, vec3(x, 1 + y, -kHalfLength), vec3(x, 1 + y, kHalfLength), 0.018f, d_.pipe_sides,
               d_.rows / 2 + 1);
    }
    for (float z = -11.5f; z < 11.6f; z += 1)
      add_pipe(posts, vec3(x, 1, z), vec3(x, 1.98f, z), 0.013f, d_.pipe_sides);
    build_.add("rails", rails, steel_);
    build_.add("posts", posts, iron_);
  }

  void add_fence() {
    SourceMesh mesh, frame;
    for (const int bay : {1, 3}) {
      const float z0 = column_z(bay) + 0.4f, z1 = column_z(bay + 1) - 0.4f, x = -kColumnX;
      add_quad(mesh, vec3(x, 0.1f, z1), vec3(0, 0, z0 - z1), vec3(0, 2, 0), 0.5f, d_.cell_m);
      add_pipe(frame, vec3(x, 2.1f, z0), vec3(x, 2.1f, z1), 0.025f, d_.pipe_sides);
      add_pipe(frame, vec3(x, 0.1f, z0), vec3(x, 0.1f, z1), 0.025f, d_.pipe_sides);
      for (const float z : {z0, z1}) add_pipe(frame, vec3(x, 0, z), vec3(x, 2.15f, z), 0.03f, d_.pipe_sides);
    }
    build_.add("fence", mesh, fence_);
    build_.add("fence frame", frame, iron_);
  }

  // Leaves bend outward from the middle of the pot, turned by the golden angle.
  SourceMesh make_leaves() const {
    SourceMesh mesh;
    for (uint32_t i = 0; i < d_.leaves; ++i) {
      const float share = (static_cast<float>(i) + 0.5f) / static_cast<float>(d_.leaves);
      const float turn = 2.399963f * static_cast<float>(i), length = 1.25f - 0.55f * share,
                  lift = 0.35f + 1.0f * (1 - share);
      const vec3 out(std::cos(turn), 0, std::sin(turn)), side(-std::sin(turn), 0, std::cos(turn));
      add_surface(mesh, 1, d_.leaf_rows, vec2(1), [&](float u, float v) {
        const float bow = v * v;
        return vec3(0, 0.5f, 0) + out * (0.05f + length * (0.35f * v + 0.45f * bow)) +
               vec3(0, length * (lift * v - 0.75f * bow), 0) + side * (0.3f * length * (u - 0.5f)) +
               vec3(0, 0.1f * std::abs(u - 0.5f), 0);
      });
    }
    return mesh;
  }

  void add_plants() {
    SourceMesh pot;
    add_lathe(pot, vec3(0), 0.5f, d_.sides, std::max(2u, d_.rows), vec2(4, 1),
              [](float v) { return 0.2f + 0.12f * v + 0.03f * (v > 0.85f); });
    add_disc(pot, vec3(0, 0.46f, 0), 0.3f, d_.sides);
    const uint32_t pot_geometry = build_.add_geometry("pot", pot),
                   leaves = build_.add_geometry("leaves", make_leaves());
    for (int i = 0; i < 8; ++i) {
      const float side = i % 2 ? 1.f : -1.f,
                  z = -10.f + 5.6f * static_cast<float>(i / 2) + (i % 2 ? 1.f : 0.f);
      // Some are mirrored, as artists do for variety.
      const uint32_t node = build_.add_node(dvec3(side * 4.1f, 0, z), glm::angleAxis(0.9 * i, dvec3(0, 1, 0)),
                                            dvec3(i % 3 == 2 ? -1 : 1, 0.85 + 0.06 * (i % 4), 1));
      build_.place(pot_geometry, clay_, node);
      build_.place(leaves, leaf_, node);
    }
  }

  void add_exhibits() {
    SourceMesh pedestal, knot, sphere;
    add_box(pedestal, vec3(0, 0.45f, 0), vec3(0.8f, 0.9f, 0.8f), 1, d_.cell_m);
    add_box(pedestal, vec3(0, 0.94f, 0), vec3(0.92f, 0.08f, 0.92f), 1, d_.cell_m);
    add_knot(knot, vec3(0), 0.42f, 0.085f, d_.knot, std::max(5u, d_.knot / 9));
    add_sphere(sphere, vec3(0), 0.3f, d_.sphere, d_.sphere / 2);
    const uint32_t pedestal_geometry = build_.add_geometry("pedestal", pedestal);
    const uint32_t knot_geometry = build_.add_geometry("knot", knot),
                   sphere_geometry = build_.add_geometry("sphere", sphere);
    const uint32_t knots[] = {gold_, red_, copper_}, spheres[] = {blue_, steel_, red_, gold_};
    for (int i = 0; i < 3; ++i) {
      const dvec3 at(0, 0, 6 * (i - 1));
      build_.place(pedestal_geometry, stone_, build_.add_node(at));
      const uint32_t turntable = build_.add_node(at + dvec3(0, 1.45, 0));
      build_.spin(turntable, i == 1 ? -2 : 1, kLoopSeconds);
      build_.place(knot_geometry, knots[i], turntable);
    }
    for (int i = 0; i < 4; ++i) {
      build_.place(sphere_geometry, spheres[i],
                   build_.add_node(dvec3(i % 2 ? 2.0 : -2.0, 0.3, 9.0 - 6.0 * i)));
    }
  }

  void add_fans() {
    SourceMesh hub, blades;
    add_pipe(hub, vec3(0, 0, 0), vec3(0, 0.9f, 0), 0.02f, d_.pipe_sides);
    add_sphere(hub, vec3(0), 0.1f, d_.sphere / 2, d_.sphere / 4);
    for (int i = 0; i < 4; ++i) {
      const float a = 0.25f * kTau * static_cast<float>(i);
      const vec3 out(std::cos(a), 0, std::sin(a)), side(-std::sin(a), 0, std::cos(a)),
          twist = 0.16f * side + vec3(0, 0.05f, 0);
      add_quad(blades, 0.1f * out - 0.5f * twist, 0.95f * out, twist, 1, d_.cell_m);
      add_quad(blades, 0.1f * out + 0.5f * twist, 0.95f * out, -twist, 1, d_.cell_m);
    }
    const uint32_t hub_geometry = build_.add_geometry("fan hub", hub),
                   blade_geometry = build_.add_geometry("fan blades", blades);
    for (const double z : {-4.0, 4.0}) {
      const uint32_t node = build_.add_node(dvec3(0, 4.9, z));
      build_.spin(node, z < 0 ? 8 : -6, kLoopSeconds);
      build_.place(hub_geometry, iron_, node);
      build_.place(blade_geometry, wood_, node);
    }
  }

  // Rolls to and fro along the windows; its wheels turn with the way.
  void add_cart() {
    SourceMesh body, load, wheel;
    add_box(body, vec3(0, 0.32f, 0), vec3(0.6f, 0.08f, 1.1f), 1, d_.cell_m);
    add_box(body, vec3(0, 0.62f, 0.52f), vec3(0.6f, 0.52f, 0.05f), 1, d_.cell_m);
    add_sphere(load, vec3(0, 0.62f, -0.1f), 0.26f, d_.sphere, d_.sphere / 2);
    add_lathe(wheel, vec3(0, -0.03f, 0), 0.06f, d_.sides, 1, vec2(4, 0.2f), [](float) { return 0.14f; });
    add_disc(wheel, vec3(0, 0.03f, 0), 0.14f, d_.sides);
    const uint32_t cart = build_.add_node(dvec3(3.9, 0, 8));
    constexpr float kReach = 7;
    build_.animate({cart,
                    AnimationPath::translation,
                    Interpolation::cubic_spline,
                    {0, 0.5 * kLoopSeconds, kLoopSeconds},
                    {vec4(0), vec4(3.9f, 0, kReach, 0), vec4(0), vec4(0), vec4(3.9f, 0, -kReach, 0), vec4(0),
                     vec4(0), vec4(3.9f, 0, kReach, 0), vec4(0)}});
    build_.add("cart", body, wood_, cart);
    build_.add("cart load", load, blue_, cart);
    const uint32_t wheel_geometry = build_.add_geometry("wheel", wheel);
    for (int i = 0; i < 4; ++i) {
      const double side = i % 2 ? 1 : -1;
      const uint32_t axle =
          build_.add_node(dvec3(0.27 * side, 0.14, i < 2 ? 0.35 : -0.35),
                          glm::angleAxis(-side * 1.5707963, dvec3(0, 0, 1)), dvec3(1), cart);
      const uint32_t rim = build_.add_node(dvec3(0), dquat(1, 0, 0, 0), dvec3(1), axle);
      build_.spin(rim, 4 * side, kLoopSeconds);
      build_.place(wheel_geometry, iron_, rim);
    }
  }

  void add_lights() {
    build_.add_light({LightType::directional, vec3(1, 0.94f, 0.84f), 3.2f}, dvec3(0),
                     dvec3(-0.62, -0.68, -0.3));
    SourceMesh globe;
    add_sphere(globe, vec3(0), 0.09f, d_.sphere / 2 + 2, d_.sphere / 4 + 2);
    const uint32_t globe_geometry = build_.add_geometry("lamp", globe);
    for (int i = 0; i < kColumns; ++i) {
      const dvec3 at((i % 2 ? 1 : -1) * (kColumnX - 0.55), 2.7, column_z(i));
      build_.place(globe_geometry, lamp_, build_.add_node(at));
      build_.add_light({LightType::point, vec3(1, 0.68f, 0.38f), 2.2f, 9}, at);
    }
    build_.add_light({LightType::point, vec3(0.25f, 0.5f, 1), 2.5f, 7}, dvec3(-4.3, 1.2, -9));
    build_.add_light({LightType::point, vec3(1, 0.25f, 0.35f), 2.5f, 7}, dvec3(-4.3, 1.2, 9));
    for (int i = 0; i < 3; ++i) {
      const dvec3 target(0, 1.2, 6 * (i - 1)), at = target + dvec3(-1.4, 4.2, 1.2);
      build_.add_light({LightType::spot, vec3(1, 0.96f, 0.9f), 32, 12, 0.14f, 0.24f}, at, target - at);
    }
  }

  Detail d_;
  SceneBuilder build_;
  uint32_t floor_, stone_, plaster_, wood_, steel_, copper_, gold_, red_, blue_, clay_, iron_, lamp_, leaf_,
      fence_;
};

}  // namespace

std::shared_ptr<Scene> make_gallery(int detail) {
  return Gallery(detail).run();
}

CameraPath gallery_path() {
  constexpr double kSeconds = 30, kRate = 60, kTauD = 6.283185307179586;
  std::vector<TimedPose> poses;
  for (int i = 0; i <= kSeconds * kRate; ++i) {
    const double t = i / kRate, phase = 0.6 + kTauD * t / kSeconds;
    // Once around the exhibits, with a walking bob and the head turning to both sides.
    const dvec3 position(1.7 * std::sin(phase), 1.65 + 0.02 * std::sin(kTauD * 1.8 * t),
                         9.5 * std::cos(phase));
    const double heading = std::atan2(1.7 * std::cos(phase), -9.5 * std::sin(phase));
    const double yaw = heading + 0.7 * std::sin(kTauD * t / 7), pitch = 0.08 + 0.14 * std::sin(kTauD * t / 5);
    const dvec3 gaze(std::sin(yaw) * std::cos(pitch), std::sin(pitch), std::cos(yaw) * std::cos(pitch));
    poses.push_back({from_seconds(t), {position, look_along(gaze)}});
  }
  return CameraPath(std::move(poses));
}

}  // namespace tessera::scene
