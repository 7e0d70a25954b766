#include "solver/optimality.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "global/tangent_cone.h"
#include "model/tuning.h"
#include "proof/descent.h"
#include "proof/stationarity.h"

namespace marble {

Optimality::Optimality(const ScaledProblem& problem, Kkt& kkt, const Options& options, BranchPoint& point,
                       Incumbent& incumbent)
    : problem_(problem),
      kkt_(kkt),
      options_(options),
      point_(point),
      incumbent_(incumbent),
      convexity_(problem, kkt),
      base_(problem),
      branch_(problem),
      images_(problem) {}

Optimality::Verdict Optimality::judge(Run& run, int last_factorization) {
  Verdict verdict;
  for (int escapes = 0;; ++escapes) {
    ray_.reset();
    verdict.b_stationary = decide_b_stationarity(run, last_factorization);
    if (ray_) {
      verdict.unbounded = std::exchange(ray_, {});
      return verdict;
    }
    const CriticalCurvature curvature = decide_second_order(run);
    verdict.second_order = curvature.kind;
    if (curvature.kind != SecondOrder::saddle || escapes == tuning::escapes || run.interrupted() ||
        options_.max_local_search_factorizations == 0)
      return verdict;
    const double before = incumbent_.best().objective;
    verdict.unbounded = descend(run, incumbent_.best().x, curvature.set, curvature.direction).unbounded;
    if (verdict.unbounded || incumbent_.best().objective >= before) return verdict;
  }
}

Optimality::Descended Optimality::descend(Run& run, const Iterate& x, const WorkingSet& set,
                                          ConstVectorRef first) {
  Descent descent(problem_, kkt_, point_);
  const Descent::End end = descent.run(run, x, set, first, options_.max_local_search_factorizations);
  run.nonconvex = run.nonconvex || descent.began_at_saddle();
  Descended descended{descent.began_at_saddle(), {}};
  if (end == Descent::End::unbounded)
    descended.unbounded = prove_unbounded(problem_, options_, descent.x().z(), descent.direction(), run);
  if (end == Descent::End::minimum)
    incumbent_.offer(descent.x(), descent.images(), descent.set(), "descent along negative curvature");
  return descended;
}

// Strongly stationary points are B-stationary. For other points with few biactive pairs, each branch is
// solved.
std::optional<bool> Optimality::decide_b_stationarity(Run& run, int last_factorization) {
  const auto is_strong = [this] {
    images_.evaluate(problem_, incumbent_.best().x);
    return classify(images_, incumbent_.best().x) == Stationarity::strong;
  };
  if (is_strong()) return true;
  const std::vector<Index> biactive = biactive_pairs(images_);
  if (biactive.size() > tuning::biactive_pairs_tried || options_.max_local_search_factorizations == 0)
    return std::nullopt;
  bool all = false;
  for (int better = 0; better < tuning::escapes && !all; ++better) {
    const double before = incumbent_.best().objective;
    all = solves_its_branches(run, biactive, last_factorization);
    if (ray_) return std::nullopt;
    if (incumbent_.best().objective >= before || run.interrupted()) break;
  }
  const bool strong = is_strong();  // the incumbent may have changed
  if (all || strong) return true;
  return std::nullopt;
}

// True if no branch that meets in the point has a better solution; otherwise moves to it, or finds that the
// branch is unbounded.
bool Optimality::solves_its_branches(Run& run, std::span<const Index> biactive, int last_factorization) {
  base_ = incumbent_.best().set;
  const double objective = incumbent_.best().objective;
  bool decided = true;
  for (unsigned branch = 1; branch < 1U << biactive.size(); ++branch) {
    branch_ = base_;
    for (std::size_t k = 0; k < biactive.size(); ++k) {
      if ((branch >> k & 1U) != 0) branch_.switch_pair(biactive[k]);
    }
    const int budget = std::min(tuning::engine_budget, last_factorization - run.factorizations);
    if (budget <= 0) return false;
    point_.restore(incumbent_.best().x, branch_);
    const Incumbent::Outcome outcome = incumbent_.solve_branch(run, "neighbouring branch", budget);
    const Iterate& x = incumbent_.best().x;
    if (outcome == Incumbent::Outcome::not_exact && run.factorizations < last_factorization)
      ray_ = prove_branch_unbounded(problem_, options_, branch_, run);
    if (ray_) return false;
    if (incumbent_.best().objective < objective - tuning::exactness * (1.0 + std::abs(objective)))
      return false;
    // If Q is not convex, the solution of another branch may be a stationary point elsewhere.
    const double moved = max_abs(x.z() - incumbent_.other().x.z());
    const bool here = moved <= tuning::near * (1.0 + max_abs(x.z()));
    decided = decided && outcome != Incumbent::Outcome::not_exact && (here || convexity_.decide(run));
  }
  return decided;
}

std::optional<bool> Optimality::search_tangent_cone(Run& run) {
  images_.evaluate(problem_, incumbent_.best().x);
  const std::vector<Index> biactive = biactive_pairs(images_);
  if (!TangentCone::applies(images_, biactive)) return std::nullopt;
  TangentCone cone(problem_, images_, biactive);
  const TangentCone::End end = cone.search(run, options_.max_local_search_factorizations);
  if (end == TangentCone::End::no_descent) return true;
  if (end == TangentCone::End::undecided) return std::nullopt;
  point_.restore(incumbent_.best().x, cone.branch(incumbent_.best().set));
  if (incumbent_.solve_branch(run, "tangent cone", tuning::engine_budget) != Incumbent::Outcome::kept)
    return std::nullopt;
  return false;
}

// Takes a factorization only if rows of the exact solution's working set have no multiplier and Q is not
// known to be convex: one of Q itself, once for all solves with it, and one with the active rows.
CriticalCurvature Optimality::decide_second_order(Run& run) {
  const Iterate& x = incumbent_.best().x;
  const WorkingSet& set = incumbent_.best().set;
  CriticalCurvature curvature{SecondOrder::minimum, {}, set};
  if (!convexity_.known() && has_weakly_active_rows(problem_, x, set) && !convexity_.decide(run))
    curvature = critical_curvature(problem_, kkt_, x, set, run);
  // If the branch has wrong-sign multipliers, its critical cone differs from those of the other branches.
  if (curvature.kind == SecondOrder::minimum && classify(images_, x) != Stationarity::strong &&
      !convexity_.decide(run))
    curvature.kind = SecondOrder::necessary;
  return curvature;
}

}  // namespace marble
