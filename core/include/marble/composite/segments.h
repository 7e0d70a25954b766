// One LCQP divided into horizon segments with coupling rows: a long horizon, stage by stage.
//
//   auto answer = marble::solve_in_segments(problem, stage_of_variable, {.num_segments = 8});
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "marble/composite/coupled.h"

namespace marble {

/// A problem in segments. A row or pair belongs to the last segment that contains one of its variables.
/// Variables of earlier segments appear in it as copies, and coupling rows keep copies and originals equal.
/// An entry of Q between two segments belongs to the last one, and takes its absolute value from both
/// diagonals with it: segments of a diagonally dominant Q are convex.
struct Segments {
  std::vector<OwnedProblem> blocks;
  std::vector<SparseMatrix> coupling;
  std::vector<double> coupling_rhs;  ///< zeros, one for each copy

  /// Returns a view of the arrays, which must outlive it.
  [[nodiscard]] CoupledView view() const;
  /// Combines the blocks' solutions into one of the whole problem, without the copies.
  [[nodiscard]] Solution joined(std::span<const BlockAnswer> answers) const;
  /// Converts a solution of the whole problem to a start of the segments; the multiplier of each copy is the
  /// cost that its segment assigns to it.
  [[nodiscard]] CoupledStart start(const Solution& whole) const;

  /// For each variable and row of the whole problem: its segment, and its position there.
  struct Place {
    Index segment = 0;
    Index index = 0;
  };
  std::vector<Place> variables, equalities, inequalities, pairs;
};

/// Distributes stages 0, 1, … over segments of equal length, one after the other. Errors: invalid_argument of
/// "stages" (negative ones, 2147483647, none) or "num_segments" (not in [1, stages]).
[[nodiscard]] Expected<std::vector<Index>> segments_by_stage(std::span<const Index> stage_of_variable,
                                                             Index num_segments);

/// Divides a problem: `segment_of_variable` (n) has entries from 0 to the last segment, and each segment has
/// a variable. Errors: invalid_argument of "segments", or of "coupling_rhs" if there would be more than
/// kMostCouplingRows copies; cancelled or deadline_exceeded if `ends` ended it.
[[nodiscard]] Expected<Segments> cut(const Problem& problem, std::span<const Index> segment_of_variable,
                                     const SetupControls& ends = {});

/// Options of the solve of a long horizon in segments.
struct SegmentsOptions {
  /// For the agreement of the segments; `monolithic` must be true. By default ρ = 100, each pair keeps the
  /// side that it has after the forward pass over the segments, no better branch of the whole problem is
  /// searched for, and the tolerance is 1e-8, because the whole problem is then solved exactly.
  CoupledOptions coupled = {
      .proximal = 100.0, .freeze_after = 0, .tolerance = 1e-8, .monolithic_search = false};
  Index num_segments = 2;  ///< >= 1, at most the number of stages
  /// Number of stages of overlap for each segment in the forward pass, >= −1; −1: a third of a segment,
  /// but at least 2.
  Index overlap = -1;

  /// Checks all options. Errors name the field: "overlap", "monolithic", and those of CoupledOptions::check.
  [[nodiscard]] Expected<void> check() const;
};

/// The solution of a problem that was solved in segments.
struct SegmentsSolution {
  Solution whole;                 ///< of the problem itself, solved exactly from the result of the segments
  Coordination coordination;      ///< how the segments reached it
  double blocks_objective = 0.0;  ///< of the segments, before the exact solve
  double sweep_objective = 0.0;   ///< of the forward pass, before the segments agreed
  std::int64_t sweep_factorizations = 0;
};

/// Solves the segments one after the other, each from the end of the last one and with a overlap (forward
/// pass); then makes them agree, all at once; and solves the branch found as one problem. If a segment has no
/// solution for some multipliers, the whole problem is solved from the forward pass; `coordination` and the
/// detail of `whole` say so. If the forward pass fails, the whole problem is solved cold. Errors:
/// invalid_argument of "overlap", and those of segments_by_stage(), cut(), coordinate() and Solver::create.
[[nodiscard]] Expected<SegmentsSolution> solve_in_segments(const Problem& problem,
                                                           std::span<const Index> stage_of_variable,
                                                           const SegmentsOptions& options = {},
                                                           const CoupledControls& controls = {});

}  // namespace marble
