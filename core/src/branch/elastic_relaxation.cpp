#include "branch/elastic_relaxation.h"

#include <algorithm>
#include <cmath>

#include "model/tuning.h"

namespace marble {

ElasticRelaxation::ElasticRelaxation(const ScaledProblem& problem, BranchPoint& point,
                                     SemismoothNewton& newton, QuadraticEngine& interior)
    : problem_(problem),
      point_(point),
      newton_(newton),
      interior_(interior),
      anchor_(Vector::Zero(problem.variables())) {}

bool ElasticRelaxation::solve_by_interior(Run& run, const SemismoothNewton::Penalty& penalty, int last) {
  interior_.start_elastic(point_.x.z(), point_.set, penalty.rho, penalty.delta, anchor_);
  Run part = run.part(true);  // the relaxed problem has no meaning for the caller's progress reports
  const bool solved = interior_.find_rows(part, last, [&](int budget) {
    point_.restore(interior_.iterate(), interior_.set());
    return newton_.minimize_from_rows(part, penalty, std::min(last, part.factorizations + budget));
  });
  run.add_part(part);
  return solved;
}

bool ElasticRelaxation::solve(Run& run, double rho, Rows rows, int budget) {
  newton_.center.all.setZero();
  newton_.center.z() = anchor_;
  const int last = run.factorizations + budget;
  const double delta = rho >= tuning::exact_rho
                           ? tuning::exact_delta
                           : tuning::elastic_delta;  // so that the exact solve's factor can be reused
  const int last_of_newton = std::min(last, run.factorizations + tuning::newton_budget);
  bool solved = rows == Rows::held ? newton_.minimize_from_rows(run, {rho, delta}, last_of_newton)
                                   : newton_.minimize(run, {rho, delta}, last_of_newton);
  if (!solved && run.factorizations >= last_of_newton && last_of_newton < last)
    solved = solve_by_interior(run, {rho, delta}, last);
  if (!solved) return false;
  if (!point_.is_factored(rho, delta) && !point_.factor(run, rho, delta)) return false;
  const Iterate& x = point_.x;
  Images& images = point_.images;
  const double violation_cost = x.y().squaredNorm() + x.lambda_w().squaredNorm() +
                                x.lambda_L().squaredNorm() + x.lambda_R().squaredNorm();
  images.objective = x.z().dot(0.5 * images.gradient + problem_.g);
  objective_ = images.objective + 0.5 * delta * (x.z() - anchor_).squaredNorm() + 0.5 / rho * violation_cost;
  return std::isfinite(objective_);
}

}  // namespace marble
