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

constexpr float kMaxFoveation = 8;

struct DensitySettings {
  // 0: none; 1: what the eye resolves at a distance from the gaze, eqs. 4.1 to 4.3; more: so many times less.
  float foveation = 0;  // 0..kMaxFoveation
  bool barrel = false;  // eq. 4.5
  std::vector<ObjectPriority> priorities;

  // False: every footprint stays as it is, and the stage is not needed.
  bool any() const { return foveation > 0 || barrel || !priorities.empty(); }
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

// The angle (radians) between the ray and the nearest point of the triangles, three corners each, as seen
// from the ray's eye; exact to 1e-7. Eq. 4.3 bounds it from below: loosely for slivers, and only where a cone
// of less than a right angle holds the patch. 0 for a ray without a direction, and where a corner lies in the
// eye or is no point. Valid for any input.
double eccentricity(std::span<const dvec3> triangles, const GazeRay& ray);

// Samples along a length that suffice at this eccentricity, per pixel of the display: min(1, omega* / omega)
// with the smallest angle that can be resolved there (eq. 4.1, times the foveation) and the display's own, of
// two pixels (the reciprocal of eq. 4.2, and never more than the display has). So an ideal shader needs 5.7 %
// of the samples of the thesis' pictures (1920 x 1080 over 90 degrees); the 2.5 % that it reports take a
// foveation of 2, by which it is 1.6 %.
double foveal_scale(double eccentricity_rad, double pixels_per_radian, double foveation = 1);

// Samples along a length per pixel of the picture before the lens, at n = angle from the lens's axis / half
// the field of view: eq. 4.5, at most 1. The print calls it a fit to eq. 4.4, p(r); it is one to that
// equation's inverse, r / p(r) over p(r), within 0.016 up to n = p(1) = 1.46, where it ends. A lens squeezes
// more along the radius than across it, which is what this is the factor of: from n = 0.15 on, areas keep
// samples to spare.
double barrel_scale(double n);

// Thread-safe.
class Density {
 public:
  // InvalidArgument names what is out of range, or a priority that no node of the scene bears.
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
  double needed_by(std::span<const dvec3> triangles, const Viewers& viewers) const;

  const scene::Scene& scene_;
  const DensitySettings settings_;
  const DensityDisplay display_;
  std::vector<float> length_factor_;  // by instance: of its priority; empty: 1
};

}  // namespace tessera::atlas
