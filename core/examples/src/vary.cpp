#include <random>

#include "marble/examples.h"

namespace marble::examples {
namespace {

// Uses only the standard's engines, because its distributions differ between libraries.
class Variation {
 public:
  explicit Variation(std::uint64_t seed) : engine_(seed), still_(seed == 0) {}
  /// Uniform in [−size, size], 0 for seed 0.
  double shift(double size) {
    const double unit = static_cast<double>(engine_() >> 11) * 0x1p-53;
    return still_ ? 0.0 : size * (2.0 * unit - 1.0);
  }
  /// Uniform in [1 − size, 1 + size], 1 for seed 0.
  double factor(double size) { return 1.0 + shift(size); }

 private:
  std::mt19937_64 engine_;
  bool still_;
};

}  // namespace

HopperParameters vary(HopperParameters p, std::uint64_t seed) {
  Variation variation(seed);
  for (double& x : p.stair_x) x += variation.shift(0.04);
  for (double& rise : p.stair_rise) rise *= variation.factor(0.15);
  p.position[1] += variation.shift(0.05);
  p.velocity[0] += variation.shift(0.1);
  p.speed *= variation.factor(0.05);
  p.tracking_weight *= variation.factor(0.1);
  p.force_weight *= variation.factor(0.1);
  return p;
}

RocketParameters vary(RocketParameters p, std::uint64_t seed) {
  Variation variation(seed);
  p.initial[0] += variation.shift(0.8);
  p.initial[1] += variation.shift(0.8);
  p.initial[3] += variation.shift(0.3);
  p.initial[4] += variation.shift(0.3);
  p.trigger_altitude += variation.shift(0.5);
  p.thrust_weight *= variation.factor(0.1);
  p.angle_weight *= variation.factor(0.1);
  return p;
}

GatesParameters vary(GatesParameters p, std::uint64_t seed) {
  Variation variation(seed);
  for (Gate& gate : p.gates) {
    // With larger shifts, the bounds on tilt and thrust leave no feasible path for some seeds.
    for (double& coordinate : gate.center) coordinate += variation.shift(0.03);
    gate.yaw += variation.shift(0.05);
  }
  p.velocity_weight *= variation.factor(0.1);
  p.angle_weight *= variation.factor(0.1);
  return p;
}

}  // namespace marble::examples
