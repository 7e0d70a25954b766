// Lemke's method, "Bimatrix equilibrium points and mathematical programming" (1965): a branch of what is a
// linear complementarity problem once the variables that no pair needs stay where they are.
//
// With one side of each pair as the unknowns x ≥ 0, which equalities and rows must allow, the other sides are
// w = M x + q. An artificial θ, w = M x + q + d θ, is taken from where it alone makes all of them ≥ 0 along a
// path of complementary points to zero. The path depends on d and on which sides are the unknowns, but on no
// objective.
//
// In doubles M may be a hundred thousand times worse conditioned than rounding allows elsewhere in this
// library; in twice the precision (DoubleDouble) no M that doubles can hold is out of reach, at thirty times
// the cost.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "data/iterate.h"
#include "data/working_set.h"
#include "feasibility/double_double.h"
#include "run/run.h"

namespace marble {

template <class Scalar>
class Lemke {
 public:
  explicit Lemke(const ScaledProblem& problem) : problem_(problem) {}

  /// Whether the method is for this problem: pairs, no inequality that it would not see, a tableau not too
  /// large.
  [[nodiscard]] bool applies() const;
  /// Way number 0, 1, … to a branch from z (scaled), where free variables stay. False if it ended in a ray,
  /// or the sides cannot be chosen so. Counts the factorizations that its pivots cost as much as.
  [[nodiscard]] bool run(Run& run, int way, ConstVectorRef z, WorkingSet& set);
  /// The point of a branch that its equalities and fixed sides determine, where free variables stay at z,
  /// with the multipliers that keep it there. False if they contradict each other.
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
  Tableau tableau_;                      // basic variables by nonbasic ones, the last column constant
  std::vector<Index> basic_, nonbasic_;  // what each row and column stands for
};

extern template class Lemke<double>;
extern template class Lemke<DoubleDouble>;

}  // namespace marble
