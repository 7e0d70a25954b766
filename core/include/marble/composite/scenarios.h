// One plan for many worlds: variables x that are decided once, and per sampled world ξ_s a recourse y_s.
//
//   min  Σ π_s q(x, y_s; ξ_s)   s.t. rows of x alone, once;   rows and pairs of (x, y_s; ξ_s), for every s
//
// The average over N samples is an LCQP that grows with N. It is solved for more and more of them, each level
// from the last one's answer (retrospective approximation; S. Gupta, R. Bollapragada, A. Berahas,
// "Retrospective Approximation for Stochastic Constrained Problems Using Sequential Quadratic Programming").
//
//   marble::ScenarioProblem worlds{.base = problem.view(), .first_stage = plan, .sample = height};
//   auto answer = marble::solve_scenarios(worlds, {.most_scenarios = 64});
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

/// The numbers of one world, in the pattern of the base problem. A part that is empty stays as the base has
/// it.
struct ScenarioNumbers {
  std::optional<double> c0 = {};  ///< constant cost
  std::vector<double> g = {};     ///< n
  std::vector<double> b = {};     ///< n_e
  std::vector<double> d = {};     ///< n_i
  std::vector<double> l = {};     ///< n_c
  std::vector<double> r = {};     ///< n_c
  std::vector<double> Q = {};     ///< one per stored entry; of a full Q the upper ones count
  std::vector<double> A = {};     ///< one per stored entry
  std::vector<double> C = {};     ///< one per stored entry
  std::vector<double> L = {};     ///< one per stored entry
  std::vector<double> R = {};     ///< one per stored entry
  double weight = 1.0;            ///< > 0: π_s is its part of the sum over the level's scenarios

  /// Of its arrays; it must outlive the update.
  [[nodiscard]] ProblemUpdate update() const { return {c0, g, b, d, l, r, Q, A, C, L, R}; }
};

/// What differs by world, and what does not. Borrows the arrays of `base`.
struct ScenarioProblem {
  ProblemView base;                ///< over (x, y) in any order; its objective is q
  std::vector<Index> first_stage;  ///< the variables that are x, ascending, at least one; all others are y
  /// Rows that touch x alone, and that all the same may differ by world: every scenario has its own. Rows
  /// that touch y are every scenario's own anyway; those of x alone stand once, as the base has them.
  std::vector<Index> own_equalities = {};
  std::vector<Index> own_inequalities = {};  ///< ascending, as own_equalities
  std::vector<Index> own_pairs = {};         ///< ascending, as own_equalities
  /// World number i ≥ 0: the same whenever it is asked for. Called by one thread, in ascending order.
  std::function<Expected<ScenarioNumbers>(std::int64_t i)> sample = {};
  std::int64_t scenarios = std::numeric_limits<std::int64_t>::max();  ///< ≥ 1: how many worlds there are
};

/// Why the levels ended.
enum class ScenarioEnd {
  interval,    ///< the cost outside the sample is known to `tolerance`
  samples,     ///< most_scenarios, or all that there are, are in
  not_solved,  ///< the last level has another end than solved: see status
  too_large,   ///< the next level needs more memory than allowed
  time_limit,  ///< the time of the options was up
  cancelled,   ///< by the stop token
};
/// "interval", "samples", "not_solved", "too_large", "time_limit", "cancelled".
[[nodiscard]] const char* to_string(ScenarioEnd end);

/// What the plan of a level costs in worlds that it has not seen: the next ones, each with its best recourse.
struct OutOfSample {
  std::int64_t scenarios = 0;         ///< that were tried
  std::int64_t without_recourse = 0;  ///< of them: no feasible y was found for the plan
  double mean = 0.0;                  ///< of the costs of the others
  /// Half of the 95 % interval: 1.96 · standard deviation / √scenarios; +∞ of fewer than two.
  double half_width = std::numeric_limits<double>::infinity();
  std::int64_t factorizations = 0;  ///< of all of them
  double seconds = 0.0;             ///< by the clock
};

/// What a level came to.
struct ScenarioLevel {
  std::int32_t level = 0;                     ///< from 0
  std::int64_t scenarios = 0;                 ///< N: those of number 0 … N − 1
  Status status = Status::numerical_failure;  ///< of its LCQP
  std::string detail;                         ///< of its LCQP, as Solution::detail
  double objective = 0.0;                     ///< Σ π_s q(x, y_s; ξ_s)
  std::int32_t variables = 0;                 ///< of its LCQP
  std::int32_t pairs = 0;                     ///< of its LCQP
  std::int64_t factorizations = 0;            ///< of its LCQP, all attempts
  double seconds = 0.0;                       ///< set-up and solve, by the clock
  bool warm = false;                          ///< it kept the branch of the level before, lifted
  bool searched = false;                      ///< it was solved cold too, as its start was mended
  std::int64_t memory_bytes = 0;  ///< of its numbers, its LCQP, its solver and answers, by their estimates
  std::optional<OutOfSample> fresh = {};  ///< absent where no worlds are left or none are asked for
  std::span<const double> x = {};         ///< its plan; valid only during the call
};

