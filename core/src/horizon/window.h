// The part of a staged problem between two stages, as an LCQP of its own: what lies before is known.
#pragma once

#include <initializer_list>
#include <span>
#include <vector>

#include "data/interrupt.h"
#include "marble/solution.h"

namespace marble {

class Window {
 public:
  /// A row, or a pair, belongs to the last stage that it has a variable of.
  Window(const ProblemView& problem, std::span<const Index> stage);

  /// What lies behind a window.
  enum class End {
    open,   ///< nobody knows it: rows with a variable of it are left out
    known,  ///< it is as z has it
  };
  /// The variables of the stages [first, end), and their rows; those before are as z has them. Not whole if
  /// interrupted.
  [[nodiscard]] Expected<OwnedProblem> problem(Index first, Index end, End behind,
                                               const std::vector<double>& z, const Interrupt& interrupt);
  /// What is known of its variables and rows, as a solution of it.
  [[nodiscard]] Solution part_of(const Solution& whole) const;
  /// Takes an answer to it over, but for rows and variables of stages from `end` on.
  void take(const Solution& answer, Index end, Solution& whole) const;

 private:
  struct Rows {
    std::vector<Index> kept;   // their numbers in the whole
    std::vector<Index> local;  // −1: none of the window's
  };
  // From the first to the last stage that a row has a variable of.
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
