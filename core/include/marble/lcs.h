// Linear complementarity systems (LCS), and plans over a horizon of them: one LCQP for each control step.
//
//   x₊ = A x + B u + D λ + d,   0 ≤ λ ⊥ E x + F λ + H u + c ≥ 0
//
//   auto planner = marble::LcsPlanner::create(matrices, {.stages = 10, .Q = q, .R = r});
//   auto solver = marble::WarmSolver::create(*marble::Problem::create(planner->problem()));
//   auto plan = planner->step(*solver, {.x0 = state});       // plan->u: the inputs, stage by stage
//
// All matrices are dense and stored row by row.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "marble/error.h"
#include "marble/options.h"
#include "marble/problem.h"
#include "marble/restart.h"
#include "marble/solution.h"
#include "marble/solver.h"

namespace marble {

class WarmSolver;

/// The unchecked matrices and vectors of a system. Each is one for all stages, or one per stage, stage after
/// stage; all that have one per stage have the same number of stages. Borrows its arrays.
struct LcsView {
  Index states = 0;                ///< nx ≥ 1
  Index inputs = 0;                ///< nu ≥ 1
  Index pairs = 0;                 ///< nl ≥ 0
  std::span<const double> A = {};  ///< nx × nx
  std::span<const double> B = {};  ///< nx × nu
  std::span<const double> D = {};  ///< nx × nl
  std::span<const double> d = {};  ///< nx
  std::span<const double> E = {};  ///< nl × nx
  std::span<const double> F = {};  ///< nl × nl
  std::span<const double> H = {};  ///< nl × nu
  std::span<const double> c = {};  ///< nl
};

/// The parts of a system, in the order of the equation.
enum class LcsPart { A, B, D, d, E, F, H, c };
/// Their number.
inline constexpr std::size_t lcs_part_count = 8;

/// A system whose sizes agree and whose numbers are finite. Owns its matrices.
class LCS {
 public:
  /// Checks and copies. Errors: invalid_argument with the field, which is "A" of a part that is constant and
  /// "A[3]" of one stage, the index in that matrix, row by row, and the bound.
  [[nodiscard]] static Expected<LCS> create(const LcsView& view);

  /// nx
  [[nodiscard]] Index states() const { return states_; }
  /// nu
  [[nodiscard]] Index inputs() const { return inputs_; }
  /// nl
  [[nodiscard]] Index pairs() const { return pairs_; }
  /// Returns the number of stages; 0 if every part is constant.
  [[nodiscard]] Index stages() const { return stages_; }
  /// Returns a part in stage `stage`, from 0, row by row.
  [[nodiscard]] std::span<const double> part(LcsPart part, Index stage) const;

 private:
  LCS() = default;