/// All of it optional.
struct ScenarioSettings {
  /// Of every level, but for time_limit_s, which holds for all of them, and local_search_budget, of which
  /// levels after the first have at most 50. A level whose start had to be mended is solved cold too before
  /// the next one; the last level only where `starts` is above 1.
  Options options = {};
  std::int64_t first_scenarios = 1;  ///< N₀ ≥ 1
  double growth = 2.0;               ///< ω > 1: N_k = ⌈N₀ ωᵏ⌉, one more than the last at least
  std::int64_t most_scenarios = 64;  ///< ≥ first_scenarios: the level that would have more has these
  double tolerance = 0.0;            ///< ≥ 0: ends when half_width ≤ tolerance · |mean|; 0: never
  std::int64_t least_scenarios =
      8;  ///< ≥ 1: not before N is as large, for few worlds may agree on a poor plan
  double without_recourse = 0.05;  ///< in [0, 1]: not while a larger share of the fresh worlds has none
  /// ≥ 0, of a level: at least these; those that the next level adds are tried anyway. 0: no level after the
  /// last is thought of, and the last one's plan is not tried.
  std::int64_t fresh_scenarios = 16;
  std::function<void(const ScenarioLevel&)> level = {};  ///< told after every one
};

/// The newest plan that a level has proved good.
struct ScenarioAnswer {
  ScenarioEnd end = ScenarioEnd::not_solved;  ///< why it ended
  /// Of the last level: solved where the answer is of it. Otherwise what it ended with, while x is of the
  /// level before, if there was one. time_limit and cancelled where that is how it ended.
  Status status = Status::numerical_failure;
  std::string detail;                         ///< one sentence
  std::int64_t scenarios = 0;                 ///< that x was made for; 0: no level was solved, and x is empty
  std::vector<double> x;                      ///< the plan, in the order of first_stage
  std::vector<std::vector<double>> recourse;  ///< y_s, in the order of the other variables
  double objective = 0.0;                     ///< Σ π_s q(x, y_s; ξ_s)
  Violations violations;                      ///< of the level's LCQP, user units
  /// Of the level's LCQP, as assemble_scenarios has it: z is x, then each y_s. Its status and detail are the
  /// answer's; iterations, factorizations and times are of all levels, recourses too.
  Solution solution;
  /// Worlds that have no plan even by themselves, ascending: their own LCQPs ended infeasible or
  /// locally_infeasible. Looked for where a level has no solution.
  std::vector<std::int64_t> infeasible;
  std::vector<ScenarioLevel> levels;  ///< without x
};

/// Solves level after level. The answer is the same to the bit with a runner and without one, on any number
/// of threads. `controls` may not have initial_z, warm_start or sensitivity; its progress is told of each
/// level's LCQP, by iterations and factorizations of all levels, without the sides of pairs. `setup`:
/// most_bytes holds for all that the solve keeps at once: the numbers of scenarios, a level's LCQP, its
/// solver, starts, recourses and answers. A level that needs more is not built. Errors: invalid_argument:
/// fields of "base", "first_stage", "own_pairs" and such, "settings.growth" and such, "scenario[7].b" of what
/// `sample` gave; its own errors as they are; resource_exhausted where a level is too large and there is no
/// answer.
[[nodiscard]] Expected<ScenarioAnswer> solve_scenarios(const ScenarioProblem& problem,
                                                       const ScenarioSettings& settings = {},
                                                       const SolveControls& controls = {},
                                                       const SetupControls& setup = {});

/// All that solve_scenarios asks of its settings and of the problem without its worlds.
[[nodiscard]] Expected<void> check_scenarios(const ScenarioProblem& problem,
                                             const ScenarioSettings& settings);

/// Whether the first level may fit into memory: its numbers, its LCQP and the least that a solver of it
/// needs, by sizes alone. Asks `sample` for scenario 0 only. Errors: resource_exhausted of the field
/// "settings.first_scenarios"; those of `sample`.
[[nodiscard]] Expected<void> check_first_level(const ScenarioProblem& problem,
                                               const ScenarioSettings& settings, std::int64_t most_bytes);

/// The LCQP of these worlds, as a level has it: variables [x, y_0, y_1, …], rows and pairs those of x alone,
/// then those of each world. Errors: as solve_scenarios.
[[nodiscard]] Expected<OwnedProblem> assemble_scenarios(const ScenarioProblem& problem,
                                                        std::int64_t scenarios);

}  // namespace marble
