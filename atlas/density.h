// How densely a viewer needs samples beyond what a patch's size on the screen says (thesis ch. 4): sparser
// away from the gaze, sparser where the lens before the display squeezes the picture, and as the scene's
// objects matter to an application. A stage of its own between the visible set and whichever layout follows:
// it scales footprints. It never asks for more than the screen shows, but for objects that are told to.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/math.h"
#include "base/status.h"
#include "scene/scene.h"
#include "scene/visible_set.h"

namespace tessera::atlas {

// An eye and where it looks, in scene coordinates. The direction may have any length.
struct GazeRay {
  dvec3 eye{0}, direction{0, 0, -1};
  bool operator==(const GazeRay&) const = default;
};

// The objects below the nodes of this name get `density` times the samples (area, not length) that they would
// get else. Of several that apply to an object the one nearest to it in the tree counts.
struct ObjectPriority {
  std::string node;
  float density = 1;  // 1/64..64
  bool operator==(const ObjectPriority&) const = default;
};
constexpr float kMinPriority = 1.0f / 64, kMaxPriority = 64;

struct DensitySettings {
  bool foveated = false;  // eqs. 4.1-4.3
  bool barrel = false;    // eq. 4.5
  std::vector<ObjectPriority> priorities;

  // False: every footprint stays as it is, and the stage is not needed.
  bool any() const { return foveated || barrel || !priorities.empty(); }
};

// The screen that the samples are for.
struct DensityDisplay {
  float pixels_per_radian = 0;  // > 0
  float half_field_rad = 0;     // > 0: of the wider of its two fields of view
};

// Who looks: all the views that the visible set is for. What several of them see is as dense as the most
// demanding of them needs it.
struct Viewers {
  std::vector<GazeRay> gazes;  // of the viewer's eyes
  std::vector<GazeRay> axes;   // of the lenses: straight ahead
};

constexpr uint32_t kMaxPatchCorners = 9;  // of three triangles

// A lower bound of the angle (radians) between the ray and any point of the convex hull of `corners` as seen
// from the ray's eye (eq. 4.3). 0 where no cone of less than a right angle holds them all (which eq. 4.3
// takes for granted), and for a ray without a direction. Valid for any values; at most kMaxPatchCorners
// corners.
double eccentricity(std::span<const dvec3> corners, const GazeRay& ray);

// Samples along a length that suffice at this eccentricity, per pixel of the display: min(1, omega* / omega)
// with the smallest angle that can be resolved there (eq. 4.1) and the display's own, of two pixels (the
// reciprocal of eq. 4.2, and never more than the display has).
double foveal_scale(double eccentricity_rad, double pixels_per_radian);

// Samples along a length per pixel of the picture before the lens, at n = angle from the lens's axis / half
// the field of view: eq. 4.5, at most 1. The print calls it a fit to eq. 4.4, p(r); it is one to that
// equation's inverse, r / p(r) over p(r), within 0.016 up to n = p(1) = 1.46, where it ends. A lens squeezes
// more along the radius than across it, which is what this is the factor of: from n = 0.15 on, areas keep
// samples to spare.
double barrel_scale(double n);

// Thread-safe.
class Density {
 public:
  // InvalidArgument names a priority that is out of range or that no node of the scene bears.
  static Status check(const scene::Scene& scene, const DensitySettings& settings);
  // Errors as check(). The scene outlives it.
  static StatusOr<std::unique_ptr<Density>> create(const scene::Scene& scene, const DensitySettings& settings,
                                                   const DensityDisplay& display);

  // Scales the footprints: lengths by a factor, areas by its square. `instance_transforms` are the instances'
  // world matrices.
  void scale(std::span<const dmat4> instance_transforms, const Viewers& viewers,
             scene::VisiblePatches& visible) const;

 private:
  Density(const scene::Scene& scene, const DensitySettings& settings, const DensityDisplay& display)
      : scene_(scene), settings_(settings), display_(display) {}
  double needed_by(std::span<const dvec3> corners, const Viewers& viewers) const;

  const scene::Scene& scene_;
  const DensitySettings settings_;
  const DensityDisplay display_;
  std::vector<float> length_factor_;  // by instance: of its priority; empty: 1
};

}  // namespace tessera::atlas
