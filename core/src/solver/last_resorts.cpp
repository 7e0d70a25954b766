// The last part of a solve for which no engine has an exact solution: descents from the path's final point,
// proofs that there is no solution, the feasibility phase and, for a small problem, its tree.
#include <cmath>
#include <string>
#include <utility>

#include "global/feasibility.h"
#include "model/text_of.h"
#include "model/tuning.h"
#include "proof/proof.h"
#include "solver/strategy.h"

namespace marble {

// For a small problem, the tree may solve what no engine has solved.
std::optional<Strategy::Answer> Strategy::find_by_small_tree(Run& run, TreeResult& tree) {
  if (run.interrupted() || !is_small(run)) return std::nullopt;
  tree =
      search_small_tree(run, path_point_.x.z(), optimality_.known_convex(), options_.max_small_problem_nodes);
  if (tree.ray) return Answer{unbounded_along(*std::exchange(tree.ray, {})), &path_point_.x};
  if (!incumbent_.exists()) return std::nullopt;
  Answer answer = finish_cold(run, false);
  // If the point is feasible only to the tolerances, the proof does not prove its optimality.
  const bool exact = incumbent_.exists() && largest(incumbent_.best().violations) <= tuning::exactness;
  if (tree.proved && exact) {
    answer.b_stationary = true;
    answer.tree = tree;
  }
  answer.tree.nodes = tree.nodes, answer.tree.open_nodes = tree.open_nodes;
  return answer;
}

// If no exact solution was found: returns the path's point, unless a descent from it or a proof gives more.
Strategy::Answer Strategy::finish_path(Run& run, ConstVectorRef initial_z, Ending end) {
  Answer answer{std::move(end), &path_point_.x};
  const Status status = answer.ending.status;
  const auto ended = [&](Ending ending) {
    answer.ending = std::move(ending);
    return answer;
  };
  const bool failed = status == Status::numerical_failure;
  if (const auto reason = run.interrupted(); reason && !is_solved(status) && !is_proof(status))
    return ended({*reason, "stopped early; " + describe(path_point_.violations), {}});
  if (is_solved(status) || failed) {
    Optimality::Descended descended = descend_from_path(run);
    if (descended.unbounded) return ended(unbounded_along(*std::move(descended.unbounded)));
    if (incumbent_.exists()) return finish_exact(run);
    if (descended.from_saddle) answer.second_order = SecondOrder::saddle;
  }
  if ((failed || status == Status::locally_infeasible) && !start_) {
    if (std::optional<Ending> proved = prove(run, Status::infeasible)) return ended(*std::move(proved));
  }
  if (failed) {
    if (std::optional<Ending> proved = prove(run, Status::unbounded)) return ended(*std::move(proved));
  }
  if (failed || status == Status::locally_infeasible) {
    if (std::optional<Answer> found = find_feasible(run, initial_z)) return *std::move(found);
  }
  const double rounding =
      tuning::rounding * (1.0 + max_abs(path_point_.x.z().cwiseProduct(problem_.variable_scale)));
  TreeResult tree;
  if (failed || is_solved(status)) {
    if (std::optional<Answer> found = find_by_small_tree(run, tree)) return *std::move(found);
    answer.tree.nodes = tree.nodes, answer.tree.open_nodes = tree.open_nodes;
  }
  if (failed && options_.polish && !start_ && largest(path_point_.violations) > rounding)
    return ended({Status::locally_infeasible, "no feasible branch near; " + answer.ending.detail, {}});
  if (is_solved(status) && optimality_.known_convex()) answer.second_order = SecondOrder::minimum;
  if (answer.ending.detail.empty()) answer.ending.detail = "path; " + describe(path_point_.violations);
  return answer;
}

// The last attempt to find a feasible branch. Returns nothing if only the counters changed.
std::optional<Strategy::Answer> Strategy::find_feasible(Run& run, ConstVectorRef z) {
  if (!options_.polish || options_.path != Path::fast || options_.max_feasibility_factorizations == 0 ||
      start_ || within_tolerances(path_point_.violations, options_) || problem_.pairs() == 0)
    return std::nullopt;
  Feasibility phase(problem_, options_, branch_.point, incumbent_);
  const Feasibility::End end = phase.run(run, z);
  const auto ended = [&](Status status, const char* what) {
    return Answer{{status, what + phase.describe(end) + describe(path_point_.violations), {}},
                  &path_point_.x};
  };
  if (end == Feasibility::End::refuted) return ended(Status::infeasible, "");
  if (end == Feasibility::End::none) {
    if (const auto reason = run.interrupted()) return ended(*reason, "stopped early; ");
    TreeResult tree;
    if (std::optional<Answer> found = find_by_small_tree(run, tree)) return found;
    if (tree.end == TreeResult::End::infeasible) {
      Answer answer = ended(Status::infeasible, "every branch of the pairs contradicts the constraints; ");
      answer.tree = std::move(tree);
      return answer;
    }
    return ended(Status::locally_infeasible, "no feasible branch found; ");
  }
  if (end == Feasibility::End::feasible) {
    path_point_.x.all = branch_.point.x.all;
    path_point_.violations = violations(problem_, branch_.point.images);
    Optimality::Descended descended = optimality_.descend(run, path_point_.x, branch_.point.set, Vector());
    if (descended.unbounded) {
      Answer answer{unbounded_along(*std::move(descended.unbounded)), &path_point_.x};
      return answer;
    }
    TreeResult tree;
    if (!incumbent_.exists()) {
      if (std::optional<Answer> found = find_by_small_tree(run, tree)) return found;
      return ended(Status::numerical_failure, "feasible, but not optimal; ");
    }
  } else {
    static_cast<void>(search_.improve(run, z));
  }
  return finish_cold(run, true);
}

// If a path ended without an exact solution of its branch, Q may have negative curvature there. If the path
// ended infeasible for that reason, the descent begins at the nearest feasible point.
Optimality::Descended Strategy::descend_from_path(Run& run) {
  if (!options_.polish || options_.max_local_search_factorizations == 0 || optimality_.known_convex())
    return {};
  const Run::Polishing polishing(run);
  if (within_tolerances(path_point_.violations, options_)) {
    branch_.point.start_from_path(path_point_.x);
  } else {
    if (!run.nonconvex) return {};
    const Vector z = path_point_.x.z();
    const std::optional<Vector> point = feasible_point(problem_, options_, z, z, run);
    if (!point) return {};
    branch_.point.set = WorkingSet(problem_);
    branch_.point.start_from_point(*point);
  }
  return optimality_.descend(run, branch_.point.x, branch_.point.set, Vector());
}

// Once per solve.
std::optional<Ending> Strategy::prove(Run& run, Status status) {
  const auto z = path_point_.x.z();
  if (status == Status::unbounded) {
    if (std::exchange(looked_for_.unbounded, true)) return std::nullopt;
    std::optional<UnboundedRay> ray = prove_unbounded(problem_, options_, z, z, run);
    if (!ray) return std::nullopt;
    return unbounded_along(*std::move(ray));
  }
  if (std::exchange(looked_for_.infeasible, true)) return std::nullopt;
  std::optional<FarkasProof> proof = prove_infeasible(problem_, z, run);
  if (!proof) return std::nullopt;
  return contradicted_by(run, *std::move(proof));
}

// Where an engine's iterate suggests it, before the others have spent their budgets. A contradiction that a
// point within the reduced tolerances may meet is left to them: yᵀ(Az + b) − νᵀ(Cz + d) − ξᵀs − ηᵀt = 1.
std::optional<Ending> Strategy::prove_early(Run& run, const Iterate& x) {
  if (run.interrupted()) return std::nullopt;
  std::optional<FarkasProof> proof = prove_infeasible(problem_, x.z(), run);
  if (!proof) return std::nullopt;
  const Eigen::Map<const Vector> multipliers(proof->multipliers.data(),
                                             static_cast<Index>(proof->multipliers.size()));
  const double tolerated =
      options_.equality_tolerance * multipliers.head(problem_.equalities()).lpNorm<1>() +
      options_.inequality_tolerance *
          multipliers.segment(problem_.equalities(), problem_.inequalities()).lpNorm<1>() +
      options_.complementarity_tolerance * multipliers.tail(2 * problem_.pairs()).lpNorm<1>();
  if (!(tuning::reduced_factor * tolerated < 1.0)) return std::nullopt;
  path_point_.x.all = x.all;
  judge_path_point();
  return contradicted_by(run, *std::move(proof));
}

Ending Strategy::contradicted_by(Run& run, FarkasProof proof) const {
  if (run.proof() != nullptr) run.proof()->radius = proof.radius;
  return {Status::infeasible,
          "the constraints contradict each other even without complementarity: no z with |z| <= " +
              scientific(proof.radius, 1) + " is feasible; " + describe(path_point_.violations),
          std::move(proof.multipliers)};
}

// Makes the ray's origin the point of the solution.
Ending Strategy::unbounded_along(UnboundedRay ray) {
  incumbent_.clear();
  path_point_.x.all.setZero();
  path_point_.x.z() = ray.origin;
  Images images(problem_);
  images.evaluate(problem_, path_point_.x);
  path_point_.violations = violations(problem_, images);
  return {Status::unbounded,
          "the objective falls without bound along the certificate; " + describe(path_point_.violations),
          std::move(ray.direction)};
}

}  // namespace marble
