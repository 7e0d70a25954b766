// One LCQP cut into pieces that rows tie together: a long horizon, stage by stage.
//
//   auto answer = marble::solve_in_pieces(problem, stage_of_variable, {.pieces = 8});
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "marble/composite/coupled.h"

namespace marble {

/// A problem in pieces. A row, or a pair, belongs to the last piece that it has a variable of; variables of
/// earlier pieces stand in it as copies, which coupling rows hold equal to them. An entry of Q between two
/// pieces goes to the last one, and takes as much as its size of both diagonals with it: a Q whose diagonal
/// dominates leaves convex pieces.
struct Pieces {
  std::vector<OwnedProblem> blocks;
  std::vector<SparseMatrix> coupling;
  std::vector<double> total;  ///< zeros, one a copy

  /// Of its arrays; it must outlive the view.
  [[nodiscard]] CoupledView view() const;
  /// The blocks' answers as one of the whole problem: copies left out.
  [[nodiscard]] Solution joined(std::span<const BlockAnswer> answers) const;
  /// An answer of the whole problem as where the pieces begin; each copy's price is what its piece has it
  /// cost.
  [[nodiscard]] CoupledStart start(const Solution& whole) const;

  /// Of the whole problem's variables and rows, the piece, and the place in it.
  struct Place {
    Index piece = 0;
    Index index = 0;
  };
  std::vector<Place> variables, equalities, inequalities, pairs;
};

/// Stages 0, 1, … dealt to as many pieces of equal length, one after the other. Errors: invalid_argument of
/// "stages" (negative ones, 2147483647, none) or "pieces" (not in [1, stages]).
[[nodiscard]] Expected<std::vector<Index>> pieces_by_stage(std::span<const Index> stage_of_variable,
                                                           Index pieces);

/// Cuts a problem: `piece_of_variable` (n) has entries from 0 to the last piece, each piece with a variable.
/// Errors: invalid_argument of "pieces", or of "total" where there would be more than kMostCouplingRows
/// copies; cancelled or deadline_exceeded where `ends` ended it.
[[nodiscard]] Expected<Pieces> cut(const Problem& problem, std::span<const Index> piece_of_variable,
                                   const SetupControls& ends = {});

/// How a long horizon is solved in pieces.
struct PiecesOptions {
  /// Of the pieces' agreement; `joint` must be true. By default ρ = 100, each pair keeps the side that it has
  /// after the pieces were solved one after the other, no better branch of the whole is looked for, and the
  /// tolerance is 1e-8: the whole is solved exactly from there.
  CoupledOptions coupled = {.proximal = 100.0, .freeze_after = 0, .tolerance = 1e-8, .joint_search = false};
  Index pieces = 2;  ///< >= 1, at most as many as there are stages
  /// Stages that each piece looks ahead while they are first solved one after the other, >= −1; −1: a third
  /// of a piece, but at least 2.
  Index look_ahead = -1;

  /// Errors name the field: "look_ahead", "joint", and as CoupledOptions::check does.
  [[nodiscard]] Expected<void> check() const;
};

/// The answer of a problem that was solved in pieces.
struct PiecesSolution {
  Solution whole;                 ///< of the problem itself, solved exactly from what the pieces found
  Coordination coordination;      ///< how the pieces came to it
  double blocks_objective = 0.0;  ///< of the pieces, before that
  double sweep_objective = 0.0;   ///< of the pieces one after the other, before they agreed
  std::int64_t sweep_factorizations = 0;
};

/// Solves the pieces one after the other, each from where the last one ends and with a look ahead; lets them
/// agree, all at once; and solves the branch that they have found as one. Where a piece has no answer at some
/// price, the whole is solved from the pieces as they came one after the other; `coordination` and the detail
/// of `whole` say so. Where that sweep fails it is solved whole, from nothing. Errors: invalid_argument of
/// "look_ahead", and as pieces_by_stage(), cut(), coordinate() and Solver::create name them.
[[nodiscard]] Expected<PiecesSolution> solve_in_pieces(const Problem& problem,
                                                       std::span<const Index> stage_of_variable,
                                                       const PiecesOptions& options = {},
                                                       const CoupledControls& controls = {});

}  // namespace marble
