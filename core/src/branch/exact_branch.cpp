#include "branch/exact_branch.h"

#include <algorithm>

#include "model/tuning.h"

namespace marble {

ExactBranch::ExactBranch(BranchPoint& point, SemismoothNewton& newton, QuadraticEngine& interior)
    : point_(point), newton_(newton), interior_(interior) {}

bool ExactBranch::solve(Run& run, int budget) {
  const int last = run.factorizations + budget;
  point_.set.clear_others(point_.x.lambda());  // they may belong to another branch
  newton_.center.all = point_.x.all;           // in case the exchanges fail
  if (const auto solved = exchange_rows(run, tuning::exact_exchanges, last)) return *solved;
  const int last_of_newton = std::min(last, run.factorizations + tuning::newton_budget);
  bool rows_known = newton_.converge(run, {tuning::exact_rho, tuning::exact_delta}, last_of_newton);
  if (newton_.lost_descent())
    rows_known = newton_.converge(run, {tuning::exact_rho, tuning::elastic_delta}, last_of_newton);
  if (rows_known) return exchange_rows(run, tuning::exact_exchanges, last).value_or(false);
  return run.factorizations >= last_of_newton && last_of_newton < last && solve_by_interior(run, last);
}

bool ExactBranch::solve_by_interior(Run& run, int last) {
  interior_.start(point_.x.z(), point_.set);
  Run part = run.part(true);
  const bool solved = interior_.find_rows(part, last, [&](int budget) {
    point_.restore(interior_.iterate(), interior_.set());
    point_.set.clear_others(point_.x.lambda());
    return exchange_rows(part, tuning::exact_exchanges, std::min(last, part.factorizations + budget))
        .value_or(false);
  });
  run.add_part(part);
  return solved || take_interior(interior_);
}

// If rows are weakly active and the branch is flat otherwise, neither holding nor releasing all of them
// reproduces the solution of the interior point method. Then that solution is the result.
bool ExactBranch::take_interior(const QuadraticEngine& engine) {
  if (!(engine.kappa() <= tuning::rounding)) return false;
  point_.restore(engine.iterate(), engine.set());
  const double scale = 1.0 + max_abs(point_.x.all);
  return point_.violation() <= tuning::exactness &&
         max_abs(point_.images.stationarity) <= std::min(tuning::near, tuning::exactness * scale);
}

// Returns nothing if the rows are not determined after this many rounds, or if they contradict each other.
std::optional<bool> ExactBranch::exchange_rows(Run& run, int rounds, int last) {
  for (int round = 0; round < rounds; ++round) {
    if (run.factorizations >= last || run.interrupted()) return false;
    if (!point_.factor(run, tuning::exact_rho, tuning::exact_delta)) return false;
    if (!point_.sharpen(tuning::rounding)) return std::nullopt;
    if (exchange()) return point_.error() <= tuning::exactness;
  }
  return std::nullopt;
}

// Releases active rows with a wrong-sign multiplier (λ > 0) and adds violated ones. True if nothing changed.
bool ExactBranch::exchange() {
  bool changed = false;
  const double scale = 1.0 + max_abs(point_.x.all);
  auto lambda = point_.x.lambda();
  point_.set.for_each_free_row([&](Index row) {
    std::uint8_t& held = point_.set.held[row];
    const double slack = point_.images.rows.all[row];
    if (!(held ? lambda[row] > tuning::exactness * scale : slack < -tuning::exactness)) return;
    held ^= 1U;
    if (held == 0) lambda[row] = 0.0;
    changed = true;
  });
  return !changed;
}

}  // namespace marble
