// Solves the branch's own system for as many right-hand sides at once as T has lanes:
//
//   [ Q   Aᵀ  J₀ᵀ ] [ z ]
//   [ A            ] [ y ] = right-hand side,     J₀ the rows of [C; L; R] that are held at zero.
//   [ J₀           ] [ λ ]
#pragma once

#include <array>
#include <vector>

#include "branch/branch_point.h"
#include "kkt/lanes.h"

namespace marble {

/// Memory for the systems of one branch, allocated once and shared by all of them.
struct BranchSystemMemory {
  std::vector<double> vectors;
  /// For BLAS, if the data are nearly full and there are many right-hand sides: Q, [A; J₀], and one number
  /// per lane for each of these rows.
  Eigen::MatrixXd hessian, rows, of_rows;
  /// Prepares for another branch: other rows are held, or the rows have other numbers.
  void forget_branch() { hessian.resize(0, 0); }
};

template <class T>
class BranchSystem {
 public:
  static constexpr int kLanes = lanes_of<T>;

  BranchSystem(const ScaledProblem& problem, BranchPoint& point, BranchSystemMemory& memory);

  /// The right-hand side, which solve() overwrites: z by variables, y by equalities, λ by all rows. Entries
  /// of rows that are not held are ignored.
  T *right_z, *right_y, *right_lambda;
  /// The solution; λ = 0 for rows that are not held.
  T *z, *y, *lambda;

  /// Sets the whole right-hand side to 0.
  void clear();
  /// Solves the first `count` lanes with the current factor. Returns for each lane whether its solution is
  /// accurate to at least half of the digits, and each row to a digit of its own. If not, dependent rows
  /// contradict each other or the branch is flat.
  [[nodiscard]] std::array<bool, kLanes> solve(int count);
  /// Returns the largest entry of the solution.
  [[nodiscard]] T largest() const;

 private:
  void take_first_step();
  [[nodiscard]] T advance();
  void take_by_rows();
  [[nodiscard]] bool may_take_by_blas();
  void take_by_blas();
  void drop(int dropped_lane);
  [[nodiscard]] bool is_met_by_rows(int i, double size) const;

  const ScaledProblem& problem_;
  BranchPoint& point_;
  BranchSystemMemory& memory_;
  T *step_z_, *step_y_, *pull_;  // the step; its J₀ᵀdλ
};

}  // namespace marble
