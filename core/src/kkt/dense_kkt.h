// Dense backend: LAPACK's Cholesky factorization of H + ρAᵀA, for problems that would fill in anyway.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "kkt/kkt.h"

namespace marble {

class DenseKkt final : public Kkt {
 public:
  explicit DenseKkt(const ScaledProblem& problem);
  /// Estimates the cost in the units of SparseKkt::flops without building anything.
  [[nodiscard]] static double estimated_flops(const ScaledProblem& problem);
  /// Returns what bytes() will be, without building anything.
  [[nodiscard]] static double estimated_bytes(const ScaledProblem& problem);

  [[nodiscard]] bool allocate(const ScaledProblem& problem) override;
  void load(const ScaledProblem& problem) override;
  [[nodiscard]] bool solve(VectorRef x, VectorRef y) override;
  [[nodiscard]] bool solve_many(double* x, double* y, int count) override;
  [[nodiscard]] bool solve_sparse(std::span<const Index> indices, std::span<const double> values,
                                  VectorRef x) override;
  [[nodiscard]] std::string_view name() const override { return "dense"; }
  [[nodiscard]] double flops() const override { return flops_; }
  [[nodiscard]] double bytes() const override;

 private:
  [[nodiscard]] bool solve(VectorRef x, VectorRef y, bool refined);
  [[nodiscard]] bool factorize(const RowWeights& weights) override;
  using Matrix = Eigen::MatrixXd;
  // A row of `weighted_`: scale · (cos · rows_[s] + sin · rows_[t]).
  struct Term {
    Index s, t;
    double s_factor, t_factor;
  };
  // A row with one entry: its products need no matrix multiplication.
  struct Single {
    Index column = -1;  // -1: the row is not of this kind
    double value = 0.0;
  };
  [[nodiscard]] bool add_terms(double sign);
  void add_single(const Single& single, Index other, double single_single, double single_other);

  Index variables_, equalities_, inequalities_, pairs_;
  double rho_ = 1.0, flops_ = 0.0;
  Matrix hessian_;   // Q, upper triangle
  Matrix rows_;      // [A; C; L; R]
  Matrix weighted_;  // rows of rows_, rotated and scaled by √|k|
  Matrix system_;    // H + ρAᵀA, upper triangle
  Matrix factor_;
  std::vector<Term> terms_;
  std::vector<Single> s_single_, t_single_;
  Vector residual_;
};

}  // namespace marble
