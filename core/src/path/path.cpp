#include "path/path.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "model/printed.h"
#include "model/retraction.h"
#include "model/tuning.h"

namespace marble {

PathEngine::PathEngine(const ScaledProblem& problem, Kkt& kkt, const Options& options)
    : problem_(problem),
      options_(options),
      newton_(problem, kkt),
      sub_(problem),
      schedule_(options),
      regularization_(options),
      filter_(problem),
      x_(problem),
      r_(problem),
      d_(problem),
      best_(problem),
      inner_solution_(problem),
      screen_(problem),
      images_(problem),
      direction_images_(problem),
      reporter_(problem) {}

// Algorithm 1; start() is lines 1–2. Line numbers are those of the paper.
std::optional<Ending> PathEngine::follow(Run& run, double kappa_end) {
  const bool to_its_end = kappa_end <= options_.kappa_min;
  lost_ = suspects_contradiction_ = false;
  while (true) {
    evaluate();  // line 4
    report(run);
    const bool printed = is_printed(options_);
    if (!printed && solved() && solved_afresh()) return Ending{Status::solved, {}, {}};
    remember_best();
    if (const auto reason = run.interrupted()) return give_best(*reason);
    if (schedule_.inner_converged(sub_, residual_norm_)) {                               // lines 20–29
      if (printed && within_tolerances(violations_, options_)) return end_as_printed();  // line 22
      if (schedule_.exhausted(sub_) && stall_.stalled(largest(violations_) + residual_norm_))
        return explain(true);
      if (!to_its_end && sub_.kappa <= kappa_end) return std::nullopt;
      begin_subproblem(run);
    } else if (lost(to_its_end)) {
      lost_ = true;
      if (!retreat()) return explain(false);
      if (!to_its_end) return std::nullopt;
    }
    if (!step(run)) {  // lines 5–19
      if (const auto reason = run.interrupted()) return give_best(*reason);
      return explain(false);
    }
    if (looks_for_contradiction_ && shows_contradiction()) {
      looks_for_contradiction_ = false;
      suspects_contradiction_ = true;
      return std::nullopt;
    }
  }
}

// The violations are those before the last step: a step later is early enough.
bool PathEngine::shows_contradiction() {
  return inner_steps_ >= tuning::short_patience && !within_tolerances(violations_, options_) &&
         screen_.suggests_infeasible(problem_, x_);
}

void PathEngine::start(ConstVectorRef initial_z) {
  schedule_.begin(sub_);
  leaning_ = false;
  regularization_ = Regularization(options_);
  x_.all.setZero();
  x_.z() = initial_z;
  images_.evaluate(problem_, x_);
  for (Eigen::Index i = 0; i < x_.sigma().size(); ++i) {  // the point of the curve nearest to (s, t)
    const double difference = images_.rows.s()[i] - images_.rows.t()[i];
    x_.sigma()[i] = PairCurve::sigma_of(sub_.retraction, difference, sub_.kappa);
  }
  x_.v() = images_.rows.inequality();
  for (Eigen::Index i = 0; i < x_.v().size(); ++i) {
    x_.lambda_w()[i] = -Softplus(x_.v()[i], sub_.kappa).negative;  // (12): r₂ = 0
  }
  images_.evaluate(problem_, x_);
  d_.all.setZero();
  sub_.take_estimates(d_);  // [α, β] ← 0
  filter_.reset();
  stall_ = {};
  has_best_ = false;
  inner_solution_kappa_ = 0.0;
  inner_steps_ = 0;
  step_length_ = 0.0;
}

void PathEngine::resume() {
  x_.all.swap(best_.all);
  images_.evaluate(problem_, x_);
  filter_.reset();
  stall_ = {};
  has_best_ = false;
}

void PathEngine::lean(Run& run, ConstVectorRef initial_z, double rho_end) {
  start(initial_z);
  leaning_ = true;
  x_.lambda_w().setZero();
  images_.evaluate(problem_, x_);
  sub_.kappa = tuning::lean;
  for (sub_.rho = tuning::lean; sub_.rho < rho_end; sub_.rho *= tuning::lean_rho_factor) {
    for (int i = 0; i < tuning::level_steps; ++i) {
      evaluate();
      report(run);
      if (run.interrupted() || residual_norm_ <= tuning::centrality * sub_.kappa) break;
      if (!step(run)) break;
    }
  }
  evaluate();
  report(run);
}

void PathEngine::evaluate() {
  residual(sub_, images_, x_, r_);
  residual_norm_ = max_abs(r_.all);
  violations_ = violations(problem_, images_);
}

// The end depends on violations only. The residual after the inner loop may be larger than that of a solved
// point.
Ending PathEngine::end_as_printed() {
  if (solved_afresh()) return {Status::solved, {}, {}};
  if (!within_tolerances(violations_, options_)) return explain(false);  // they were updated until here
  return {Status::almost_solved, "Algorithm 1 looks at violations alone; " + describe(violations_), {}};
}

bool PathEngine::feasible() const {
  return within_tolerances(violations_, options_) &&
         within_tolerances(scaled_violations(problem_.layout, images_), options_);
}

// The product of multiplier and slack of an inequality is κ by (12), which no violation shows. The paper's
// authors end by the products of the sides too.
bool PathEngine::solved() const {
  const auto products_are_small = [this] {
    return problem_.pairs() == 0 || (images_.rows.s().array() * images_.rows.t().array()).abs().maxCoeff() <=
                                        options_.stationarity_tolerance;
  };
  return residual_norm_ <= options_.stationarity_tolerance && feasible() &&
         (problem_.inequalities() == 0 || sub_.kappa <= options_.stationarity_tolerance) &&
         (options_.path != Path::paper || products_are_small());
}

// Images::advance accumulates rounding errors, most of them after large steps. A point is therefore
// reevaluated before it counts as solved.
bool PathEngine::solved_afresh() {
  images_.evaluate(problem_, x_);
  evaluate();
  return solved();
}

void PathEngine::begin_subproblem(Run& run) {
  inner_solution_.all = x_.all;
  inner_solution_kappa_ = sub_.kappa;
  inner_steps_ = 0;
  schedule_.advance(sub_, x_);
  filter_.reset();
  images_.evaluate(problem_, x_);  // removes the rounding errors that Images::advance has accumulated
  evaluate();
  ++run.outer_iterations;
}

// The fast path lowers κ aggressively; too many steps at one κ show that it was lowered too far.
bool PathEngine::lost(bool last_resort) {
  const int patience = last_resort ? tuning::path_last_resort * tuning::patience : tuning::patience;
  return ++inner_steps_ > patience && options_.path == Path::fast;
}

bool PathEngine::retreat() {
  if (inner_solution_kappa_ == 0.0 || !schedule_.retreat(sub_, inner_solution_kappa_)) return false;
  x_.all = inner_solution_.all;
  sub_.take_estimates(x_);
  images_.evaluate(problem_, x_);
  evaluate();
  inner_steps_ = 0;
  return true;
}

// The interrupted point stays in best_, for resume().
Ending PathEngine::give_best(Status reason) {
  x_.all.swap(best_.all);
  images_.evaluate(problem_, x_);
  violations_ = best_violations_;
  return {reason, "stopped early; " + describe(best_violations_), {}};
}

Ending PathEngine::explain(bool stalled) const {
  return explain_end(problem_, options_, x_, violations_, residual_norm_, stalled);
}

bool PathEngine::step(Run& run) {
  const bool clip = options_.path == Path::fast;
  for (regularization_.begin();;) {
    ++run.factorizations;
    const bool inertia_right = run.timed(&Times::factorization_s, [&] {
      return newton_.factor(sub_, x_, regularization_.current(), clip);  // lines 7–10
    });
    if (!inertia_right && run.interrupted()) return false;
    if (!inertia_right && clip) run.nonconvex = true;  // with q ≥ 0, nothing else can cause it
    if (inertia_right && newton_.direction(sub_, x_, r_, d_, direction_images_)) {  // line 11
      step_length_ = run.timed(&Times::line_search_s, [&] { return search(); });    // line 12
      if (step_length_ > 0.0) break;
    }
    if (!regularization_.raise() || run.interrupted()) return false;  // line 16
  }
  regularization_.accept();
  accept(step_length_);
  ++run.iterations;
  return true;
}

double PathEngine::search() {
  if (!d_.all.allFinite()) return 0.0;
  if (options_.path != Path::fast) return filter_.search(sub_, images_, direction_images_, x_, d_);
  for (double alpha = 1.0; alpha >= tuning::path_least_step; alpha *= 0.5) {
    const double norm = residual_norm(sub_, images_, direction_images_, x_, d_, alpha);
    if (norm <= (1.0 - tuning::path_decrease * alpha) * residual_norm_) return alpha;
  }
  return tuning::path_least_step;
}

void PathEngine::accept(double alpha) {
  const double before = options_.path == Path::fast ? primal_residual() : 0.0;
  images_.advance(alpha, direction_images_, d_.z());
  x_.all += alpha * d_.all;
  if (options_.path != Path::fast || leaning_) return;
  residual(sub_, images_, x_, r_);
  if (primal_residual() <= before) sub_.take_estimates(x_);
}

double PathEngine::primal_residual() const { return std::max(max_abs(r_.y()), max_abs(r_.lambda())); }

void PathEngine::remember_best() {
  const bool feasible = within_tolerances(violations_, options_);
  const bool better = !has_best_ || (feasible ? !within_tolerances(best_violations_, options_) ||
                                                    images_.objective < best_objective_
                                              : largest(violations_) < largest(best_violations_));
  if (!better) return;
  best_.all = x_.all;
  best_violations_ = violations_;
  best_objective_ = images_.objective;
  has_best_ = true;
}

void PathEngine::report(Run& run) {
  reporter_.report(run, x_.z(), images_.objective, violations_,
                   {.kkt_residual = residual_norm_,
                    .kappa = sub_.kappa,
                    .rho = sub_.rho,
                    .step_length = step_length_,
                    .regularization = regularization_.current()});
}

}  // namespace marble
