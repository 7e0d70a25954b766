// One plan for many scenarios: variables x that are decided once, and a recourse y_s for each sampled
// scenario ξ_s.
//
//   min  Σ π_s q(x, y_s; ξ_s)   s.t. rows of x alone, once;   rows and pairs of (x, y_s; ξ_s), for every s
//
// The average over N samples is an LCQP that grows with N. It is solved for more and more samples, each
// sample-average stage from the solution of the last one (retrospective approximation; S. Gupta, R.
// Bollapragada, A. Berahas, "Retrospective Approximation for Stochastic Constrained Problems Using Sequential
// Quadratic Programming").
//
//   marble::ScenarioProblem scenarios{.base = problem.view(), .first_stage = plan, .sample = height};
//   auto answer = marble::solve_scenarios(scenarios, {.max_sample_size = 64});
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "marble/error.h"
#include "marble/options.h"
#include "marble/problem.h"
#include "marble/solution.h"
#include "marble/solver.h"

namespace marble {

/// The numbers of one scenario, in the pattern of the base problem. Empty parts are those of the base.
struct ScenarioNumbers {
  std::optional<double> c0 = {};  ///< constant cost
  std::vector<double> g = {};     ///< n
  std::vector<double> b = {};     ///< n_e
  std::vector<double> d = {};     ///< n_i
  std::vector<double> l = {};     ///< n_c
  std::vector<double> r = {};     ///< n_c
  std::vector<double> Q = {};     ///< one per stored entry; for a full Q, only the upper ones are used
  std::vector<double> A = {};     ///< one per stored entry
  std::vector<double> C = {};     ///< one per stored entry
  std::vector<double> L = {};     ///< one per stored entry
  std::vector<double> R = {};     ///< one per stored entry
  double weight = 1.0;            ///< > 0: π_s is its share of the sum over the scenarios of the stage

