#include <array>

#include "marble/published_examples.h"
#include "model.h"

namespace marble::examples {
namespace {

constexpr int kRobots = 3;
// Start and end of each robot in m, both at rest.
constexpr double kStart[kRobots][2] = {{0.0, -4.0}, {4.0, 1.0}, {-4.0, 1.0}};
constexpr double kEnd[kRobots][2] = {{0.0, 4.0}, {-4.0, 1.0}, {4.0, 1.0}};
constexpr std::array<std::array<int, 2>, 3> kPairs = {{{0, 1}, {0, 2}, {1, 2}}};

// Variables of one step: each robot's position and velocity; for each two robots and each axis the distance
// and two signs; each robot's acceleration, which the last step has not.
enum {
  kState = 4 * kRobots,
  kPair = 6,
  kAcceleration = kState + kPair * 3,
  kStep = kAcceleration + 2 * kRobots
};

}  // namespace

OwnedProblem published_robots(const PublishedRobotsParameters& p) {
  const int last = p.steps - 1;
  const double step_s = p.horizon_s / last;
  Model model("published robots", static_cast<Index>(kStep) * p.steps - 2 * kRobots);
  const auto position = [](int k, int robot, int axis) {
    return static_cast<Index>(kStep * k + 4 * robot + axis);
  };
  const auto velocity = [&](int k, int robot, int axis) { return position(k, robot, 2 + axis); };
  const auto acceleration = [](int k, int robot, int axis) {
    return static_cast<Index>(kStep * k + kAcceleration + 2 * robot + axis);
  };
  for (int robot = 0; robot < kRobots; ++robot) {
    for (int axis = 0; axis < 2; ++axis) {
      model.equal_zero({{position(0, robot, axis), 1.0}}, -kStart[robot][axis]);
      model.equal_zero({{velocity(0, robot, axis), 1.0}});
      model.equal_zero({{position(last, robot, axis), 1.0}}, -kEnd[robot][axis]);
      model.equal_zero({{velocity(last, robot, axis), 1.0}});
      for (int k = 0; k < last; ++k) {
        const Index v = velocity(k + 1, robot, axis), u = acceleration(k, robot, axis);
        model.equal_zero(
            {{position(k + 1, robot, axis), 1.0}, {position(k, robot, axis), -1.0}, {v, -step_s}});
        model.equal_zero({{v, 1.0}, {velocity(k, robot, axis), -1.0}, {u, -step_s}});
        model.add_square(step_s, {{u, 1.0}});
      }
    }
  }
  for (int k = 0; k < p.steps; ++k) {
    for (std::size_t pair = 0; pair < kPairs.size(); ++pair) {
      const auto [a, b] = kPairs[pair];
      Terms norm;
      for (int axis = 0; axis < 2; ++axis) {
        // distance = |difference|, by signs whose sum is 1.
        const auto distance =
            static_cast<Index>(kStep * k + kState + kPair * static_cast<int>(pair) + 3 * axis);
        const Index plus = distance + 1, minus = distance + 2;
        const Terms difference = {{position(k, a, axis), 1.0}, {position(k, b, axis), -1.0}};
        const Terms opposite = {{position(k, a, axis), -1.0}, {position(k, b, axis), 1.0}};
        model.equal_zero({{plus, 1.0}, {minus, 1.0}}, -1.0);
        model.complementary({{plus, 1.0}}, 0.0, Terms{{distance, 1.0}} + opposite, 0.0);
        model.complementary({{minus, 1.0}}, 0.0, Terms{{distance, 1.0}} + difference, 0.0);
        norm.push_back({distance, 1.0});
      }
      model.at_least_zero(norm, -p.distance);
    }
  }
  return model.problem();
}

}  // namespace marble::examples
