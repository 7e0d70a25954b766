// Which engine runs when: from a point to the best exact solution of a branch that the budgets allow.
//
//   path ──► exact solution of its branch ──► better branches: near it, or from where all is soft still
//     └─ branch infeasible ──► interior point ──► branches near its end, exchanged until one is feasible
//                                └─ none is ──► whatever finds one without regard to the objective
//
// Option method may name another way, of none of these engines.
//
// With a warm start the branch of the point given comes first, and often last.
#pragma once

#include <memory>
#include <optional>

#include "methods/reference.h"
#include "optimality.h"
#include "path/path.h"
#include "run/termination.h"
#include "search/branch_search.h"
#include "search/incumbent.h"
#include "tree/tree.h"

namespace marble {

class Strategy {
 public:
  Strategy(const ScaledProblem& problem, Kkt& kkt, const Options& options);

  /// A solution to start from (scaled), and the whole objective that a cold start reached before it.
  struct WarmStart {
    const Iterate* solution;
    double cold_objective;
  };
  struct Answer {
    Ending ending;
    const Iterate* x;  ///< lent until the next run: exact where a branch was solved, else the path's
    /// True if it is exact and solves every branch it belongs to; absent if that was not decided.
    std::optional<bool> b_stationary = {};
    /// What curvature says of it on its branches: `minimum` also where it was not decided whether it is
    /// B-stationary.
    SecondOrder second_order = SecondOrder::unknown;
    bool stayed_warm = false;  ///< it needed no cold start
    TreeResult tree = {};      ///< of option global
  };

  /// From z (scaled) to an end; if there is a solution to start from, from its branch first. With `resumes`
  /// from where the last run was interrupted, if it was before it had an exact solution. With `keeps_start`,
  /// where z is feasible, the branch of z is solved first and the answer is never above its solution;
  /// nor is it above a feasible solution to start from.
  struct How {
    bool resumes = false, keeps_start = false;
  };
  [[nodiscard]] Answer run(Run& run, ConstVectorRef initial_z, const std::optional<WarmStart>& warm_start,
                           How how);
  /// Whether Q is known to be convex without another factorization.
  [[nodiscard]] bool known_convex() { return optimality_.known_convex(); }
  /// Whether a run may resume.
  [[nodiscard]] bool is_unfinished() const { return stage_ != Stage::beginning; }
  void forget_unfinished() { stage_ = Stage::beginning; }
  /// Makes ready what run() with this warm start begins with; vectors may still change before.
  void prepare(Run& run, const WarmStart& warm_start) {
    if (options_.method == Method::marble) search_.prepare(run, *warm_start.solution);
  }
  /// Lent until the next run, which begins anew; with the factor that this one has ended with, if it is the
  /// last.
  [[nodiscard]] BranchPoint& point() { return branch_.point; }
  /// Memory that a tree may take, with option global, and what it may keep of that for the next one.
  void allow_tree(double bytes, double kept_bytes) {
    tree_bytes_ = bytes;
    kept_tree_bytes_ = kept_bytes;
  }
  /// From now on what a tree has proved is kept for the next solve that is warm.
  void keep_tree() { keeps_tree_ = true; }
  /// What a tree has kept moves on.
  void shift_tree(const Shift& by) {
    if (tree_ != nullptr) tree_->shift(by);
  }
  /// The scale factors have changed: nothing of earlier runs has the units of now.
  void forget_scaling() {
    stage_ = Stage::beginning;
    tree_.reset();
  }
  /// The matrices have new values.
  void forget_matrices() {
    branch_.point.forget_ahead();
    optimality_.forget_convexity();
    if (tree_ != nullptr) tree_->forget_matrices();
  }

 private:
  // A point of the path, for solves without anything better.
  struct PathPoint {
    explicit PathPoint(const ScaledProblem& problem) : x(problem) {}
    Iterate x;
    Violations violations;
    double objective = 0.0;  // scaled
  };
  // What came of the branch that the path shows.
  enum class PathBranch { exact, path_is_lower, not_exact };

