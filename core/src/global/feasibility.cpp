#include "global/feasibility.h"

#include <algorithm>
#include <utility>

#include "global/lemke.h"
#include "model/text_of.h"
#include "model/tuning.h"
#include "path/termination.h"
#include "search/branch_search.h"
#include "search/distance.h"

namespace marble {

Feasibility::Feasibility(const ScaledProblem& problem, const Options& options, BranchPoint& point,
                         Incumbent& incumbent)
    : problem_(problem),
      options_(options),
      point_(point),
      incumbent_(incumbent),
      tree_(problem),
      sets_(problem) {}

// Whether the branch has an exact solution, or z is feasible on it. Where exchanges of rows do not find that
// solution though there is a feasible point, the interior point method shows its rows, if Q is convex there.
bool Feasibility::take(Run& run, ConstVectorRef z, const WorkingSet& branch, const char* origin) {
  Iterate x(problem_);
  x.z() = z;
  point_.restore(x, branch);
  if (incumbent_.solve_branch(run, origin, tuning::engine_budget) == Incumbent::Outcome::kept) return true;
  point_.restore(x, branch);
  if (!within_tolerances(violations(problem_, point_.images), options_)) return false;
  QuadraticEngine engine(problem_, point_.kkt());
  engine.start(z, branch);
  if (!incumbent_.solve_branch(run, engine)) point_.restore(x, branch);
  return true;
}

bool Feasibility::pivot(Run& run, ConstVectorRef z, int first, int end, int last_factorization) {
  Lemke<double> lemke(problem_);
  if (!lemke.applies()) return false;
  WorkingSet branch(problem_);
  for (int way = first; way < end; ++way) {
    if (run.interrupted() || run.factorizations >= last_factorization) return false;
    if (lemke.run(run, way, z, branch) && take(run, z, branch, "Lemke's method")) return true;
  }
  return false;
}

// Where M is so ill-conditioned that rounding hides the branch, or its solution from engines that factorize.
bool Feasibility::pivot_carefully(Run& run, ConstVectorRef z, int last_factorization) {
  constexpr const char* kOrigin = "Lemke's method in twice the precision";
  Lemke<DoubleDouble> lemke(problem_);
  if (!lemke.applies()) return false;
  WorkingSet branch(problem_);
  Iterate x(problem_);
  Images images(problem_);
  for (int way = 0; way < tuning::lemke_ways; ++way) {
    if (run.interrupted() || run.factorizations >= last_factorization) return false;
    if (!lemke.run(run, way, z, branch) || !lemke.solve_branch(branch, z, x)) continue;
    if (!incumbent_.doubles_hold(x.z())) continue;
    images.evaluate(problem_, x);
    if (max_abs(images.stationarity) > tuning::exactness * (1.0 + max_abs(x.lambda()))) {
      if (take(run, x.z(), branch, kOrigin)) return true;
    } else {
      incumbent_.offer(x, images, branch, kOrigin);
      if (incumbent_.exists()) return true;
    }
  }
  return false;
}

bool Feasibility::solve_calm(Run& run, ConstVectorRef z, bool user_units) {
  ScaledProblem calm = distance_problem(problem_);
  const Vector scale = user_units ? problem_.variable_scale : Vector::Ones(problem_.variables());
  if (user_units) calm = in_user_units(std::move(calm));
  const Vector start = z.cwiseProduct(scale);
  const std::unique_ptr<Kkt> kkt = make_system(calm, run);
  if (kkt == nullptr) return false;
  kkt->attend(run.interrupt());
  PathEngine path(calm, *kkt, options_);
  BranchEngines branch(calm, *kkt);
  Incumbent found(calm, options_, branch.exact);
  BranchSearch search(calm, *kkt, options_, path, branch, found);
  Run part = run.part(true);
  path.start(start);
  for (const double kappa : {tuning::branch_kappa, tuning::last_kappa}) {
    const std::optional<Ending> end = path.follow(part, kappa);
    branch.point.start_from_path(path.iterate());
    static_cast<void>(found.solve_branch(part, "", tuning::engine_budget));
    if (end || found.exists() || path.is_lost() || part.interrupted()) break;
  }
  if (!found.exists() && !part.interrupted()) static_cast<void>(search.find(part, start));
  run.add_part(part);
  return found.exists() &&
         take(run, found.best().x.z().cwiseQuotient(scale), found.best().set, "objective off");
}

PairTree::End Feasibility::search_tree(Run& run, ConstVectorRef z, int last_factorization) {
  return tree_.run(run, z, last_factorization, [&](ConstVectorRef point, const WorkingSet& branch) {
    return take(run, point, branch, "tree over the pairs");
  });
}

SetTree::End Feasibility::search_sets(Run& run, ConstVectorRef z) {
  if (!sets_.applies(run)) return SetTree::End::stopped;
  const std::int64_t most = std::int64_t{tuning::set_nodes} * options_.max_feasibility_factorizations;
  return sets_.run(run, z, most, [&](ConstVectorRef point, const WorkingSet& branch) {
    return take(run, point, branch, "tree over sets of pairs");
  });
}

Feasibility::End Feasibility::run(Run& run, ConstVectorRef z) {
  const PhaseScope phase(run.activity(), Phase::feasibility);
  const Run::Polishing polishing(run);
  const int begin = run.factorizations;
  int last = begin + options_.max_feasibility_factorizations;
  int half = begin + options_.max_feasibility_factorizations / 2;
  const double bytes = run.bytes_left;
  auto tree = PairTree::End::stopped;
  auto sets = SetTree::End::stopped;
  const bool found = [&] {
    if (pivot(run, z, 0, tuning::lemke_ways, last) || pivot_carefully(run, z, last)) return true;
    const bool few_pairs = problem_.pairs() <= tuning::tree_pairs;
    if (few_pairs) {
      tree = search_tree(run, z, begin + options_.max_feasibility_factorizations / tuning::tree_first_share);
      if (tree != PairTree::End::stopped) return tree == PairTree::End::found;
    }
    const int before = run.factorizations;
    sets = search_sets(run, z);
    if (sets != SetTree::End::stopped) return sets == SetTree::End::found;
    last += run.factorizations - before;
    half += run.factorizations - before;
    if (pivot(run, z, tuning::lemke_ways, tuning::lemke_more_ways, half)) return true;
    if (few_pairs && run.factorizations < half && !run.interrupted()) {
      tree = search_tree(run, z, half);
      if (tree != PairTree::End::stopped) return tree == PairTree::End::found;
    }
    for (const bool user_units : {false, true})
      if (run.factorizations < last && !run.interrupted() && solve_calm(run, z, user_units)) return true;
    if (pivot(run, z, tuning::lemke_more_ways, 2 * tuning::lemke_more_ways, last)) return true;
    if (run.factorizations < last && !run.interrupted()) tree = search_tree(run, z, last);
    return tree == PairTree::End::found;
  }();
  run.bytes_left = bytes;
  factorizations_ = run.factorizations - begin;
  if (found) return incumbent_.exists() ? End::solved : End::feasible;
  const bool refuted = tree == PairTree::End::refuted || sets == SetTree::End::refuted;
  radius_ = tree == PairTree::End::refuted ? tree_.radius() : refuted ? sets_.radius() : 0.0;
  return refuted ? End::refuted : End::none;
}

std::string Feasibility::describe(End end) const {
  std::string text;
  if (end == End::refuted)
    text =
        "every branch of the pairs contradicts the constraints: no z with |z| <= " + scientific(radius_, 1) +
        " is feasible; ";
  return text + "feasibility phase: " + std::to_string(factorizations_) + " factorizations, " +
         std::to_string(tree_.nodes() + sets_.nodes()) + " nodes of a tree; ";
}

}  // namespace marble
