// Retrospective approximation: a problem whose functions are expectations, solved by the average over more
// and more samples (RA-SQP; S. Gupta, R. Bollapragada, A. Berahas, "Retrospective Approximation for
// Stochastic Constrained Problems Using Sequential Quadratic Programming").
//
//   level k = 0, 1, …:   the problem of samples 0 … N_k − 1,   N_k = ⌈|S₀| ωᵏ⌉,
//                        from the last level's answer, until a step measures ≤ γ · (the level's first) +
//                        δ/√N_k
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

/// Functions that are averages over samples. They are nested: a level's samples are all of the last level's
/// and further ones, so sample i must be the same whenever it is asked for; marble/composite/counter_random.h
/// has such numbers. Patterns and numbers of rows are those of the first level.
struct SampledProblem {
  /// Its functions average over the samples 0 … N − 1 of the last call of use_samples.
  Problem problem;
  std::function<void(std::int64_t N)> use_samples;  ///< wanted; N ≥ 1, ascending. Before any other function
  /// What sample number `sample` costs at x. Optional: with it every level is judged by samples it has not
  /// seen.
  std::function<double(std::span<const double> x, std::int64_t sample)> sample_cost = {};
};

/// Which measure of a level's steps has to fall.
enum class LevelTest {
  merit,  ///< the decrease of the merit that the subproblem promises, Δq
  step,   ///< max |d_j| / scale_j
};

/// A mean of fresh samples, and half its 95 % interval.
struct Estimate {
  double mean = 0.0;        ///< of the costs
  double half_width = 0.0;  ///< 1.96 · standard deviation / √samples
};

/// What a level came to.
struct Level {
  std::int32_t level = 0;    ///< k, from 0
  std::int64_t samples = 0;  ///< N_k
  /// solved: the level's tolerance is met, or that of the settings. Otherwise why it ended, as Answer has it;
  /// the next level goes on from there, but for time_limit and cancelled.
  Status status = Status::numerical_failure;
  double objective = 0.0;        ///< θ of the level's samples, at x
  double violation = 0.0;        ///< of its rows
  double kkt_residual = 0.0;     ///< max |∇θ + ∇c_Eᵀy − …| of its samples, by its last multipliers
  std::int32_t iterations = 0;   ///< steps that were tried
  std::int32_t ticks = 0;        ///< LCQPs of this level, with that which told its end
  std::int32_t evaluations = 0;  ///< calls of Problem::values, of this level
  std::int32_t linearisations = 0;        ///< calls of Problem::derivatives, of this level
  std::optional<Estimate> estimate = {};  ///< of the cost at x, by samples N_k … N_k + fresh_samples − 1
  std::span<const double> x = {};         ///< where it ended; valid only during the call
};

/// All of it optional.
struct RetrospectiveSettings {
  /// Of every level. iteration_limit holds for each, time_limit_s for all. Iteration::iteration begins again
  /// at each, Iteration::ticks goes on.
  Settings loop = {};
  std::int64_t first_samples = 2;  ///< |S₀| ≥ 1
  double growth = 2.0;             ///< ω > 1; a level has one more sample than the last at least
  std::int32_t levels = 10;        ///< ≥ 1
  std::int64_t largest_samples =
      1'000'000'000;                     ///< ≥ first_samples: the level that would have more is the last
  LevelTest test = LevelTest::merit;     ///< what a level must bring down
  std::optional<double> reduction = {};  ///< γ in (0, 1); absent: 0.1 of the merit, 0.5 of the step
  double tolerance = 0.0;                ///< δ ≥ 0, in the measure of the test
  bool carry_curvature = true;           ///< B of bfgs goes on from level to level; false: it begins again
  std::int64_t fresh_samples = 1000;     ///< ≥ 2, of sample_cost
  std::function<void(const Level&)> level = {};  ///< told after every one
};

/// The last level's answer. In it iterations, ticks, evaluations and factorizations are those of all levels;
/// b_stationary is there only where the last step was zero.
struct RetrospectiveAnswer {
  Answer answer;              ///< of the last level
  std::vector<Level> levels;  ///< without x
};

/// Solves level after level: x, multipliers, B, merit weights, trust region and ticks are carried over. The
/// same bits wherever the ticks are solved. Errors: invalid_argument: fields "use_samples",
/// "settings.first_samples", "settings.growth", "settings.reduction" and such, "sample_cost" where it is not
/// finite, with the sample as index; and those of solve().
[[nodiscard]] Expected<RetrospectiveAnswer> solve_retrospective(const SampledProblem& sampled,
                                                                const OpenTicks& open,
                                                                const RetrospectiveSettings& settings = {});

/// The same with sessions of the client's. Of marble::client.
[[nodiscard]] Expected<RetrospectiveAnswer> solve_retrospective(const SampledProblem& sampled,
                                                                const Client& client,
                                                                const RetrospectiveSettings& settings = {});

}  // namespace marble::nonlinear