  [[nodiscard]] Answer run_reference(Run& run, ConstVectorRef initial_z);
  [[nodiscard]] Answer run_locally(Run& run, ConstVectorRef initial_z,
                                   const std::optional<WarmStart>& warm_start, Stage from);
  [[nodiscard]] Answer search_globally(Run& run, Answer local, bool warm);
  [[nodiscard]] bool take_interior(Run& run);
  [[nodiscard]] Answer solve_densely(Run& run, Answer answer);
  [[nodiscard]] bool incumbent_is_loose() const;
  [[nodiscard]] std::optional<Answer> search_densely(Run& run, const Answer& answer);
  [[nodiscard]] std::optional<Answer> solve_branch_densely(Run& run, const Answer& answer);
  void solve_start(Run& run, ConstVectorRef z);
  [[nodiscard]] bool start_in_segments(Run& run, PathBranch branch);
  [[nodiscard]] Answer not_above_start(Run& run, Answer answer, ConstVectorRef z, bool warm);
  struct Judged {
    bool feasible;  // to the tolerances
    double objective;
  };
  [[nodiscard]] Judged judged(ConstVectorRef z) const;
  [[nodiscard]] Answer not_above_warm_start(Run& run, Answer answer, ConstVectorRef z);
  [[nodiscard]] bool start_for_tree(Run& run);
  void take_incumbent(Answer& answer) const;
  [[nodiscard]] std::optional<Ending> cold(Run& run, ConstVectorRef initial_z, Stage from);
  [[nodiscard]] std::optional<Ending> follow_to_branch(Run& run, PathBranch& branch);
  void judge_path_point();
  [[nodiscard]] std::optional<Ending> follow_path(Run& run, double kappa_end);
  [[nodiscard]] PathBranch solve_path_branch(Run& run, bool exchanges_pairs);
  [[nodiscard]] bool path_is_lower(bool feasible, double objective) const;
  [[nodiscard]] Answer finish_exact(Run& run);
  void bring_near(Run& run);
  void show_incumbent(const Run& run) const;
  [[nodiscard]] bool is_small(const Run& run) const;
  [[nodiscard]] Answer finish_cold(Run& run, bool small_too);
  [[nodiscard]] std::optional<Answer> find_by_small_tree(Run& run, TreeResult& tree);
  [[nodiscard]] TreeResult search_small_tree(Run& run, ConstVectorRef z, bool known_convex);
  [[nodiscard]] Answer finish_path(Run& run, ConstVectorRef initial_z, Ending end);
  [[nodiscard]] Optimality::Descended descend_from_path(Run& run);
  [[nodiscard]] std::optional<Answer> find_feasible(Run& run, ConstVectorRef z);
  [[nodiscard]] std::optional<Ending> prove(Run& run, Status status);
  [[nodiscard]] std::optional<Ending> prove_early(Run& run, const Iterate& x);
  [[nodiscard]] Ending contradicted_by(Run& run, FarkasProof proof) const;
  [[nodiscard]] Ending unbounded_along(UnboundedRay ray);

  const ScaledProblem& problem_;
  const Options& options_;
  Kkt& kkt_;
  PathEngine path_;
  BranchEngines branch_;
  Incumbent incumbent_;
  BranchSearch search_;
  Optimality optimality_;
  PathPoint path_point_;
  std::optional<ExactSolution> start_;  // the caller's, feasible: of its branch, or the point itself
  bool start_is_exact_ = false;
  Stage stage_ = Stage::beginning;        // at which the last run was interrupted
  std::unique_ptr<Reference> reference_;  // the same
  std::unique_ptr<Tree> tree_;            // made when it is first needed
  double tree_bytes_ = 0.0, kept_tree_bytes_ = 0.0;
  bool keeps_tree_ = false;
  bool looks_for_contradiction_ = false;  // before the path has ended; not where a feasible point is known
  struct {
    bool infeasible, unbounded;
  } looked_for_ = {};  // proofs, in this run
};

}  // namespace marble
