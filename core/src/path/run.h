// One run of the solver: its clock, its counters, its progress reports and its stop conditions.
#pragma once

#include <algorithm>
#include <chrono>
#include <limits>
#include <optional>

#include "marble/options.h"
#include "marble/solver.h"
#include "model/interrupt.h"

namespace marble {

/// Returns the stop conditions of a solve: its stop token, and its time limit from `begun` on, or from now
/// on.
[[nodiscard]] inline Interrupt interrupt_of(const SolveControls& controls, const Options& options) {
  const auto begun = controls.begun.value_or(Interrupt::now(controls.pause));
  return Interrupt(controls.stop, after(begun, options.time_limit_s), controls.pause);
}

class Run {
 public:
  using Clock = Interrupt::Clock;

  Run(const Options& options, const SolveControls& controls)
      : Run(options, controls, interrupt_of(controls, options)) {}
  /// Uses the interrupt of another run.
  Run(const Options& options, const SolveControls& controls, Interrupt interrupt)
      : options_(options), controls_(controls), start_(interrupt.now()), interrupt_(std::move(interrupt)) {}

  std::int32_t iterations = 0;
  std::int32_t outer_iterations = 0;
  std::int32_t factorizations = 0;
  bool nonconvex = false;  // a factorization showed that Q has negative curvature in a relevant direction
  std::int32_t reported_iteration = -1;  // the last reported iteration
  Times times;
  double bytes_left = std::numeric_limits<double>::infinity();  // for systems beside the solver's

  /// Adds the time of a scope to polishing, or to another part, without times that are counted elsewhere.
  /// Nested scopes count only once.
  class Polishing {
   public:
    explicit Polishing(Run& run, double Times::*into = &Times::polish_s)
        : phase_(run.activity(), Phase::local_search),
          run_(run),
          into_(into),
          outermost_(!run.polishing_),
          begun_(run.now()),
          counted_s_(counted_s()) {
      run.polishing_ = true;
    }
    Polishing(const Polishing&) = delete;
    Polishing& operator=(const Polishing&) = delete;
    ~Polishing() {
      if (!outermost_) return;
      // Concurrent searches may have spent more time on factorizations than the scope lasted.
      const double rest = seconds(run_.now() - begun_) - (counted_s() - counted_s_);
      run_.times.*into_ += std::max(0.0, rest);
      run_.polishing_ = false;
    }

   private:
    // A soft start also takes steps of the path.
    [[nodiscard]] double counted_s() const { return run_.times.factorization_s + run_.times.line_search_s; }

    PhaseScope phase_;
    Run& run_;
    double Times::*into_;
    bool outermost_;
    Clock::time_point begun_;
    double counted_s_;
  };

  /// Iterations of a scope are reported as usual, but do not count against max_iterations: searches have
  /// their own budgets, in factorizations. Nested scopes count only once.
  class Searching {
   public:
    explicit Searching(Run& run) : run_(run), outermost_(!run.searching_), begun_(run.iterations) {
      run.searching_ = true;
    }
    Searching(const Searching&) = delete;
    Searching& operator=(const Searching&) = delete;
    ~Searching() {
      if (!outermost_) return;
      run_.searched_iterations_ += run_.iterations - begun_;
      run_.searching_ = false;
    }

   private:
    Run& run_;
    bool outermost_;
    std::int32_t begun_;
  };

  [[nodiscard]] ProgressSink* sink() const { return silent_ ? nullptr : controls_.progress; }
  [[nodiscard]] ActivityMonitor* activity() const { return silent_ ? nullptr : controls_.activity; }
  /// Adds the objective of a feasible point, user units.
  void add_incumbent(double objective) const {
    if (activity() != nullptr) activity()->add_incumbent(objective);
  }
  void set_done(Phase phase, std::int64_t done, std::int64_t total = 0) const {
    if (activity() != nullptr) activity()->set_done(phase, done, total);
  }
  /// Returns where to record proofs; null if none are requested.
  [[nodiscard]] Proof* proof() const { return controls_.proof; }
  [[nodiscard]] TaskRunner* runner() const { return silent_ ? nullptr : controls_.runner; }
  /// Returns the controls of a solve that is part of this one: its activity is shown, and it ends with this
  /// one.
  [[nodiscard]] SolveControls controls_beside() const {
    return {.stop = controls_.stop,
            .pause = controls_.pause,
            .begun = controls_.begun.value_or(start_),
            .activity = activity()};
  }

  /// Returns a separate run for one search, which counts from here. A silent one reports no progress and has
  /// no helpers.
  [[nodiscard]] Run part(bool silent) const {
    Run result = *this;
    result.silent_ = silent;
    result.begun_iterations_ = iterations;
    result.begun_factorizations_ = factorizations;
    result.times = {};
    return result;
  }
  /// Adds the counters of a part.
  void add_part(const Run& part) {
    iterations += part.iterations - part.begun_iterations_;
    factorizations += part.factorizations - part.begun_factorizations_;
    if (!part.silent_) reported_iteration = part.reported_iteration;
    nonconvex = nonconvex || part.nonconvex;
    times += part.times;
  }
  [[nodiscard]] Clock::time_point now() const { return interrupt_.now(); }
  [[nodiscard]] double elapsed_s() const { return seconds(now() - start_); }

  /// Returns why the run must end now, for reasons other than the iterate.
  [[nodiscard]] std::optional<Status> interrupted() const {
    if (interrupt_.stop_requested()) return Status::cancelled;
    if (!searching_ && iterations - searched_iterations_ >= options_.max_iterations)
      return Status::iteration_limit;
    if (interrupt_.requested()) return Status::time_limit;
    return std::nullopt;
  }
  /// Returns the conditions that also apply in the middle of an iteration.
  [[nodiscard]] const Interrupt& interrupt() const { return interrupt_; }

  /// Adds the time of one call to a part of `times`.
  template <class Part>
  auto timed(double Times::*into, Part&& part) {
    const auto begin = now();
    auto result = part();
    times.*into += seconds(now() - begin);
    return result;
  }

 private:
  [[nodiscard]] static double seconds(Clock::duration duration) {
    return std::chrono::duration<double>(duration).count();
  }

  const Options& options_;
  const SolveControls& controls_;
  Clock::time_point start_;
  Interrupt interrupt_;
  bool silent_ = false;
  bool polishing_ = false, searching_ = false;
  std::int32_t searched_iterations_ = 0;
  std::int32_t begun_iterations_ = 0, begun_factorizations_ = 0;
};

}  // namespace marble
