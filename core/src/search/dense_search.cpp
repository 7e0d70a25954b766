#include "search/dense_search.h"

#include <algorithm>
#include <cmath>

#include "model/tuning.h"

namespace marble {

DenseSearch::DenseSearch(const ScaledProblem& problem, Incumbent& incumbent)
    : problem_(problem),
      incumbent_(incumbent),
      rows_(problem),
      engine_(problem),
      x_(problem),
      images_(problem) {}

bool DenseSearch::fits(const ScaledProblem& problem) {
  return problem.variables() <= tuning::dense_variables &&
         problem.equalities() + problem.layout.size() <= tuning::dense_rows;
}

// Factorizes Q itself if it is positive definite, otherwise Q with a proximal term.
bool DenseSearch::factor(Run& run) {
  if (factored_) return true;
  ++run.factorizations;
  for (const double delta : {0.0, tuning::tree_delta}) {
    delta_ = delta;
    factored_ = run.timed(&Times::factorization_s, [&] { return engine_.factor(delta); });
    if (factored_) break;
  }
  return factored_;
}

// Takes proximal steps until the solution on the rows that they hold is the optimum.
DenseSearch::Outcome DenseSearch::minimize(Run& run, const std::vector<Kind>& kinds) {
  Vector center = Vector::Zero(problem_.variables());
  for (int pass = 0; pass < tuning::tree_passes; ++pass) {
    ++run.factorizations;
    const DenseActiveSet::End end = engine_.solve(kinds, center, run.interrupt());
    if (end == DenseActiveSet::End::stopped) return Outcome::failed;
    if (end == DenseActiveSet::End::infeasible) return Outcome::infeasible;
    StationaryPoint point{engine_.z(), engine_.multipliers()};
    const bool refined = refine(problem_, engine_.held(), point);
    if (refined && is_optimal(kinds, point)) {
      x_.all.setZero();
      x_.z() = point.z;
      for (std::size_t i = 0; i < engine_.held().size(); ++i) {
        const Index row = engine_.held()[i];
        const double multiplier = point.multipliers[static_cast<Eigen::Index>(i)];
        if (rows_.is_equality(row)) {
          x_.y()[row] = multiplier;
        } else {
          x_.lambda()[row - rows_.first_row()] = multiplier;
        }
      }
      images_.evaluate(problem_, x_);
      return Outcome::optimal;
    }
    if (delta_ == 0.0 || !(max_abs(engine_.z()) <= tuning::runaway)) return Outcome::failed;
    center = engine_.z();
  }
  return Outcome::failed;
}

// Checks the signs of the multipliers to tuning::rounding and the rows that are not held to
// tuning::exactness: a row within e of another turns a violation into an error of z that is 1/e times as
// large.
bool DenseSearch::is_optimal(const std::vector<Kind>& kinds, const StationaryPoint& point) const {
  const double wrong = tuning::rounding * (1.0 + max_abs(point.multipliers));
  std::vector<std::uint8_t> held(static_cast<std::size_t>(rows_.size()));
  for (std::size_t i = 0; i < engine_.held().size(); ++i) {
    const auto row = static_cast<std::size_t>(engine_.held()[i]);
    held[row] = 1;
    if (kinds[row] == Kind::inequality && point.multipliers[static_cast<Eigen::Index>(i)] > wrong)
      return false;
  }
  for (Index row = 0; row < rows_.size(); ++row) {
    const Kind kind = kinds[static_cast<std::size_t>(row)];
    if (kind == Kind::ignored || held[static_cast<std::size_t>(row)] != 0) continue;
    const auto [value, size] = rows_.value(row, point.z);
    const double violation = kind == Kind::equality ? std::abs(value) : -value;
    if (!(violation <= tuning::exactness * (1.0 + size))) return false;
  }
  return true;
}

std::vector<DenseSearch::Kind> DenseSearch::kinds_of(const WorkingSet& set) const {
  std::vector<Kind> kinds(static_cast<std::size_t>(rows_.size()), Kind::inequality);
  std::fill_n(kinds.begin(), problem_.equalities(), Kind::equality);
  for (Index pair = 0; pair < problem_.pairs(); ++pair)
    kinds[static_cast<std::size_t>(rows_.first_row() + set.fixed_row(pair))] = Kind::equality;
  return kinds;
}

void DenseSearch::offer(const WorkingSet& branch) {
  WorkingSet set = branch;
  std::fill(set.held.begin(), set.held.end(), std::uint8_t{0});
  for (Index pair = 0; pair < problem_.pairs(); ++pair) set.held[set.fixed_row(pair)] = 1;
  for (const Index row : engine_.held())
    if (!rows_.is_equality(row)) set.held[row - rows_.first_row()] = 1;
  if (problem_.pairs() == 0 || incumbent_.doubles_hold(x_.z()))
    incumbent_.offer(x_, images_, set, "dense active set");
}

void DenseSearch::solve_branch(Run& run, const WorkingSet& set) {
  if (factor(run) && minimize(run, kinds_of(set)) == Outcome::optimal) offer(set);
}

// Returns the pair without a fixed side whose smaller side is largest; −1 if all pairs are complementary.
Index DenseSearch::most_violated_pair(const std::vector<Kind>& kinds) const {
  Index result = -1;
  double worst = tuning::exactness;
  for (Index pair = 0; pair < problem_.pairs(); ++pair) {
    const auto is_fixed = [&](Index row) {
      return kinds[static_cast<std::size_t>(rows_.first_row() + row)] == Kind::equality;
    };
    if (is_fixed(problem_.layout.s(pair)) || is_fixed(problem_.layout.t(pair))) continue;
    const double smaller = std::min(images_.rows.s()[pair], images_.rows.t()[pair]);
    if (smaller <= worst) continue;
    worst = smaller;
    result = pair;
  }
  return result;
}

// Searches depth first. Of the pair that is farthest from complementary, the smaller side comes first.
void DenseSearch::search(Run& run) {
  if (!factor(run)) return;
  std::vector<Kind> root(static_cast<std::size_t>(rows_.size()), Kind::inequality);
  std::fill_n(root.begin(), problem_.equalities(), Kind::equality);
  std::vector<std::vector<Kind>> open{std::move(root)};
  for (int node = 0; node < tuning::dense_nodes && !open.empty() && !run.interrupted(); ++node) {
    const std::vector<Kind> kinds = std::move(open.back());
    open.pop_back();
    if (minimize(run, kinds) != Outcome::optimal) continue;
    const double margin = tuning::exactness * (1.0 + std::abs(images_.objective));
    if (incumbent_.exists() && images_.objective >= incumbent_.best().objective - margin) continue;
    const Index pair = most_violated_pair(kinds);
    if (pair >= 0) {
      const Index s = problem_.layout.s(pair), t = problem_.layout.t(pair);
      const bool s_first = images_.rows.all[s] < images_.rows.all[t];
      for (const Index row : {s_first ? t : s, s_first ? s : t}) {
        open.push_back(kinds);
        open.back()[static_cast<std::size_t>(rows_.first_row() + row)] = Kind::equality;
      }
      continue;
    }
    WorkingSet set(problem_);
    for (Index i = 0; i < problem_.pairs(); ++i) {
      const auto kind = [&](Index row) { return kinds[static_cast<std::size_t>(rows_.first_row() + row)]; };
      const Index s = problem_.layout.s(i), t = problem_.layout.t(i);
      const bool t_fixed = kind(t) == Kind::equality;
      const bool s_fixed = kind(s) == Kind::equality || images_.rows.all[s] < images_.rows.all[t];
      set.fix(i, s_fixed && !t_fixed, false);
    }
    if (minimize(run, kinds_of(set)) == Outcome::optimal) offer(set);
  }
}

}  // namespace marble
