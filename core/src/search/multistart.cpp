#include "search/multistart.h"

#include <algorithm>
#include <cmath>

#include "model/tuning.h"
#include "path/noise.h"
#include "search/distance.h"

namespace marble {

Multistart::Multistart(const ScaledProblem& problem, Kkt& kkt, BranchPoint& point, Incumbent& incumbent)
    : problem_(problem),
      incumbent_(incumbent),
      nearest_(distance_problem(problem)),
      descent_(problem, kkt, point),
      x_(problem),
      images_(problem),
      set_(problem) {}

bool Multistart::prepare(Run& run) {
  if (nearest_kkt_ != nullptr) return true;
  nearest_kkt_ = make_system(nearest_, run);
  if (nearest_kkt_ == nullptr) return false;
  nearest_kkt_->attend(run.interrupt());
  nearest_engines_ = std::make_unique<BranchEngines>(nearest_, *nearest_kkt_);
  return true;
}

// Moves from the feasible point nearest to `target`, on this branch or on the one nearest to `target`, to a
// local minimum. Returns true if it is lower than the start's best so far, which it replaces.
bool Multistart::minimize(Run& run, ConstVectorRef target, const WorkingSet* branch, int last) {
  nearest_.g = -target;
  BranchPoint& point = nearest_engines_->point;
  point.set = WorkingSet(problem_);
  point.start_from_point(target);
  if (branch != nullptr) point.restore(Iterate(point.x), *branch);
  if (!nearest_engines_->exact.solve(run, std::min(tuning::engine_budget, last - run.factorizations)))
    return false;
  Iterate x(problem_);
  x.all.setZero();
  x.z() = point.x.z();
  if (descent_.run(run, x, point.set, Vector(), last - run.factorizations) != Descent::End::minimum)
    return false;
  const double objective = descent_.images().objective;
  if (found_ && objective >= images_.objective - tuning::rounding * (1.0 + std::abs(objective))) return false;
  found_ = true;
  x_.all = descent_.x().all;
  images_ = descent_.images();
  set_ = descent_.set();
  return true;
}

// True if an earlier start ended in the same minimum, by its objective.
bool Multistart::is_searched() const {
  const double objective = images_.objective;
  return std::ranges::any_of(searched_, [objective](double other) {
    return std::abs(objective - other) <= tuning::exactness * (1.0 + std::abs(other));
  });
}

// Switches one pair after the other, until none of them gives a lower minimum.
void Multistart::search_neighbours(Run& run, int last) {
  const Index pairs = problem_.pairs();
  Index pair = 0;
  for (Index useless = 0; useless < pairs; ++useless) {
    if (run.factorizations >= last || run.interrupted()) return;
    WorkingSet branch = set_;
    branch.switch_pair(pair);
    if (minimize(run, Vector(x_.z()), &branch, last)) {
      if (is_searched()) return;
      useless = -1;
    }
    pair = (pair + 1) % pairs;
  }
  searched_.push_back(images_.objective);
}

bool Multistart::next(Run& run, int last) {
  const Run::Searching searching(run);
  const Run::Polishing polishing(run);
  Run part = run.part(true);
  const bool better = start(part, last);
  run.add_part(part);
  return better;
}

bool Multistart::start(Run& run, int last) {
  if (!incumbent_.exists() || !prepare(run)) return false;
  const ExactSolution& best = incumbent_.best();
  const double before = best.objective;
  const std::uint64_t number = number_++;
  found_ = number == 0;
  if (found_) {
    x_.all = best.x.all;
    images_.evaluate(problem_, x_);
    set_ = best.set;
  } else {
    const double spread = 1.0 + max_abs(best.x.z());
    Vector target = best.x.z();
    for (Index j = 0; j < target.size(); ++j)
      target[j] += spread * signed_noise(number, static_cast<std::uint64_t>(j));
    if (!minimize(run, target, nullptr, last) || is_searched()) return false;
  }
  search_neighbours(run, last);
  incumbent_.offer(x_, images_, set_, "start elsewhere, descent");
  return incumbent_.best().objective < before;
}

}  // namespace marble