  Index states_ = 0, inputs_ = 0, pairs_ = 0, stages_ = 0;
  std::array<std::vector<double>, lcs_part_count> parts_;
  std::array<std::size_t, lcs_part_count> strides_ = {};  // from stage to stage; 0: constant
};

/// States, inputs and complementarity variables along a horizon of N stages.
struct LcsTrajectory {
  std::vector<double> x;    ///< (N + 1) × nx, from the initial state on
  std::vector<double> u;    ///< N × nu
  std::vector<double> lam;  ///< N × nl
};

/// Simulates a system: solves one small linear complementarity problem per stage by Lemke's method. `x0`: nx
/// numbers; `u`: N × nu, N ≥ 1 and equal to the stages of a system that has them. Where an LCP has several
/// solutions, the result is one of them. Errors: invalid_argument of fields "x0" and "u"; failed_precondition
/// of field "stages", with the stage as index, if the method ends in a ray or overflows: then it has found no
/// λ for that stage, and for many classes of F there is none.
[[nodiscard]] Expected<LcsTrajectory> rollout(const LCS& lcs, std::span<const double> x0,
                                              std::span<const double> u);

/// A planning problem:
///
///   min Σ_{k<N} |x_k − x_ref,k|²_Q + |u_k − u_ref,k|²_R + |u_k − u_{k−1}|²_R_change + regularization |λ_k|²
///       + |x_N − x_ref,N|²_P
///
/// with |v|²_W = vᵀWv, over the inputs u_0 … u_{N−1}. States are bounded in stages 1 … N: the first row of
/// x_lb is that of stage 1. Absent limits are ±infinity or ±infinite_limit. Each entry has a limit in all
/// stages or in none, as each finite limit is a row of the LCQP, whose pattern is fixed.
struct LcsTask {
  Index stages = 0;       ///< N ≥ 1
  std::vector<double> Q;  ///< nx × nx symmetric, or N of them
  std::vector<double> R;  ///< nu × nu symmetric, or N of them
  /// nx × nx symmetric; empty: the solution of the discrete algebraic Riccati equation of the last stage's A,
  /// B, Q and R
  std::vector<double> P = {};
  std::vector<double> R_change = {};      ///< nu × nu symmetric; empty: none
  double regularization = 0.0;            ///< ≥ 0; makes λ unique where contact forces are not
  std::vector<double> x_ref = {};         ///< nx, or (N + 1) × nx; empty: zeros
  std::vector<double> u_ref = {};         ///< nu, or N × nu; empty: zeros
  std::vector<double> x_lb = {};          ///< nx, or N × nx; empty: none
  std::vector<double> x_ub = {};          ///< nx, or N × nx, ≥ x_lb; empty: none
  std::vector<double> u_lb = {};          ///< nu, or N × nu; empty: none
  std::vector<double> u_ub = {};          ///< nu, or N × nu, ≥ u_lb; empty: none
  std::vector<double> max_u_change = {};  ///< nu, ≥ 0: of |u_k − u_{k−1}| from stage to stage; empty: none
};

/// The new numbers of a control step. Absent ones keep their values.
struct LcsStep {
  std::span<const double> x0 = {};     ///< nx: the measured state
  const LcsView* lcs = nullptr;        ///< a system of the same sizes
  std::span<const double> x_ref = {};  ///< nx, or (N + 1) × nx
  std::span<const double> u_ref = {};  ///< nu, or N × nu
  /// nu: the input before stage 0, of which R_change and max_u_change begin. By default the input of the last
  /// plan that its shift drops last; before the first plan, zeros.
  std::span<const double> last_u = {};
  /// N × nu: inputs to roll out, instead of the last plan's, shifted; before the first plan, u_ref
  std::span<const double> u = {};
  Index shift = 1;  ///< in [0, N]: stages by which the last plan moves on before it is rolled out
  /// nx, or N × nx: limits of stages 1 … N, finite exactly where the task's are, and x_lb ≤ x_ub with those
  /// that keep their values. They are not shifted with the plan.
  std::span<const double> x_lb = {};
  std::span<const double> x_ub = {};  ///< as x_lb
  std::span<const double> u_lb = {};  ///< nu, or N × nu: as x_lb, of stages 0 … N − 1
  std::span<const double> u_ub = {};  ///< as u_lb
};

/// Where a plan comes from.
enum class PlanOrigin {
  solve,          ///< the solver's solution
  solve_rollout,  ///< the inputs of the solver's solution, rolled out: the solution itself is not feasible
  start_rollout,  ///< the start: the last plan's inputs, shifted and rolled out
};

/// "solve", "solve_rollout", "start_rollout".
[[nodiscard]] const char* to_string(PlanOrigin origin);

/// The result of a control step.
struct LcsPlan : LcsTrajectory {
  double objective = 0.0;                     ///< of the plan, as LcsTask defines it
  Status status = Status::numerical_failure;  ///< why the solve ended; its solution may not be the plan
  PlanOrigin origin = PlanOrigin::solve;      ///< where the plan comes from
  /// Whether the violations are within the tolerances. False only if neither the solve nor a roll-out has
  /// found a feasible plan; `detail` says why.
  bool feasible = false;
  Violations violations;  ///< of dynamics, bounds and complementarity
  /// The objective of the rolled-out start, which a feasible plan does not exceed; +∞ if that is not feasible
  double start_objective = std::numeric_limits<double>::infinity();
  std::string detail;       ///< of the solve and, if the roll-out has failed, why
  double assembly_s = 0.0;  ///< seconds for the numbers of the LCQP
  double rollout_s = 0.0;   ///< seconds for all roll-outs
  Times times;              ///< of the solve
};

/// The numbers that a control step sends to a solver. Borrows arrays of the planner until its next call.
struct LcsUpdate {
  ProblemUpdate numbers;  ///< only what has changed
  Restart restart;        ///< the shift, and the rolled-out start if there is one
};

/// What a planner reads of a solution.
struct LcsAnswer {
  Status status = Status::numerical_failure;  ///< of the solve
  std::span<const double> z = {};             ///< n; empty if there is none, as after a deadline
  std::string detail = {};                    ///< of the solve
  Times times = {};                           ///< of the solve
};

/// Turns control steps into numbers of one LCQP of fixed pattern, and its solutions into plans. Variables are
/// z = (u_0, λ_0, x_1, …, u_{N−1}, λ_{N−1}, x_N); all vectors have N equal parts, so that Shift::by_stage
/// applies. Blocks are dense: zeros are part of the pattern. It contains no solver: `step` takes one in
/// process, and with `begin` and `finish` any session may solve. One thread at a time.
class LcsPlanner {
 public:
  /// Errors: invalid_argument with the field in the system or in the task; failed_precondition of field "P"
  /// if the Riccati equation has no stabilizing solution. Of `options` only the tolerances are used.
  [[nodiscard]] static Expected<LcsPlanner> create(const LcsView& lcs, const LcsTask& task,
                                                   const Options& options = {});

  /// A moved-from planner may only be assigned to or destroyed.
  LcsPlanner(LcsPlanner&&) noexcept;
  /// As the move constructor.
  LcsPlanner& operator=(LcsPlanner&&) noexcept;
  ~LcsPlanner();

  /// Returns the LCQP with the current numbers, whose upper triangle of Q alone is stored. Valid until the
  /// next call.
  [[nodiscard]] ProblemView problem() const;
  /// Returns P, nx × nx, as it was given or computed.
  [[nodiscard]] std::span<const double> terminal_cost() const;

  /// Sets a step's numbers and rolls out the start. Errors: invalid_argument with the field; nothing has
  /// changed then. x0 is required.
  [[nodiscard]] Expected<LcsUpdate> begin(const LcsStep& step);
  /// The preparation phase of a step, before its state is known: the same for what is known already. Without
  /// x0 the state is the one that the last plan predicts. The following begin() or step() does not shift
  /// again.
  [[nodiscard]] Expected<LcsUpdate> prepare(const LcsStep& step);
  /// Sends all numbers with the next step: for a solver that has refused or lost an update.
  void resend();
  /// Returns the plan of the last begin(), given the solution of its numbers. Errors: invalid_argument of
  /// field "z"; failed_precondition without a begin().
  [[nodiscard]] Expected<LcsPlan> finish(const LcsAnswer& answer);

  /// One control step: begin(), a solve by `solver`, which must have been made for problem(), and finish().
  /// Errors: of the parts.
  [[nodiscard]] Expected<LcsPlan> step(WarmSolver& solver, const LcsStep& step,
                                       const SolveControls& controls = {});

 private:
  struct State;
  explicit LcsPlanner(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace marble
