// Decides whether some parts of a problem have a common point and, if not, which of them the refutation
// needs.
//
// It is a depth-first tree over the complementarities. A node consists of rows only, with one side fixed at
// zero for some pairs. A contradictory node yields the parts and sides that its proof needs, called a nogood.
// If one child of a branching does not need the side of its pair, the branching ends with that child's
// nogood. Otherwise it ends with the nogoods of both children and the complementarity. A nogood also closes
// every later node that has the same parts and sides, in this run and in later runs (Marques-Silva and
// Sakallah, "GRASP", 1999, for clauses).
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "global/linear_rows.h"
#include "global/nogoods.h"
#include "model/interrupt.h"

namespace marble {

/// Numbers of a problem's parts: rows of [A; C; L; R] by their number, then the complementarities. An L or R
/// row that is a part must be nonnegative.
struct PartNumbers {
  explicit PartNumbers(const Problem& problem)
      : first_side(problem.equalities() + problem.inequalities()), pairs(problem.pairs()) {}
  [[nodiscard]] Index size() const { return first_side + 3 * pairs; }
  [[nodiscard]] Index s(Index pair) const { return first_side + pair; }
  [[nodiscard]] Index t(Index pair) const { return first_side + pairs + pair; }
  [[nodiscard]] Index complementarity(Index pair) const { return first_side + 2 * pairs + pair; }

  Index first_side, pairs;
};

/// For each part, whether it is included.
using Parts = std::vector<std::uint8_t>;

class Refutation {
 public:
  enum class End {
    feasible,   ///< a point was found and checked
    refuted,    ///< `support()` alone has no point
    undecided,  ///< interrupted, or a node was neither feasible nor refuted
  };

  /// All arguments must outlive this object.
  Refutation(const Problem& problem, const Options& options, const SolveControls& controls,
             const SetupControls& setup);

  [[nodiscard]] End run(const Parts& parts);
  /// Returns the parts that the last successful refutation needs.
  [[nodiscard]] const Parts& support() const { return support_; }
  /// True if the limit of nodes is reached or the run was interrupted. Every further run is then undecided.
  [[nodiscard]] bool is_over() const;
  [[nodiscard]] const Interrupt& interrupt() const { return interrupt_; }
  [[nodiscard]] const LinearRows& rows() const { return rows_; }
  [[nodiscard]] LinearRows& rows() { return rows_; }
  [[nodiscard]] const PartNumbers& numbers() const { return numbers_; }

 private:
  // What a refutation needs, ascending: parts, and sides 2 k (s of pair k is 0) and 2 k + 1 (t is 0).
  struct Nogood {
    std::vector<Index> parts, sides;
  };

  [[nodiscard]] std::optional<Nogood> refute();
  [[nodiscard]] std::optional<Nogood> refute_rows(bool& feasible);
  [[nodiscard]] std::optional<Nogood> fork(Index pair);
  [[nodiscard]] Nogood reason(std::vector<HeldRow> rows);
  [[nodiscard]] std::vector<HeldRow> rows_here() const;
  [[nodiscard]] const Nogood* known() const;
  [[nodiscard]] bool is_met(const Parts& parts, ConstVectorRef z) const;
  [[nodiscard]] double apart(Index pair, ConstVectorRef z) const;
  [[nodiscard]] Index pair_to_fork(ConstVectorRef z) const;
  void learn(const Nogood& nogood);

  LinearRows rows_;
  PartNumbers numbers_;
  Interrupt interrupt_;
  Parts parts_, support_;
  std::vector<std::uint8_t> zero_;  // for each pair: 1 if s, 2 if t is zero in this node
  std::vector<double> weight_;      // for each pair: 1 + the number of nogoods that contain it
  std::vector<Nogood> nogoods_;
  std::vector<Vector> points_;  // from earlier runs
  NogoodMemory memory_;         // of nogoods and points together
  bool found_ = false;
  std::int64_t nodes_ = 0;
  int depth_ = 0;
};

}  // namespace marble
