// Decides whether some rows of a problem, as equalities or inequalities, have a common point: gives a proof
// or the point.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "marble/solver.h"
#include "model/linear_algebra.h"

namespace marble {

/// A row of [A; C; L; R], required to be zero or only nonnegative.
struct HeldRow {
  Index row;
  bool equality;
};

class LinearRows {
 public:
  enum class End {
    feasible,       ///< the point is z()
    contradiction,  ///< proved by multipliers()
    undecided,      ///< interrupted, or neither was found
  };

  /// All arguments must outlive this object. Only the tolerances and the time limit of the options are used.
  LinearRows(const Problem& problem, const Options& options, const SolveControls& controls,
             const SetupControls& setup);

  /// Ignores the objective; variables in none of the rows are 0.
  [[nodiscard]] End decide(std::span<const HeldRow> rows);
  /// Returns the rows of the last contradiction that remain at a vertex of the set of its multipliers: none
  /// of them can be removed (Gleeson and Ryan, "Identifying minimally infeasible subsystems of inequalities",
  /// 1990). Holds only to rounding; decide() must prove that they contradict. Empty if the tableau would be
  /// too large.
  [[nodiscard]] std::vector<HeldRow> vertex(std::span<const HeldRow> rows) const;

  /// n
  [[nodiscard]] const Vector& z() const { return z_; }
  /// One for each row: Σ m (row z + offset) = 1 for every z, to rounding; m ≤ 0 for inequalities.
  [[nodiscard]] const std::vector<double>& multipliers() const { return multipliers_; }

  /// Returns a row's value at z in user units.
  [[nodiscard]] double value(Index row, ConstVectorRef z) const;
  /// Returns by how much a row may be violated.
  [[nodiscard]] double tolerance(Index row) const;

  [[nodiscard]] const Problem& problem() const { return problem_; }
  [[nodiscard]] Index rows() const { return rows_.rows; }
  [[nodiscard]] std::int64_t programs() const { return programs_; }
  [[nodiscard]] std::int32_t factorizations() const { return factorizations_; }
  [[nodiscard]] std::int32_t iterations() const { return iterations_; }
  [[nodiscard]] const Times& times() const { return times_; }

 private:
  [[nodiscard]] OwnedProblem program(std::span<const HeldRow> rows);
  [[nodiscard]] bool take_multipliers(std::span<const HeldRow> rows, std::span<const double> stacked);
  [[nodiscard]] bool take_point(std::span<const HeldRow> rows, std::span<const double> z);

  const Problem& problem_;
  Options options_;
  SolveControls controls_;
  SetupControls setup_;
  RowMatrix rows_;  // [A; C; L; R], in the user's units
  Vector offset_;
  std::vector<double> tolerances_;  // of A, C, and of the pairs' sides
  std::vector<Index> columns_;      // variables of the last program
  std::vector<Index> place_;        // of each variable in the program; −1 if outside
  Vector z_;
  std::vector<double> multipliers_;
  std::int64_t programs_ = 0;
  std::int32_t factorizations_ = 0, iterations_ = 0;
  Times times_;
};

}  // namespace marble
