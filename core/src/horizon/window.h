// Provides the part of a staged problem between two stages as an LCQP, with fixed values before it.
#pragma once

#include <initializer_list>
#include <span>
#include <vector>

#include "marble/solution.h"
#include "model/interrupt.h"

namespace marble {

class Window {
 public:
  /// A row or pair belongs to the last stage of its variables.
  Window(const ProblemView& problem, std::span<const Index> stage);

  /// How the stages after a window are treated.
  enum class End {
    open,   ///< unknown: rows with a variable of these stages are left out
    known,  ///< fixed at the values in z
  };
  /// Returns the problem in the variables of the stages [first, end) and their rows; earlier variables are
  /// fixed at their values in z. Incomplete if interrupted.
  [[nodiscard]] Expected<OwnedProblem> problem(Index first, Index end, End behind,
                                               const std::vector<double>& z, const Interrupt& interrupt);
  /// Returns the values of its variables and rows in `whole`, as a solution of the window.
  [[nodiscard]] Solution part_of(const Solution& whole) const;
  /// Copies a solution of the window to `whole`, except rows and variables of stages from `end` on.
  void take(const Solution& answer, Index end, Solution& whole) const;

 private:
  struct Rows {
    std::vector<Index> kept;   // their numbers in the whole problem
    std::vector<Index> local;  // −1: not in the window
  };
  // First and last stage of the variables of each row.
  struct Reach {
    std::vector<Index> first, last;
  };
  [[nodiscard]] static Reach reach(std::initializer_list<const SparseMatrixView*> matrices, std::size_t rows,
                                   std::span<const Index> stage);
  [[nodiscard]] static Rows rows_of(const Reach& rows, Index first, Index end, End behind);
  [[nodiscard]] Expected<SparseMatrix> part(const SparseMatrixView& m, const Rows& rows,
                                            const std::vector<double>& z, std::span<const double> offsets,
                                            std::vector<double>& own, const char* name) const;

  ProblemView p_;
  std::span<const Index> stage_;
  Reach variable_reach_, equality_reach_, inequality_reach_, pair_reach_;
  Rows variables_, equalities_, inequalities_, pairs_;
};

}  // namespace marble
