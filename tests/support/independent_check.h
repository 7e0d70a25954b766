// Checks a solution by plain loops over the user's own data: shares no code with the solver.
#pragma once

#include <vector>

#include "marble/problem.h"
#include "marble/solution.h"

namespace marble::testing {

struct Verdict {
  double equality = 0.0;         ///< max |A z + b|
  double inequality = 0.0;       ///< max −(C z + d)
  double complementarity = 0.0;  ///< max |min(s, t)|
  double stationarity = 0.0;  ///< max |Qz + g + Aᵀy − Cᵀν − Lᵀξ − Rᵀη| over (1 + the largest term in it)
  double absolute_stationarity = 0.0;  ///< the same without the denominator
  double wrong_sign = 0.0;             ///< max −ν
  double slackness = 0.0;  ///< max of |ν·(Cz + d)|, |ξ·s|, |η·t|, over (1 + largest multiplier)
  double objective = 0.0;

  [[nodiscard]] double infeasibility() const;
};

[[nodiscard]] Verdict judge(const ProblemView& problem, const Solution& solution);
/// Checks only a point: fields that depend on multipliers are meaningless.
[[nodiscard]] Verdict judge_point(const ProblemView& problem, const std::vector<double>& z);

}  // namespace marble::testing
