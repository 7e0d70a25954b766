#include "marble/retrospective.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "nonlinear/sqpcc.h"
#include "nonlinear/tuning.h"

namespace marble::nonlinear {
namespace {

constexpr std::int64_t kMostSamples = std::int64_t{1} << 53;  // a double counts no further

Expected<void> valid(const SampledProblem& sampled, const RetrospectiveSettings& s) {
  if (!sampled.use_samples) return unexpected(invalid("use_samples", "must be a function"));
  const auto refuse = [](const char* field, const auto value, const char* bound) {
    return unexpected(invalid(field, std::to_string(value), bound));
  };
  if (s.first_samples < 1) return refuse("settings.first_samples", s.first_samples, "must be >= 1");
  if (!(s.growth > 1.0 && std::isfinite(s.growth)))
    return refuse("settings.growth", s.growth, "must be finite and > 1");
  if (s.levels < 1) return refuse("settings.levels", s.levels, "must be >= 1");
  if (s.largest_samples < s.first_samples || s.largest_samples > kMostSamples)
    return refuse("settings.largest_samples", s.largest_samples, "must be >= first_samples and <= 2^53");
  if (s.reduction && !(*s.reduction > 0.0 && *s.reduction < 1.0))
    return refuse("settings.reduction", *s.reduction, "must be > 0 and < 1");
  if (!(s.tolerance >= 0.0 && std::isfinite(s.tolerance)))
    return refuse("settings.tolerance", s.tolerance, "must be finite and >= 0");
  if (is_reference(s.loop.method)) return unexpected(invalid("settings.loop.method", "must be sqpcc or slp"));
  if (s.fresh_samples < 2) return refuse("settings.fresh_samples", s.fresh_samples, "must be >= 2");
  return check(s.loop);
}

// Uses only products: the same number on every machine.
std::int64_t grown(std::int64_t samples, double wanted, std::int64_t largest) {
  if (wanted >= static_cast<double>(largest)) return largest;
  return std::min(std::max(samples + 1, static_cast<std::int64_t>(std::ceil(wanted))), largest);
}

// Uses Welford's updates: no difference of large sums.
Expected<Estimate> estimate(const SampledProblem& sampled, std::span<const double> x, std::int64_t first,
                            std::int64_t count) {
  double mean = 0.0, squares = 0.0;
  for (std::int64_t i = 0; i < count; ++i) {
    const double cost = sampled.sample_cost(x, first + i);
    if (!std::isfinite(cost))
      return unexpected(invalid("sample_cost", first + i, std::to_string(cost), "must be finite"));
    const double off = cost - mean;
    mean += off / static_cast<double>(i + 1);
    squares += off * (cost - mean);
  }
  const auto n = static_cast<double>(count);
  constexpr double normal_quantile = 1.96;  // at 0.975: half of a 95 % interval
  return Estimate{mean, normal_quantile * std::sqrt(squares / (n - 1.0) / n)};
}

Expected<RetrospectiveAnswer> solve_levels(const SampledProblem& sampled, Functions functions,
                                           const OpenTicks& open, const RetrospectiveSettings& s) {
  Loop loop(sampled.problem, std::move(functions), open, s.loop);
  const double reduction =
      s.reduction.value_or(s.test == LevelTest::merit ? tuning::merit_reduction : tuning::step_reduction);
  RetrospectiveAnswer made;
  std::int32_t iterations = 0, ticks = 0, evaluations = 0, linearisations = 0;
  Level level{.samples = s.first_samples};
  double wanted = static_cast<double>(s.first_samples);
  for (;; ++level.level) {
    sampled.use_samples(level.samples);
    if (!s.carry_curvature && level.level > 0) loop.forget_curvature();
    MARBLE_ASSIGN_OR_RETURN(
        auto answer, loop.run(LevelTolerance{s.test, reduction,
                                             s.tolerance / std::sqrt(static_cast<double>(level.samples))}));
    level.status = answer.status;
    level.objective = answer.objective, level.violation = answer.violation;
    level.kkt_residual = answer.kkt_residual;
    level.iterations = answer.iterations;
    level.ticks = answer.ticks - std::exchange(ticks, answer.ticks);
    level.evaluations = answer.evaluations - std::exchange(evaluations, answer.evaluations);
    level.linearisations = loop.linearisations() - std::exchange(linearisations, loop.linearisations());
    iterations += level.iterations;
    if (sampled.sample_cost) {
      MARBLE_ASSIGN_OR_RETURN(level.estimate, estimate(sampled, answer.x, level.samples, s.fresh_samples));
    }
    made.levels.push_back(level);
    level.x = answer.x;
    if (s.level) s.level(level);
    level.x = {};
    const bool ended = level.status == Status::time_limit || level.status == Status::cancelled;
    if (ended || level.level + 1 == s.levels || level.samples == s.largest_samples) {
      made.answer = std::move(answer);
      made.answer.iterations = iterations;
      return made;
    }
    wanted *= s.growth;
    level.samples = grown(level.samples, wanted, s.largest_samples);
  }
}

}  // namespace

Expected<RetrospectiveAnswer> solve_retrospective(const SampledProblem& sampled, const OpenTicks& open,
                                                  const RetrospectiveSettings& settings) {
  MARBLE_RETURN_IF_ERROR(valid(sampled, settings));
  MARBLE_ASSIGN_OR_RETURN(auto functions, Functions::create(sampled.problem));
  return or_out_of_memory([&] { return solve_levels(sampled, std::move(functions), open, settings); });
}

}  // namespace marble::nonlinear
