// Turns an engine's state into the progress a sink is told: once an iteration, in the user's units.
#pragma once

#include "marble/progress.h"
#include "run.h"
#include "scaling.h"

namespace marble {

class Reporter {
 public:
  explicit Reporter(const ScaledProblem& problem)
      : problem_(problem), z_(problem.variables()), s_(problem.pairs()), t_(problem.pairs()) {}

  /// Adds the run's counters, its clock, z and, if wanted, s and t to `progress` and tells it, unless this
  /// iteration was told already: an engine that goes on begins where the last row was.
  void tell(Run& run, ConstVectorRef z, Progress progress) {
    if (run.sink() == nullptr || run.iterations == run.told_iteration) return;
    run.told_iteration = run.iterations;
    z_ = z.cwiseProduct(problem_.variable_scale);
    progress.iteration = run.iterations;
    progress.outer_iteration = run.outer_iterations;
    progress.factorizations = run.factorizations;
    progress.elapsed_s = run.elapsed_s();
    progress.z = {z_.data(), static_cast<std::size_t>(z_.size())};
    if (run.sink()->wants_pairs()) {
      progress.s = side(problem_.L, problem_.l, problem_.left_scale, z, s_);
      progress.t = side(problem_.R, problem_.r, problem_.right_scale, z, t_);
    }
    run.sink()->report(progress);
  }

 private:
  [[nodiscard]] static std::span<const double> side(const RowMatrix& matrix, const Vector& offset,
                                                    const Vector& scale, ConstVectorRef z, Vector& out) {
    multiply(matrix, z, out);
    out = (out + offset).cwiseQuotient(scale);
    return {out.data(), static_cast<std::size_t>(out.size())};
  }

  const ScaledProblem& problem_;
  Vector z_, s_, t_;
};

}  // namespace marble
