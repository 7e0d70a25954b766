// A block of a coupled problem as an LCQP of one fixed pattern, for whoever solves it: a WarmSolver, a
// session.
//
//   min f(z) + λᵀv + ½ρ‖v − v⁻‖²   s.t.   z feasible for the block's LCQP,   E z − v = 0
//
// v are the rows of E that are not empty. Only their gradient λ − ρv⁻ changes from solve to solve. Once the
// block is frozen each pair is an equality, its fixed side, and an inequality; a flip exchanges their
// numbers.
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
  /// Of a block that check() has passed. Its arrays must outlive this.
  explicit LiftedBlock(const CoupledBlock& block);

  /// The block's; may be empty.
  [[nodiscard]] const std::string& name() const { return name_; }
  /// Coupling rows that see the block, ascending.
  [[nodiscard]] const std::vector<Index>& rows() const { return rows_; }
  /// n, without v, which are the variables from n on.
  [[nodiscard]] Index variables() const { return n_; }
  /// What is to be solved: another pattern once freeze() was called, other numbers after a flip().
  [[nodiscard]] const OwnedProblem& problem() const { return lifted_; }
  /// Whether freeze() was called.
  [[nodiscard]] bool frozen() const { return frozen_; }

  /// A solution of the block itself, and prices of its rows, as one of problem(): where a solve may begin.
  [[nodiscard]] Solution lifted(const Solution& own, std::span<const double> prices) const;
  /// From now on each pair keeps the side that is at zero in `answer`, one of problem(); returns the same
  /// answer as one of the problem() that there is then.
  [[nodiscard]] Solution freeze(const Solution& answer);
  /// A pair of a frozen block takes its other side.
  void flip(Index pair);
  /// Takes price, centre and ρ.
  void ask(const BlockAsk& ask);
  /// What has changed since the last call: the gradient, with another ρ the numbers of Q, and after a flip
  /// those of A, b, C and d.
  [[nodiscard]] ProblemUpdate update();

  /// An answer of problem() in the words of the coordinator. `proximal_response`: −dv/dλ of that answer,
  /// m_k × m_k by columns; empty where it is not known, and taken as ½/ρ; so where
  /// `ends` ended it. Without a response where the answer is not solved.
  [[nodiscard]] BlockAnswer answer(Solution lifted, std::vector<double> proximal_response,
                                   const SetupControls& ends = {}) const;

 private:
  void lift();
  [[nodiscard]] Index local(Index row) const;  // the place of a coupling row in rows_
  void write_sides();
  [[nodiscard]] Solution own(Solution lifted) const;
  [[nodiscard]] double objective(std::span<const double> z) const;

  std::string name_;
  ProblemView block_;
  SparseMatrixView coupling_;
  double proximal_ = 1.0;
  Index n_, n_e_, n_i_;
  std::vector<Index> rows_;
  std::vector<std::uint8_t> side_;  // of a frozen pair: 1 where s is fixed
  struct Entry {
    Index row;  // pair
    std::size_t in_A, in_C;
    double s, t;  // L's number there, and R's
  };
  std::vector<Entry> pair_entries_;
  bool frozen_ = false, sides_changed_ = false, proximal_changed_ = false;
  OwnedProblem lifted_;
};

/// −dv/dλ of a lifted block's answers, by their branches; scaling and analysis are kept from one to the next.
class LiftedResponse {
 public:
  /// Of an answer to block.problem(), after `update` of it: m_k × m_k by columns, m_k back-substitutions.
  /// Empty where the answer is no isolated one of its branch, or `ends` ended it. The block's arrays must
  /// outlive this. `create` replaces Sensitivity::create. Errors: its resource_exhausted.
  using Create = std::function<Expected<Sensitivity>(const Problem&, const Solution&)>;
  [[nodiscard]] Expected<std::vector<double>> at(const LiftedBlock& block, const ProblemUpdate& update,
                                                 const Solution& answer, const Create& create = {},
                                                 const SetupControls& ends = {});
  /// What is kept, in bytes.
  [[nodiscard]] std::int64_t memory_bytes() const { return sensitivity_ ? sensitivity_->memory_bytes() : 0; }
  /// The block has another pattern.
  void forget() { sensitivity_.reset(); }

 private:
  std::optional<Sensitivity> sensitivity_;
};

/// The response S of a block without its proximal term, from that with it, T = (S⁻¹ + ρI)⁻¹: both m × m by
/// columns. Where the block is flat the curvature is taken as 1e-6 ρ; where it is negative, as its amount.
/// Empty where `ends` ended it.
[[nodiscard]] std::vector<double> without_proximal(std::vector<double> with, std::size_t m, double proximal,
                                                   const SetupControls& ends = {});

}  // namespace marble
