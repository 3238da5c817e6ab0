// How the lens before a display bends what lies on it (thesis 7.1.6; eq. 4.4 without its scaling to ±1).
#pragma once

#include <array>

#include "base/view.h"

namespace tessera::client {

// Radial, about the direction straight ahead: what a pixel at tangents p shows must be drawn as it would be
// seen at p (1 + k1 r² + k2 r⁴ + k3 r⁶), r = |p|. One polynomial a colour, as lenses bend each differently.
struct LensDistortion {
  Fov screen;                                   // tangents at the edges of the viewport, were there no lens
  std::array<float, 3> red{}, green{}, blue{};  // k1, k2, k3
};

}  // namespace tessera::client
