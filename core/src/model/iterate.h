// The unknowns of the KKT residual (13) as one vector with named segments; steps and residuals share the
// layout.
#pragma once

#include <vector>

#include "marble/solution.h"
#include "model/scaling.h"

namespace marble {

class Iterate {
 public:
  explicit Iterate(const ScaledProblem& p)
      : n_(p.variables()), n_c_(p.pairs()), n_i_(p.inequalities()), n_e_(p.equalities()) {
    all.setZero(n_ + 3 * n_c_ + 2 * n_i_ + n_e_);
  }

  Vector all;  ///< [z σ v y λ_w λ_L λ_R]

  // clang-format off
  auto z() { return all.segment(0, n_); }                                      ///< n        | r₁ stationarity
  auto sigma() { return all.segment(n_, n_c_); }                               ///< σ, n_c   | r₃ −h′(σ)ᵀλ
  auto v() { return all.segment(n_ + n_c_, n_i_); }                            ///< v, n_i   | r₂ λ_w + p(−v)
  auto y() { return all.segment(n_ + n_c_ + n_i_, n_e_); }                     ///< n_e      | r_e equalities
  auto lambda() { return all.segment(n_ + n_c_ + n_i_ + n_e_, n_i_ + 2 * n_c_); }  ///< of [C; L; R], all three:
  auto lambda_w() { return all.segment(n_ + n_c_ + n_i_ + n_e_, n_i_); }       ///< ≤ 0, n_i | r₄ inequalities
  auto lambda_L() { return all.segment(all.size() - 2 * n_c_, n_c_); }         ///< n_c      | r₅ of L z + l
  auto lambda_R() { return all.segment(all.size() - n_c_, n_c_); }             ///< n_c      | r₅ of R z + r
  [[nodiscard]] auto z() const { return all.segment(0, n_); }
  [[nodiscard]] auto sigma() const { return all.segment(n_, n_c_); }
  [[nodiscard]] auto v() const { return all.segment(n_ + n_c_, n_i_); }
  [[nodiscard]] auto y() const { return all.segment(n_ + n_c_ + n_i_, n_e_); }
  [[nodiscard]] auto lambda() const { return all.segment(n_ + n_c_ + n_i_ + n_e_, n_i_ + 2 * n_c_); }
  [[nodiscard]] auto lambda_w() const { return all.segment(n_ + n_c_ + n_i_ + n_e_, n_i_); }
  [[nodiscard]] auto lambda_L() const { return all.segment(all.size() - 2 * n_c_, n_c_); }
  [[nodiscard]] auto lambda_R() const { return all.segment(all.size() - n_c_, n_c_); }
  // clang-format on

 private:
  Eigen::Index n_, n_c_, n_i_, n_e_;
};

/// Copies z and the multipliers of a solution from the user's units; the sizes must match. σ and v are
/// unchanged.
inline void take(const ScaledProblem& problem, const Solution& answer, Iterate& x) {
  const auto scaled = [](const std::vector<double>& values, ConstVectorRef scale, double factor, auto out) {
    for (Eigen::Index i = 0; i < out.size(); ++i)
      out[i] = factor * values[static_cast<std::size_t>(i)] / scale[i];
  };
  const double cost = problem.cost_scale;
  const RowLayout& rows = problem.layout;
  const Vector& scale = problem.row_scale;
  scaled(answer.z, problem.variable_scale, 1.0, x.z());
  scaled(answer.equality_multipliers, problem.equality_scale, cost, x.y());
  scaled(answer.inequality_multipliers, rows.inequality_part(scale), -cost, x.lambda_w());
  scaled(answer.complementarity_multipliers_L, rows.s_part(scale), -cost, x.lambda_L());
  scaled(answer.complementarity_multipliers_R, rows.t_part(scale), -cost, x.lambda_R());
}

/// Does the reverse: copies z and the multipliers of an iterate to a solution, in the user's units.
inline void report(const ScaledProblem& problem, const Iterate& x, Solution& answer) {
  const auto unscale = [](ConstVectorRef values, ConstVectorRef scale, double factor,
                          std::vector<double>& out) {
    out.resize(static_cast<std::size_t>(values.size()));
    for (Eigen::Index i = 0; i < values.size(); ++i)
      out[static_cast<std::size_t>(i)] = factor * values[i] * scale[i];
  };
  const double cost = 1.0 / problem.cost_scale;
  const RowLayout& rows = problem.layout;
  const Vector& scale = problem.row_scale;
  unscale(x.z(), problem.variable_scale, 1.0, answer.z);
  unscale(x.y(), problem.equality_scale, cost, answer.equality_multipliers);
  unscale(x.lambda_w(), rows.inequality_part(scale), -cost, answer.inequality_multipliers);
  unscale(x.lambda_L(), rows.s_part(scale), -cost, answer.complementarity_multipliers_L);
  unscale(x.lambda_R(), rows.t_part(scale), -cost, answer.complementarity_multipliers_R);
}

}  // namespace marble