  /// Returns an update with views of the arrays, which must outlive it.
  [[nodiscard]] ProblemUpdate update() const { return {c0, g, b, d, l, r, Q, A, C, L, R}; }
};

/// What differs between scenarios, and what does not. Borrows the arrays of `base`.
struct ScenarioProblem {
  ProblemView base;                ///< over (x, y) in any order; its objective is q
  std::vector<Index> first_stage;  ///< the variables x, ascending, at least one; all others are y
  /// Rows of x alone that still differ between scenarios: each scenario has its own copy. Rows with y exist
  /// for each scenario anyway; other rows of x alone appear once, with the numbers of the base.
  std::vector<Index> own_equalities = {};
  std::vector<Index> own_inequalities = {};  ///< ascending, as own_equalities
  std::vector<Index> own_pairs = {};         ///< ascending, as own_equalities
  /// Returns scenario i ≥ 0, the same in every call. Called by one thread, in ascending order.
  std::function<Expected<ScenarioNumbers>(std::int64_t i)> sample = {};
  std::int64_t scenarios = std::numeric_limits<std::int64_t>::max();  ///< ≥ 1: number of scenarios that exist
};

/// Why the sample-average stages ended.
enum class ScenarioEnd {
  interval,    ///< the out-of-sample cost is known to `tolerance`
  samples,     ///< the sample has max_sample_size, or all that exist
  not_solved,  ///< the last stage ended with a status other than solved: see status
  too_large,   ///< the next stage needs more memory than allowed
  time_limit,  ///< the time limit of the options was reached
  cancelled,   ///< the stop token ended it
};
/// "interval", "samples", "not_solved", "too_large", "time_limit", "cancelled".
[[nodiscard]] const char* to_string(ScenarioEnd end);

/// The cost of a stage's plan in out-of-sample scenarios: the next ones, each with its best recourse.
struct OutOfSample {
  std::int64_t scenarios = 0;   ///< scenarios tried
  std::int64_t infeasible = 0;  ///< scenarios among them without a feasible y for the plan
  double mean = 0.0;            ///< mean cost of the others
  /// Half of the 95 % interval: 1.96 · standard deviation / √scenarios; +∞ for fewer than two.
  double half_width = std::numeric_limits<double>::infinity();
  std::int64_t factorizations = 0;  ///< of all these scenarios
  double seconds = 0.0;             ///< wall time
};

/// The result of one sample-average stage.
struct SampleAverageStage {
  std::int32_t stage = 0;                     ///< from 0
  std::int64_t scenarios = 0;                 ///< N: the scenarios 0 … N − 1
  Status status = Status::numerical_failure;  ///< of its LCQP
  std::string detail;                         ///< of its LCQP, as Solution::detail
  double objective = 0.0;                     ///< Σ π_s q(x, y_s; ξ_s)
  std::int32_t variables = 0;                 ///< of its LCQP
  std::int32_t pairs = 0;                     ///< of its LCQP
  std::int64_t factorizations = 0;            ///< of its LCQP, all attempts
  double seconds = 0.0;                       ///< set-up and solve, wall time
  bool warm = false;              ///< it kept the branch of the previous stage, extended to the new scenarios
  bool searched = false;          ///< also solved cold, since feasibility of its start had to be restored
  std::int64_t memory_bytes = 0;  ///< of its numbers, its LCQP, its solver and solutions, by their estimates
  std::optional<OutOfSample> out_of_sample = {};  ///< absent if no scenarios are left or none are requested
  std::span<const double> x = {};                 ///< its plan; valid only during the call
};

/// Optional settings.
struct ScenarioSettings {
  /// For every stage, except time_limit_s, which covers all of them, and max_local_search_factorizations,
  /// which is at most 50 in all stages but the first. If feasibility of a stage's start had to be restored,
  /// the stage is also solved cold before the next one; the last stage only if `starts` is above 1.
  Options options = {};
  std::int64_t initial_sample_size = 1;  ///< N₀ ≥ 1
  double growth = 2.0;                   ///< ω > 1: N_k = ⌈N₀ ωᵏ⌉, at least one more than the last
  std::int64_t max_sample_size = 64;  ///< ≥ initial_sample_size: a stage that would have more has this many
  double tolerance = 0.0;             ///< ≥ 0: ends when half_width ≤ tolerance · |mean|; 0: never
  std::int64_t min_sample_size =
      8;  ///< ≥ 1: no end by `tolerance` before N is as large, since few scenarios may agree on a poor plan
  double max_infeasible_fraction = 0.05;  ///< in [0, 1]: no end by `tolerance` while a larger share of the
                                          ///< out-of-sample scenarios has no recourse
  /// ≥ 0, for each stage: minimum number of out-of-sample scenarios; those that the next stage adds are tried
  /// anyway. 0: no scenarios beyond the last stage are drawn, and its plan is not tried.
  std::int64_t out_of_sample_scenarios = 16;
  std::function<void(const SampleAverageStage&)> stage = {};  ///< called after every stage
};

/// The newest plan that a stage has confirmed.
struct ScenarioSolution {
  ScenarioEnd end = ScenarioEnd::not_solved;  ///< why the solve ended
  /// Status of the last stage: solved if the plan is from it. Otherwise the status with which it ended, while
  /// x is from the previous stage, if there was one. time_limit and cancelled if they ended the solve.
  Status status = Status::numerical_failure;
  std::string detail;                         ///< one sentence
  std::int64_t scenarios = 0;                 ///< sample size of x; 0: no stage was solved, and x is empty
  std::vector<double> x;                      ///< the plan, in the order of first_stage
  std::vector<std::vector<double>> recourse;  ///< y_s, in the order of the other variables
  double objective = 0.0;                     ///< Σ π_s q(x, y_s; ξ_s)
  Violations violations;                      ///< of the stage's LCQP, user units
  /// Solution of the stage's LCQP, as in assemble_scenarios: z is x, then each y_s. Its status and detail are
  /// those above; iterations, factorizations and times are those of all stages, including recourses.
  Solution solution;
  /// Scenarios that have no plan even alone, ascending: their own LCQPs ended infeasible or
  /// locally_infeasible. Determined if a stage has no solution.
  std::vector<std::int64_t> infeasible;
  std::vector<SampleAverageStage> stages;  ///< without x
};

/// Solves one sample-average stage after the other. The solution is the same to the bit with and without a
/// runner, for any number of threads. `controls` must not contain initial_z, warm_start or sensitivity; its
/// progress receives the rows of each stage's LCQP, with the iterations and factorizations of all stages,
/// without the sides of pairs. `setup`: most_bytes covers everything that the solve holds at once: the
/// numbers of scenarios, a stage's LCQP, its solver, starts, recourses and solutions. A stage that needs more
/// is not built. Errors: invalid_argument of the fields of "base", "first_stage", "own_pairs", …,
/// "settings.growth", …, and "scenario[7].b" for numbers from `sample`; errors of `sample` itself unchanged;
/// resource_exhausted if a stage is too large and there is no solution.
[[nodiscard]] Expected<ScenarioSolution> solve_scenarios(const ScenarioProblem& problem,
                                                         const ScenarioSettings& settings = {},
                                                         const SolveControls& controls = {},
                                                         const SetupControls& setup = {});

/// Checks everything that solve_scenarios requires of its settings and of the problem without its scenarios.
[[nodiscard]] Expected<void> check_scenarios(const ScenarioProblem& problem,
                                             const ScenarioSettings& settings);

/// Checks whether the first stage may fit into memory: its numbers, its LCQP and the minimum that a solver of
/// it needs, judged by sizes alone. Calls `sample` only for scenario 0. Errors: resource_exhausted of the
/// field "settings.initial_sample_size"; those of `sample`.
[[nodiscard]] Expected<void> check_initial_sample(const ScenarioProblem& problem,
                                                  const ScenarioSettings& settings, std::int64_t most_bytes);

/// Returns the LCQP of these scenarios, as a stage solves it: variables [x, y_0, y_1, …]; rows and pairs of x
/// alone, then those of each scenario. Errors: as solve_scenarios.
[[nodiscard]] Expected<OwnedProblem> assemble_scenarios(const ScenarioProblem& problem,
                                                        std::int64_t scenarios);

}  // namespace marble
