#include "tessellator.h"

#include <cmath>
#include <random>

namespace tessera::atlas::addressing::test {
namespace {

// Along the side that lies opposite corner `side`, whose coordinate stays `least`; without its end.
void add_side(std::vector<vec3>& points, int side, double least, int steps, double step) {
  for (int i = 0; i < steps; ++i) {
    double lambda[3];
    lambda[side] = least;
    lambda[(side + 1) % 3] = least + i * step;
    lambda[(side + 2) % 3] = 1 - 2 * least - i * step;
    points.push_back(vec3(lambda[0], lambda[1], lambda[2]));
  }
}

}  // namespace

std::vector<vec3> tessellated(const TessellationLevels& levels) {
  std::vector<vec3> points;
  for (int side = 0; side < 3; ++side)
    add_side(points, side, 0, levels.outer[side], 1.0 / levels.outer[side]);
  for (int ring = 1; 2 * ring <= levels.inner; ++ring) {
    const int steps = levels.inner - 2 * ring;
    const double least = 2.0 * ring / (3.0 * levels.inner);
    for (int side = 0; side < 3; ++side) add_side(points, side, least, steps, 1.0 / levels.inner);
    if (steps == 0) points.push_back(vec3(1.0 / 3));
  }
  return points;
}

std::vector<vec3> perturbed(std::vector<vec3> points, int level, uint32_t seed) {
  std::mt19937 random(seed);
  constexpr double kGrid = 65536;
  const double most = kTessCoordError / level * kGrid;
  // Half of the errors are as large as they can be.
  const auto error = [&] {
    const double e = std::uniform_real_distribution(-2.0, 2.0)(random);
    return most * std::min(1.0, std::max(-1.0, e));
  };
  const auto moved = [&](double x) {
    if (x == 0) return 0.0;
    // Rounded towards x, so that the grid adds nothing to the error.
    const double at = x * kGrid + error();
    return (at > x * kGrid ? std::floor(at) : std::ceil(at)) / kGrid;
  };
  for (vec3& p : points) {
    if (p.x == 1 || p.y == 1 || p.z == 1) continue;
    double x, y, z;
    do {
      x = std::max(0.0, moved(p.x));
      y = p.z == 0 ? 1 - x : std::max(0.0, moved(p.y));
      z = 1 - x - y;
    } while (y < 0 || z < 0 || std::abs(z - p.z) * kGrid > most);
    p = vec3(x, y, z);
  }
  return points;
}

}  // namespace tessera::atlas::addressing::test
