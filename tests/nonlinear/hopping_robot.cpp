#include "hopping_robot.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <tuple>

namespace marble::testing {
namespace {

constexpr double h = HoppingRobot::kStep;
constexpr double kMass = 3.0, kGravity = 9.81, kInertia = 0.02, kLeg = 0.5, kBent = 0.7;
constexpr double kPeriod = 0.5, kHop = 0.08;
constexpr double kMost = 30.0;  // of the torque
constexpr double kUnlimited = std::numeric_limits<double>::infinity();

// Of the squares of a stage's parts.
constexpr std::array<double, HoppingRobot::kParts> kWeights = {60.0, 1.0, 0.1, 1e-3, 5e-4, 1e-6};

std::array<double, HoppingRobot::kParts> residuals_of(const double* stage, std::int64_t tick) {
  const double t = h * static_cast<double>(tick);
  const double middle = kLeg * std::cos(kBent) + kHop / 2.0;
  const std::array<double, HoppingRobot::kParts> wanted = {
      middle + kHop * std::sin(2.0 * std::numbers::pi * t / kPeriod), kBent};
  std::array<double, HoppingRobot::kParts> made;
  for (std::size_t i = 0; i < made.size(); ++i) made[i] = std::sqrt(h * kWeights[i]) * (stage[i] - wanted[i]);
  return made;
}

}  // namespace

HoppingRobot::HoppingRobot(Index stages)
    : stages_(stages),
      equalities_(static_cast<std::size_t>(kState + kState * stages)),
      G_(static_cast<std::size_t>(stages)),
      H_(static_cast<std::size_t>(stages)),
      residuals_(static_cast<std::size_t>(kParts * stages)),
      gradient_(at(stages, 0), 0.0) {
  const auto n = static_cast<Index>(gradient_.size());
  Triplets E, G, H, R;  // where the derivatives are constant, these are their values
  for (Index i = 0; i < kState; ++i) E.add(i, i, 1.0);
  const auto column = [](Index stage, Index part) { return static_cast<Index>(at(stage, part)); };
  for (Index k = 0; k < stages; ++k) {
    const Index row = kState + kState * k;
    for (Index i = 0; i < 2; ++i) {
      E.add(row + i, column(k, i), 1.0), E.add(row + i, column(k - 1, i), -1.0);
      E.add(row + i, column(k, kSpeed + i), -h);
    }
    E.add(row + 2, column(k, kSpeed), kMass), E.add(row + 2, column(k - 1, kSpeed), -kMass);
    E.add(row + 2, column(k, kForce), -h);
    E.add(row + 3, column(k, kTurn), kInertia), E.add(row + 3, column(k - 1, kTurn), -kInertia);
    E.add(row + 3, column(k, kTorque), -h);
    E.add(row + 3, column(k, kKnee), 1.0), E.add(row + 3, column(k, kForce), 1.0);  // these two move
    G.add(k, column(k, kHeight), 1.0), G.add(k, column(k, kKnee), 1.0);             // the second one moves
    H.add(k, column(k, kForce), 1.0);
    for (Index i = 0; i < kParts; ++i)
      R.add(kParts * k + i, column(k, i), std::sqrt(h * kWeights[static_cast<std::size_t>(i)]));
  }
  of_equalities_ = compress(kState + kState * stages, n, E, "equalities").value();
  of_G_ = compress(stages, n, G, "G").value(), of_H_ = compress(stages, n, H, "H").value();
  of_residuals_ = compress(kParts * stages, n, R, "residuals").value();
}

HoppingRobot::State HoppingRobot::standing() { return {kLeg * std::cos(kBent), kBent, 0.0, 0.0}; }

double HoppingRobot::foot_height(const State& state) {
  return state[kHeight] - kLeg * std::cos(state[kKnee]);
}

double HoppingRobot::cost(const State& state, double torque, std::int64_t tick) {
  const double stage[kParts] = {state[0], state[1], state[2], state[3], torque, 0.0};
  double sum = 0.0;
  for (const double residual : residuals_of(stage, tick)) sum += 0.5 * residual * residual;
  return sum;
}

nonlinear::Problem HoppingRobot::problem() {
  nonlinear::Problem p;
  p.values = [this](auto x) { return values(x); };
  p.derivatives = [this](auto x) { return derivatives(x); };
  p.lower.assign(gradient_.size(), -kUnlimited), p.upper.assign(gradient_.size(), kUnlimited);
  for (Index k = -1; k < stages_; ++k) {
    for (const double part : standing()) p.start.push_back(part);
    if (k < 0) continue;
    p.start.push_back(-kLeg * std::sin(kBent) * kMass * kGravity), p.start.push_back(kMass * kGravity);
    p.lower[at(k, kTorque)] = -kMost, p.upper[at(k, kTorque)] = kMost;
    p.lower[at(k, kKnee)] = 0.2, p.upper[at(k, kKnee)] = 1.3;
  }
  return p;
}

Shift HoppingRobot::one_stage() const {
  Shift shift;
  // The state that it begins with becomes that after the first stage.
  shift.variables = {{.first = 0, .count = 2 * kState, .by = kState},
                     {.first = kState, .count = kParts * stages_, .by = kParts}};
  shift.equalities = {{.first = kState, .count = kState * stages_, .by = kState}};
  shift.pairs = {{.first = 0, .count = stages_, .by = 1}};
  return shift;
}

nonlinear::Values HoppingRobot::values(std::span<const double> x) {
  for (std::size_t i = 0; i < kState; ++i) equalities_[i] = x[i] - begin_[i];
  for (Index k = 0; k < stages_; ++k) {
    const double* const s = &x[at(k, 0)];
    const double* const before = &x[at(k - 1, 0)];
    double* const e = &equalities_[static_cast<std::size_t>(kState + kState * k)];
    for (Index i = 0; i < 2; ++i) e[i] = s[i] - before[i] - h * s[kSpeed + i];
    e[2] = kMass * (s[kSpeed] - before[kSpeed] + h * kGravity) - h * s[kForce];
    e[3] = kInertia * (s[kTurn] - before[kTurn]) - h * (s[kTorque] + kLeg * std::sin(s[kKnee]) * s[kForce]);
    G_[static_cast<std::size_t>(k)] = s[kHeight] - kLeg * std::cos(s[kKnee]);
    H_[static_cast<std::size_t>(k)] = s[kForce];
    const auto residuals = residuals_of(s, tick_ + k + 1);
    std::copy(residuals.begin(), residuals.end(), &residuals_[static_cast<std::size_t>(kParts * k)]);
  }
  return {.equalities = equalities_, .G = G_, .H = H_, .residuals = residuals_};
}

nonlinear::Derivatives HoppingRobot::derivatives(std::span<const double> x) {
  const auto last = [](SparseMatrix& matrix, std::size_t column) -> double& {
    return matrix.values[static_cast<std::size_t>(matrix.column_pointers[column + 1]) - 1];
  };
  for (Index k = 0; k < stages_; ++k) {
    const double sine = std::sin(x[at(k, kKnee)]), cosine = std::cos(x[at(k, kKnee)]);
    // Of a knee's column in c_E the entries are: this stage's two rows, the next one's.
    const auto knee = static_cast<std::size_t>(of_equalities_.column_pointers[at(k, kKnee)]);
    of_equalities_.values[knee + 1] = -h * kLeg * cosine * x[at(k, kForce)];
    last(of_equalities_, at(k, kForce)) = -h * kLeg * sine;
    last(of_G_, at(k, kKnee)) = kLeg * sine;
  }
  return {.gradient = gradient_,
          .equalities = of_equalities_.view(),
          .G = of_G_.view(),
          .H = of_H_.view(),
          .residuals = of_residuals_.view()};
}

HoppingRobot::State step_of_the_world(const HoppingRobot::State& state, double torque,
                                      std::span<const double> guess) {
  HoppingRobot scenario(1);
  scenario.set(0, state);
  nonlinear::Problem problem = scenario.problem();
  std::copy(state.begin(), state.end(), problem.start.begin());
  std::copy_n(guess.begin(), std::size_t{HoppingRobot::kParts}, problem.start.begin() + HoppingRobot::kState);
  problem.lower.assign(problem.start.size(), -kUnlimited),
      problem.upper.assign(problem.start.size(), kUnlimited);
  const std::size_t fixed = HoppingRobot::at(0, HoppingRobot::kTorque);
  problem.lower[fixed] = problem.upper[fixed] = torque;
  const auto answer = nonlinear::solve(problem, nonlinear::open_ticks_in_process);
  if (!answer) throw std::runtime_error(answer.error().message());
  if (!is_solved(answer->status)) throw std::runtime_error("simulation: " + answer->detail);
  HoppingRobot::State next;
  std::copy_n(answer->x.begin() + HoppingRobot::kState, next.size(), next.begin());
  return next;
}

}  // namespace marble::testing
