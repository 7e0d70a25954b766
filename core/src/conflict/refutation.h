// Whether some parts of a problem have a point, and if not, which of them the refutation needs.
//
// A tree over the complementarities, depth first. A node is rows alone: in it some pairs have a side that is
// zero. A node that contradicts itself leaves the parts and the sides of its proof; a fork whose one child
// needs no side of the fork's pair ends with that child's, else with those of both and the complementarity.
// What a node has left (a nogood) also ends every later node that has the same parts and sides, in this and
// in later runs (Marques-Silva and Sakallah, "GRASP", 1999, for clauses).
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "conflict/linear_rows.h"
#include "data/interrupt.h"

namespace marble {

/// Numbers of a problem's parts: rows of [A; C; L; R] by theirs, then the complementarities. An L or R row
/// that is a part is nonnegative.
struct PartNumbers {
  explicit PartNumbers(const Problem& problem)
      : first_side(problem.equalities() + problem.inequalities()), pairs(problem.pairs()) {}
  [[nodiscard]] Index size() const { return first_side + 3 * pairs; }
  [[nodiscard]] Index s(Index pair) const { return first_side + pair; }
  [[nodiscard]] Index t(Index pair) const { return first_side + pairs + pair; }
  [[nodiscard]] Index complementarity(Index pair) const { return first_side + 2 * pairs + pair; }

  Index first_side, pairs;
};

/// Of each part, whether it is there.
using Parts = std::vector<std::uint8_t>;

class Refutation {
 public:
  enum class End {
    feasible,   ///< there is a point: it was checked
    refuted,    ///< `support()` alone has none
    undecided,  ///< interrupted, or a node was neither
  };

  /// All must outlive it.
  Refutation(const Problem& problem, const Options& options, const SolveControls& controls,
             const SetupControls& setup);

  [[nodiscard]] End run(const Parts& parts);
  /// Of the last run that refuted: which of its parts it needs.
  [[nodiscard]] const Parts& support() const { return support_; }
  /// Whether it has come to its limit of nodes, or was interrupted: each further run is undecided.
  [[nodiscard]] bool is_over() const;
  [[nodiscard]] const Interrupt& interrupt() const { return interrupt_; }
  [[nodiscard]] const LinearRows& rows() const { return rows_; }
  [[nodiscard]] LinearRows& rows() { return rows_; }
  [[nodiscard]] const PartNumbers& numbers() const { return numbers_; }

 private:
  // What a refutation needs, ascending: parts, and sides 2 k (s of pair k is 0) and 2 k + 1 (t is).
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
  [[nodiscard]] bool may_keep(std::size_t numbers);

  LinearRows rows_;
  PartNumbers numbers_;
  Interrupt interrupt_;
  Parts parts_, support_;
  std::vector<std::uint8_t> zero_;  // of each pair: 1 where s, 2 where t is zero in this node
  std::vector<double> weight_;      // of each pair: 1 + in how many nogoods it was
  std::vector<Nogood> nogoods_;
  std::vector<Vector> points_;  // of earlier runs
  double kept_numbers_ = 0.0;   // of nogoods and points together
  bool found_ = false;
  std::int64_t nodes_ = 0;
  int depth_ = 0;
};

}  // namespace marble
