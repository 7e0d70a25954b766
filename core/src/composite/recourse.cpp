#include "composite/recourse.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>

#include "model/interrupt.h"
#include "model/tuning.h"
#include "path/run_tasks.h"

namespace marble {
namespace {

ProblemUpdate numbers_of(const OwnedProblem& p) {
  return {p.c0, p.g, p.b, p.d, p.l, p.r, p.Q.values, p.A.values, p.C.values, p.L.values, p.R.values};
}

// One batch: one solver for all of its scenarios, set up for the first of them.
class Batch {
 public:
  explicit Batch(const RecourseControls& controls)
      : controls_(controls),
        interrupt_(controls.stop, controls.until, controls.pause),
        options_(controls.options) {}

  // Solves the LCQP of a scenario, from `start` unless it is null.
  Recourse solve(const OwnedProblem& scenario, const Solution* start) {
    if (const auto ended = interrupted()) return {*ended, {}};
    if (!solver_) {
      const auto problem = Problem::create(scenario.view());
      if (!problem) return {};
      auto made = Solver::create(*problem, options_,
                                 {.most_bytes = controls_.most_bytes,
                                  .stop = controls_.stop,
                                  .pause = controls_.pause,
                                  .until = controls_.until});
      if (!made) return {interrupted().value_or(Status::numerical_failure), {}};
      solver_.emplace(*std::move(made));
    } else if (!solver_->update(numbers_of(scenario))) {
      return {};
    }
    options_.time_limit_s =
        std::max(0.0, std::chrono::duration<double>(controls_.until - interrupt_.now()).count());
    options_.time_limit_s = std::min(options_.time_limit_s, most_s_);
    if (!solver_->set_options(options_)) return {};
    auto solution = solver_->solve({.stop = controls_.stop, .warm_start = start, .pause = controls_.pause});
    if (!solution) return {};
    const Status status = solution->status;
    return {status, *std::move(solution)};
  }

 private:
  [[nodiscard]] std::optional<Status> interrupted() const {
    if (!interrupt_.requested()) return std::nullopt;
    return interrupt_.stop_requested() ? Status::cancelled : Status::time_limit;
  }

  const RecourseControls& controls_;
  const Interrupt interrupt_;
  Options options_;
  double most_s_ = Options().time_limit_s;
  std::optional<Solver> solver_;
};

// Calls `solve(batch, s)` for each of `count` scenarios, in batches.
void in_batches(std::size_t count, const RecourseControls& controls,
                const std::function<void(Batch&, std::size_t)>& solve) {
  std::vector<std::function<void()>> tasks;
  std::atomic<bool> out_of_memory = false;
  for (std::size_t first = 0; first < count; first += tuning::scenario_batch) {
    tasks.emplace_back([&, first] {
      try {
        Batch batch(controls);
        for (std::size_t s = first; s < std::min(count, first + tuning::scenario_batch); ++s) solve(batch, s);
      } catch (const std::bad_alloc&) {
        out_of_memory = true;
      }
    });
  }
  run_tasks(controls.runner, tasks);
  if (out_of_memory) throw std::bad_alloc();
}

}  // namespace

std::vector<Recourse> solve_recourse(const Stages& stages, std::span<const double> x,
                                     std::span<const ScenarioNumbers> scenarios,
                                     std::span<const Solution* const> starts,
                                     const RecourseControls& controls) {
  std::vector<Recourse> result(scenarios.size());
  in_batches(scenarios.size(), controls, [&](Batch& batch, std::size_t s) {
    result[s] = batch.solve(stages.recourse(scenarios[s], x), starts.empty() ? nullptr : starts[s]);
  });
  return result;
}

// Uses 1.96 standard deviations of a weighted mean; the variance is unbiased if the weights are equal.
OutOfSample judged(std::span<const ScenarioNumbers> scenarios, std::span<const Recourse> recourse) {
  OutOfSample result;
  result.scenarios = static_cast<std::int64_t>(scenarios.size());
  double unit = 0.0;  // the largest weight if squares of weights overflow or underflow
  for (std::size_t s = 0; s < scenarios.size(); ++s)
    if (recourse[s].found()) unit = std::max(unit, scenarios[s].weight);
  if (std::isnormal(unit * unit * static_cast<double>(scenarios.size()))) unit = 1.0;
  double weight = 0.0, squares = 0.0, sum = 0.0;
  for (std::size_t s = 0; s < scenarios.size(); ++s) {
    result.factorizations += recourse[s].solution.factorizations;
    if (!recourse[s].found()) {
      ++result.infeasible;
      continue;
    }
    const double own = scenarios[s].weight / unit;
    weight += own;
    squares += own * own;
    sum += own * recourse[s].solution.objective;
  }
  const auto found = static_cast<double>(result.scenarios - result.infeasible);
  if (found == 0.0) return result;
  constexpr double kLargest = std::numeric_limits<double>::max();
  result.mean = std::isnan(sum) ? 0.0 : std::clamp(sum / weight, -kLargest, kLargest);
  double variance = 0.0;
  for (std::size_t s = 0; s < scenarios.size(); ++s) {
    if (!recourse[s].found()) continue;
    const double difference = recourse[s].solution.objective - result.mean;
    variance += scenarios[s].weight / unit / weight * difference * difference;
  }
  constexpr double normal_quantile = 1.959963984540054;  // at 0.975: half of a 95 % interval
  if (found > 1.0 && std::isfinite(variance))
    result.half_width = normal_quantile * std::sqrt(variance * found / (found - 1.0) * squares) / weight;
  return result;
}

std::vector<Status> solve_alone(const Stages& stages, std::span<const ScenarioNumbers> scenarios,
                                const RecourseControls& controls) {
  std::vector<Status> result(scenarios.size());
  in_batches(scenarios.size(), controls, [&](Batch& batch, std::size_t s) {
    result[s] = batch.solve(stages.alone(scenarios[s]), nullptr).status;
  });
  return result;
}

}  // namespace marble
