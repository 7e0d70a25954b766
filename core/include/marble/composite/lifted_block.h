// A block of a coupled problem as an LCQP with a fixed pattern, for any solver: a WarmSolver or a session.
//
//   min f(z) + λᵀv + ½ρ‖v − v⁻‖²   s.t.   z feasible for the block's LCQP,   E z − v = 0
//
// v are the nonempty rows of E. Only their gradient λ − ρv⁻ changes from solve to solve. After the block is
// frozen, each pair is an equality (its fixed side) and an inequality; a switch of the pair exchanges the
// numbers of the two.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "marble/composite/coupled.h"
#include "marble/problem.h"
#include "marble/sensitivity.h"
#include "marble/solution.h"

namespace marble {

class LiftedBlock {
 public:
  /// The block must have passed check(). Its arrays must outlive this object.
  explicit LiftedBlock(const CoupledBlock& block);

  /// Returns the block's name, which may be empty.
  [[nodiscard]] const std::string& name() const { return name_; }
  /// Returns the coupling rows in which the block appears, ascending.
  [[nodiscard]] const std::vector<Index>& rows() const { return rows_; }
  /// Returns n, without v, which are the variables from n on.
  [[nodiscard]] Index variables() const { return n_; }
  /// Returns the problem to solve. freeze() changes its pattern; switch_pair() changes its numbers.
  [[nodiscard]] const OwnedProblem& problem() const { return lifted_; }
  /// True after freeze().
  [[nodiscard]] bool frozen() const { return frozen_; }

  /// Converts a solution of the block itself, and multipliers of its coupling rows, to a starting point of
  /// problem().
  [[nodiscard]] Solution lifted(const Solution& own, std::span<const double> coupling_multipliers) const;
  /// Fixes each pair on the side that is at zero in `answer`, a solution of problem(); returns `answer` as a
  /// solution of the new problem().
  [[nodiscard]] Solution freeze(const Solution& answer);
  /// Switches a pair of a frozen block to its other side.
  void switch_pair(Index pair);
  /// Sets the multipliers, the center and ρ.
  void ask(const BlockAsk& ask);
  /// Returns the changes since the last call: the gradient; if ρ changed, the numbers of Q; and after a
  /// switch those of A, b, C and d.
  [[nodiscard]] ProblemUpdate update();

  /// Converts a solution of problem() to a response to the coordinator. `proximal_response`: −dv/dλ of that
  /// solution, m_k × m_k by columns; empty if unknown. ½/ρ is used instead if it is empty or if `ends` ends
  /// the conversion. The response is empty if the problem is not solved.
  [[nodiscard]] BlockAnswer answer(Solution lifted, std::vector<double> proximal_response,
                                   const SetupControls& ends = {}) const;

 private:
  void lift();
  [[nodiscard]] Index local(Index row) const;  // the position of a coupling row in rows_
  void write_sides();
  [[nodiscard]] Solution own(Solution lifted) const;
  [[nodiscard]] double objective(std::span<const double> z) const;

  std::string name_;
  ProblemView block_;
  SparseMatrixView coupling_;
  double proximal_ = 1.0;
  Index n_, n_e_, n_i_;
  std::vector<Index> rows_;
  std::vector<std::uint8_t> side_;  // for each frozen pair: 1 if s is fixed
  struct Entry {
    Index row;  // pair
    std::size_t in_A, in_C;
    double s, t;  // the entries of L and R at this place
  };
  std::vector<Entry> pair_entries_;
  bool frozen_ = false, sides_changed_ = false, proximal_changed_ = false;
  OwnedProblem lifted_;
};

/// Computes −dv/dλ of a lifted block's solutions on their branches; keeps scaling and analysis between calls.
class LiftedResponse {
 public:
  /// Returns it for a solution of block.problem() after `update`: m_k × m_k by columns, by m_k
  /// back-substitutions. Empty if the solution is not an isolated one of its branch, or if `ends` ended it.
  /// The block's arrays must outlive this object. `create` replaces Sensitivity::create. Errors: its
  /// resource_exhausted.
  using Create = std::function<Expected<Sensitivity>(const Problem&, const Solution&)>;
  [[nodiscard]] Expected<std::vector<double>> at(const LiftedBlock& block, const ProblemUpdate& update,
                                                 const Solution& answer, const Create& create = {},
                                                 const SetupControls& ends = {});
  /// Returns the memory in use, in bytes.
  [[nodiscard]] std::int64_t memory_bytes() const { return sensitivity_ ? sensitivity_->memory_bytes() : 0; }
  /// Call this after the block's pattern has changed.
  void forget() { sensitivity_.reset(); }

 private:
  std::optional<Sensitivity> sensitivity_;
};

/// Returns the response S of a block without its proximal term, from the response with it, T = (S⁻¹ + ρI)⁻¹:
/// both m × m by columns. Where the block is flat, the curvature is taken as 1e-6 ρ; where it is negative, as
/// its absolute value. Empty if `ends` ended it.
[[nodiscard]] std::vector<double> without_proximal(std::vector<double> with, std::size_t m, double proximal,
                                                   const SetupControls& ends = {});

}  // namespace marble
