// The branch's own system, for as many right-hand sides at once as T has lanes:
//
//   [ Q   Aᵀ  J₀ᵀ ] [ z ]
//   [ A            ] [ y ] = right-hand side,     J₀ the rows of [C; L; R] that are held at zero.
//   [ J₀           ] [ λ ]
#pragma once

#include <array>
#include <vector>

#include "branch/branch_point.h"
#include "lanes/lanes.h"

namespace marble {

/// Memory for the systems of one branch: taken once, used by all.
struct BranchSystemMemory {
  std::vector<double> vectors;
  /// Where the data are nearly full and there are many right-hand sides, for BLAS: Q, [A; J₀], and a number
  /// of each lane for each of these rows.
  Eigen::MatrixXd hessian, rows, of_rows;
  /// Another branch: others of the rows are held, or they have other numbers.
  void forget_branch() { hessian.resize(0, 0); }
};

template <class T>
class BranchSystem {
 public:
  static constexpr int kLanes = lanes_of<T>;

  BranchSystem(const ScaledProblem& problem, BranchPoint& point, BranchSystemMemory& memory);

  /// The right-hand side, which solve() uses up: z by variables, y by equalities, λ by all rows, of which
  /// those that are not held are left out.
  T *right_z, *right_y, *right_lambda;
  /// The solution: λ = 0 of rows that are not held.
  T *z, *y, *lambda;

  /// All of the right-hand side is 0.
  void clear();
  /// With the factor at hand, of the first `count` lanes. Tells of each whether it has a solution to half of
  /// the digits at least: where it has none, rows depend on each other and contradict, or the branch is flat.
  [[nodiscard]] std::array<bool, kLanes> solve(int count);
  /// The largest entry of the solution.
  [[nodiscard]] T largest() const;

 private:
  void take_first_step();
  [[nodiscard]] T advance();
  void take_by_rows();
  [[nodiscard]] bool may_take_by_blas();
  void take_by_blas();
  void drop(int dropped_lane);

  const ScaledProblem& problem_;
  BranchPoint& point_;
  BranchSystemMemory& memory_;
  T *step_z_, *step_y_, *pull_;  // the step; J₀ᵀdλ of it
};

}  // namespace marble
