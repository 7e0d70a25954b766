// Provides retrospective approximation: solves a problem whose functions are expectations by averages over
// more and more samples (RA-SQP; S. Gupta, R. Bollapragada, A. Berahas, "Retrospective Approximation for
// Stochastic Constrained Problems Using Sequential Quadratic Programming").
//
//   level k = 0, 1, …:   the problem of samples 0 … N_k − 1,   N_k = ⌈|S₀| ωᵏ⌉,
//                        starts from the last level's solution, ends when a step measures
//                        ≤ γ · (the level's first) + δ/√N_k
//
//   auto plan = marble::nonlinear::solve_retrospective(sampled, marble::nonlinear::open_ticks_in_process);
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "marble/nonlinear.h"

namespace marble::nonlinear {

/// Functions that are averages over samples. Samples are nested: a level uses all samples of the last level
/// and more, so sample i must be the same on every call; marble/composite/counter_random.h provides such
/// numbers. Patterns and numbers of rows are those of the first level.
struct SampledProblem {
  /// The functions average over the samples 0 … N − 1 of the last call of use_samples.
  Problem problem;
  std::function<void(std::int64_t N)> use_samples;  ///< required; N ≥ 1, ascending. Called before the others
  /// Returns the cost of sample number `sample` at x. Optional: with it every level is evaluated on samples
  /// that it has not used.
  std::function<double(std::span<const double> x, std::int64_t sample)> sample_cost = {};
};

/// The measure of a level's steps that must decrease.
enum class LevelTest {
  merit,  ///< the decrease of the merit that the subproblem predicts, Δq
  step,   ///< max |d_j| / scale_j
};

/// A mean over out-of-sample samples, and half its 95 % interval.
struct Estimate {
  double mean = 0.0;        ///< of the costs
  double half_width = 0.0;  ///< 1.96 · standard deviation / √samples
};

/// The result of one level.
struct Level {
  std::int32_t level = 0;    ///< k, from 0
  std::int64_t samples = 0;  ///< N_k
  /// solved: the level's tolerance or that of the settings is met. Otherwise the reason for its end, as
  /// Answer::status; the next level continues from there, except after time_limit and cancelled.
  Status status = Status::numerical_failure;
  double objective = 0.0;     ///< θ of the level's samples at x
  double violation = 0.0;     ///< of its rows
  double kkt_residual = 0.0;  ///< max |∇θ + ∇c_Eᵀy − …| of its samples, with its last multipliers
  std::int32_t iterations = 0;            ///< steps that were tried
  std::int32_t ticks = 0;                 ///< LCQPs of this level, including the one that ended it
  std::int32_t evaluations = 0;           ///< calls of Problem::values in this level
  std::int32_t linearisations = 0;        ///< calls of Problem::derivatives in this level
  std::optional<Estimate> estimate = {};  ///< of the cost at x, on samples N_k … N_k + fresh_samples − 1
  std::span<const double> x = {};         ///< final x; valid only during the call
};

/// All fields are optional.
struct RetrospectiveSettings {
  /// For every level. iteration_limit applies to each level, time_limit_s to all together.
  /// Iteration::iteration restarts at each level, Iteration::ticks continues.
  Settings loop = {};
  std::int64_t first_samples = 2;  ///< |S₀| ≥ 1
  double growth = 2.0;             ///< ω > 1; a level has at least one sample more than the last
  std::int32_t levels = 10;        ///< ≥ 1
  std::int64_t largest_samples =
      1'000'000'000;                     ///< ≥ first_samples: the level that would exceed it is the last
  LevelTest test = LevelTest::merit;     ///< the measure that a level must reduce
  std::optional<double> reduction = {};  ///< γ in (0, 1); absent: 0.1 of the merit, 0.5 of the step
  double tolerance = 0.0;                ///< δ ≥ 0, in the measure of the test
  bool carry_curvature = true;           ///< B of bfgs is kept from level to level; false: it is reset
  std::int64_t fresh_samples = 1000;     ///< ≥ 2, of sample_cost
  std::function<void(const Level&)> level = {};  ///< called after each level
};

/// The last level's result. Its iterations, ticks, evaluations and factorizations are totals over all levels;
/// b_stationary is set only if the last step was zero.
struct RetrospectiveAnswer {
  Answer answer;              ///< of the last level
  std::vector<Level> levels;  ///< without x
};

/// Solves level after level and carries over x, multipliers, B, merit weights, trust region and sessions. The
/// bits do not depend on where the LCQPs are solved. Errors: invalid_argument, with fields "use_samples",
/// "settings.first_samples", "settings.growth", "settings.reduction" and such, "sample_cost" if it is not
/// finite, with the sample as index; and those of solve().
[[nodiscard]] Expected<RetrospectiveAnswer> solve_retrospective(const SampledProblem& sampled,
                                                                const OpenTicks& open,
                                                                const RetrospectiveSettings& settings = {});

/// The same with sessions of the client. Part of marble::client.
[[nodiscard]] Expected<RetrospectiveAnswer> solve_retrospective(const SampledProblem& sampled,
                                                                const Client& client,
                                                                const RetrospectiveSettings& settings = {});

}  // namespace marble::nonlinear
