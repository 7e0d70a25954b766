// Problems as formulas of jets, with what is known of them.
#pragma once

#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "jet.h"
#include "marble/nonlinear.h"

namespace marble::testing {

using Jets = std::vector<Jet>;

/// The functions of a problem at x. Residuals count half their squares.
struct Parts {
  Jet objective = {};
  Jets equalities = {};
  Jets inequalities = {};
  Jets G = {};
  Jets H = {};
  Jets residuals = {};
};

inline constexpr double kFree = std::numeric_limits<double>::infinity();

struct Formula {
  std::string name;
  double optimum = 0.0;  // as published
  std::vector<double> start;
  std::function<Parts(const Jets& x)> parts;
  std::vector<double> lower = {};
  std::vector<double> upper = {};

  [[nodiscard]] Jets variables(std::span<const double> x) const;
};

/// With the Hessian of the Lagrangian, unless it is not wanted. All patterns are full.
[[nodiscard]] nonlinear::Problem problem_of(const Formula& formula, bool with_hessian = true);

/// What speaks against an answer by the formula alone: a row, a bound or a pair that is violated by more than
/// 1e-6, or an objective that is not that of x. Empty if nothing does.
[[nodiscard]] std::string objection(const Formula& formula, const nonlinear::Answer& answer);

[[nodiscard]] std::vector<Formula> classical_problems();
[[nodiscard]] std::vector<Formula> equilibrium_problems();

}  // namespace marble::testing
