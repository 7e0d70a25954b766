#include "branch/exact_branch.h"

#include <algorithm>

#include "model/tuning.h"

namespace marble {

ExactBranch::ExactBranch(BranchPoint& point, SemismoothNewton& newton, QuadraticEngine& interior)
    : point_(point), newton_(newton), interior_(interior) {
  wrong_rows_.reserve(point.set.held.size());
}

bool ExactBranch::solve(Run& run, int budget, Parametric* parametric) {
  const int last = run.factorizations + budget;
  point_.set.clear_others(point_.x.lambda());  // they may belong to another branch
  newton_.center.all = point_.x.all;           // in case the exchanges fail
  if (const auto solved = exchange_rows(run, tuning::exact_exchanges, last, parametric)) return *solved;
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
std::optional<bool> ExactBranch::exchange_rows(Run& run, int rounds, int last, Parametric* parametric) {
  if (parametric != nullptr) parametric->begin_change(point_);
  for (int round = 0; round < rounds; ++round) {
    if (run.factorizations >= last || run.interrupted()) return false;
    if (!factor(run, last)) return false;
    if (!point_.sharpen(tuning::rounding)) return std::nullopt;
    find_wrong_rows();
    if (wrong_rows_.empty()) return point_.error() <= tuning::exactness;
    if (parametric != nullptr) {
      parametric->follow_change(point_);
    } else {
      for (const Index row : wrong_rows_) point_.set.held[row] ^= 1U;
    }
    point_.set.clear_others(point_.x.lambda());
  }
  return std::nullopt;
}

// Where Q is flat on the rows held, rounding of rho hides delta: in a large problem somewhere nearly always.
bool ExactBranch::factor(Run& run, int last) {
  return point_.factor(run, tuning::exact_rho, tuning::exact_delta) ||
         (point_.set.layout.pairs >= tuning::large_pairs && run.factorizations < last && !run.interrupted() &&
          point_.factor(run, tuning::exact_rho, tuning::elastic_delta));
}

void ExactBranch::find_wrong_rows() {
  wrong_rows_.clear();
  const double scale = 1.0 + max_abs(point_.x.all);
  const auto lambda = point_.x.lambda();
  point_.set.for_each_free_row([&](Index row) {
    const double slack = point_.images.rows.all[row];
    if (point_.set.held[row] ? lambda[row] > tuning::exactness * scale : slack < -tuning::exactness)
      wrong_rows_.push_back(row);
  });
}

}  // namespace marble
