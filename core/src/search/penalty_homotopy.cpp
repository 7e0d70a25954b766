#include "search/penalty_homotopy.h"

#include <algorithm>
#include <cmath>

#include "model/tuning.h"
#include "search/without_pairs.h"

namespace marble {
namespace {

SemismoothNewton::Penalty elastic() { return {tuning::homotopy_rho, tuning::elastic_delta}; }

}  // namespace

PenaltyHomotopy::PenaltyHomotopy(const ScaledProblem& problem, Kkt& kkt)
    : problem_(problem),
      relaxed_(without_pairs(problem)),
      point_(relaxed_, kkt, problem),
      newton_(relaxed_, kkt, point_),
      interior_(relaxed_, kkt, problem),
      no_rows_(relaxed_),
      z_(problem.variables()),
      step_(problem.variables()),
      gradient_(problem.variables()),
      rows_(problem.layout.size()),
      rates_(problem.layout.size()) {}

// Without the pairs, the engines need about half of their vectors.
double PenaltyHomotopy::bytes(double entries, double iterate) {
  return entries * (sizeof(double) + 2.0 * sizeof(Index)) +
         0.5 * tuning::memory_iterates * iterate * sizeof(double);
}

bool PenaltyHomotopy::applies(Index pairs) { return pairs >= tuning::homotopy_pairs; }

// Sets the gradient of f + π sᵀt at z, without Qz.
void PenaltyHomotopy::linearize() {
  const RowLayout& layout = problem_.layout;
  multiply(problem_.rows, z_, rows_);
  rows_ += problem_.offset;
  rates_.setZero();
  layout.s_part(rates_) = penalty_ * layout.t_part(rows_);
  layout.t_part(rates_) = penalty_ * layout.s_part(rows_);
  relaxed_.g = problem_.g;
  add_transposed(problem_.rows, rates_, relaxed_.g);
}

// Moves to the minimum of f + π sᵀt on the way to the QP's minimum. Returns the decrease that the
// linearization predicted.
double PenaltyHomotopy::step() {
  const RowLayout& layout = problem_.layout;
  step_ = point_.x.z() - z_;
  multiply(problem_.Q, z_, gradient_);
  gradient_ += relaxed_.g;
  const double slope = step_.dot(gradient_);
  multiply(problem_.Q, step_, gradient_);
  multiply(problem_.rows, step_, rates_);
  const double curvature =
      step_.dot(gradient_) + 2.0 * penalty_ * layout.s_part(rates_).dot(layout.t_part(rates_));
  z_ += (curvature <= 0.0 ? 1.0 : std::clamp(-slope / curvature, 0.0, 1.0)) * step_;
  return -slope;
}

// Returns sᵀt at z, where it was linearized.
double PenaltyHomotopy::products() const {
  return problem_.layout.s_part(rows_).dot(problem_.layout.t_part(rows_));
}

bool PenaltyHomotopy::is_complementary() const {
  for (Index i = 0; i < problem_.pairs(); ++i) {
    const double smaller = std::min(rows_[problem_.layout.s(i)], rows_[problem_.layout.t(i)]);
    if (!(smaller <= tuning::homotopy_complementary)) return false;
  }
  return true;
}

bool PenaltyHomotopy::solve(Run& run, int last) {
  if (newton_.minimize(run, elastic(), std::min(last, run.factorizations + tuning::homotopy_patience)))
    return true;
  return solve_from_inside(run, last) || (!run.interrupted() && newton_.minimize(run, elastic(), last));
}

bool PenaltyHomotopy::solve_from_inside(Run& run, int last) {
  interior_.start(z_, no_rows_);
  while (run.factorizations < last && interior_.step(run)) {
    const bool at_end = interior_.kappa() <= tuning::last_kappa;
    if (!at_end && !interior_.shows_new_rows()) continue;
    const int few = at_end ? tuning::homotopy_patience : tuning::early_budget;
    point_.restore(interior_.iterate(), interior_.set());
    if (newton_.minimize_from_rows(run, elastic(), std::min(last, run.factorizations + few))) return true;
    if (at_end) return false;
  }
  return false;
}

// If the first penalty leaves most of sᵀt, the pairs are not a matter of cost, and the homotopy would be long
// and without success.
bool PenaltyHomotopy::run(Run& run, ConstVectorRef initial_z, int last) {
  relaxed_ = problem_;
  relaxed_.layout = no_rows_.layout;
  newton_.center.all.setZero();
  point_.x.all.setZero();
  z_ = initial_z;
  if (!solve_from_inside(run, std::min(last, run.factorizations + tuning::engine_budget))) return false;
  z_ = point_.x.z();
  penalty_ = tuning::homotopy_first;
  linearize();
  const double before = products();
  for (;; penalty_ *= tuning::homotopy_factor) {
    double falls = 1.0;
    for (int i = 0; i < tuning::level_steps && falls > tuning::near; ++i) {
      linearize();
      if (!solve(run, last)) return false;
      falls = step();
    }
    linearize();
    if (is_complementary()) return true;
    if (penalty_ == tuning::homotopy_first && products() > tuning::progress * before) return false;
    if (penalty_ >= tuning::exact_rho) return false;
  }
}

}  // namespace marble
