// Converts an engine's state to progress for a sink: once per iteration, in the user's units.
#pragma once

#include "marble/progress.h"
#include "model/scaling.h"
#include "path/run.h"

namespace marble {

class Reporter {
 public:
  explicit Reporter(const ScaledProblem& problem)
      : problem_(problem), z_(problem.variables()), sides_(2 * problem.pairs()) {}

  /// Completes `progress` with a point (scaled), its objective (scaled) and violations, the run's counters
  /// and its clock, and reports it, unless this iteration was already reported: an engine that resumes begins
  /// at the last row.
  void report(Run& run, ConstVectorRef z, double objective, const Violations& violations, Progress progress) {
    if (run.sink() == nullptr || run.iterations == run.reported_iteration) return;
    run.reported_iteration = run.iterations;
    z_ = z.cwiseProduct(problem_.variable_scale);
    progress.objective = problem_.user_objective(objective);
    progress.violations = violations;
    progress.iteration = run.iterations;
    progress.outer_iteration = run.outer_iterations;
    progress.factorizations = run.factorizations;
    progress.elapsed_s = run.elapsed_s();
    progress.z = {z_.data(), static_cast<std::size_t>(z_.size())};
    if (run.sink()->wants_pairs()) {
      multiply(problem_.rows, z, sides_, problem_.layout.s(0));
      sides_ = (sides_ + problem_.offset.tail(sides_.size()))
                   .cwiseQuotient(problem_.row_scale.tail(sides_.size()));
      const std::span<const double> sides(sides_.data(), static_cast<std::size_t>(sides_.size()));
      progress.s = sides.first(sides.size() / 2);
      progress.t = sides.last(sides.size() / 2);
    }
    run.sink()->report(progress);
  }

 private:
  const ScaledProblem& problem_;
  Vector z_;
  Vector sides_;  // of all pairs: s, then t
};

}  // namespace marble
