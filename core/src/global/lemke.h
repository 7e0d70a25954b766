// Lemke's method, "Bimatrix equilibrium points and mathematical programming" (1965). It finds a branch of a
// problem that becomes a linear complementarity problem when the variables that no pair needs are fixed.
//
// One side of each pair becomes an unknown x ≥ 0, if equalities and rows allow it; the other sides are w = M
// x + q. An artificial θ, in w = M x + q + d θ, starts at the value that alone makes all of them ≥ 0, and is
// driven to zero along a path of complementary points. The path depends on d and on the choice of unknowns,
// but not on the objective.
//
// In doubles, M may be a hundred thousand times worse conditioned than rounding allows elsewhere in this
// library. In twice the precision (DoubleDouble), every M that doubles can represent can be solved, at thirty
// times the cost.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "global/double_double.h"
#include "model/iterate.h"
#include "model/working_set.h"
#include "path/run.h"

namespace marble {

template <class Scalar>
class Lemke {
 public:
  explicit Lemke(const ScaledProblem& problem) : problem_(problem) {}

  /// True if the method applies: there are pairs, no inequalities (which it would ignore), and the tableau is
  /// not too large.
  [[nodiscard]] bool applies() const;
  /// Makes attempt number 0, 1, … (`way`) from z (scaled); free variables stay there. Returns false if it
  /// ended in a ray, or if the sides cannot be chosen. Counts its pivots as the factorizations that cost as
  /// much.
  [[nodiscard]] bool run(Run& run, int way, ConstVectorRef z, WorkingSet& set);
  /// Computes the point of a branch that its equalities and fixed sides determine, with free variables at z,
  /// and the multipliers that keep it there. Returns false if they contradict each other.
  [[nodiscard]] bool solve_branch(const WorkingSet& set, ConstVectorRef z, Iterate& x);

 private:
  using Tableau = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  void exchange(Index row, Index column);
  void fill();
  [[nodiscard]] bool choose_unknowns(const Run& run, int way);
  [[nodiscard]] bool make_room(Index pair);
  [[nodiscard]] Index best_column(Index row) const;
  void reduce(int way, ConstVectorRef z);
  [[nodiscard]] bool follow(Run& run);
  [[nodiscard]] Index blocking_row(Index column) const;

  const ScaledProblem& problem_;
  Tableau tableau_;  // basic variables as functions of the nonbasic ones; the last column is constant
  std::vector<Index> basic_, nonbasic_;  // what each row and column stands for
};

extern template class Lemke<double>;
extern template class Lemke<DoubleDouble>;

}  // namespace marble
