// Which engine runs when: from a starting point to the best exact solution of a branch within the budgets.
//
//   path ──► exact solution of its branch ──► better branches: near it, or from where all is soft still
//     └─ branch infeasible ──► interior point ──► branches near its end, exchanged until one is feasible
//                                └─ none is ──► the feasibility phase, which ignores the objective
//
// Option method may select a published method instead of these engines.
//
// With a warm start, the branch of the given point comes first, and often no other engine is needed.
#pragma once

#include <array>
#include <limits>
#include <memory>
#include <optional>
#include <span>

#include "global/tree.h"
#include "path/path.h"
#include "path/termination.h"
#include "search/branch_search.h"
#include "search/incumbent.h"
#include "solver/optimality.h"
#include "solver/reference_methods.h"

namespace marble {

class Strategy {
 public:
  /// `methods` is needed where option `method` may be one of them.
  Strategy(const ScaledProblem& problem, Kkt& kkt, const Options& options, const ReferenceMethods* methods);

  /// A starting solution (scaled), and the objective after the last search for branches before it.
  struct WarmStart {
    const Iterate* solution;
    double reference_objective;
  };
  struct Answer {
    Ending ending;
    const Iterate* x;  ///< valid until the next run: exact if a branch was solved, otherwise the path's point
    /// True if x is exact and solves every branch that it belongs to; absent if that was not decided.
    std::optional<bool> b_stationary = {};
    /// The result of the curvature test on the branches of x: `minimum` even if B-stationarity was not
    /// decided.
    SecondOrder second_order = SecondOrder::unknown;
    bool stayed_warm = false;   ///< no cold start was needed
    bool has_searched = false;  ///< better branches were searched for all the same
    TreeResult tree = {};       ///< with option global_search
  };

  /// Solves from z (scaled). With a warm start, its branch comes first. With `resumes`, the run continues
  /// where the last one was interrupted, if that had no exact solution yet. With `keeps_start`, if z is
  /// feasible, its branch is solved first, and the solution is never above that of this branch; nor is it
  /// above a feasible warm start. With `near`, solutions of similar problems without an order in time, the
  /// best of their branches comes first instead, with a search around it; with `compares_more`, of more of
  /// them.
  struct How {
    bool resumes = false, keeps_start = false;
    std::span<const Iterate> near = {};
    bool compares_more = false;
  };
  [[nodiscard]] Answer run(Run& run, ConstVectorRef initial_z, const std::optional<WarmStart>& warm_start,
                           How how);
  /// True if Q is known to be convex without another factorization.
  [[nodiscard]] bool known_convex() { return optimality_.known_convex(); }
  /// Decides the same by a factorization if it is not known.
  [[nodiscard]] bool decide_convexity(Run& run) { return optimality_.convex(run); }
  /// True if a run may resume.
  [[nodiscard]] bool is_unfinished() const { return stage_ != Stage::beginning; }
  void forget_unfinished() { stage_ = Stage::beginning; }
  /// Prepares the beginning of run() with this warm start; vectors may still change before that run.
  void prepare(Run& run, const WarmStart& warm_start) {
    if (options_.method == Method::marble) search_.prepare(run, *warm_start.solution);
  }
  /// Valid until the next run, which resets it. With the factor with which this run ended, if that is the
  /// last one.
  [[nodiscard]] BranchPoint& point() { return branch_.point; }
  /// Memory for a tree, with option global_search, and the part of it that may be kept for the next tree.
  void allow_tree(double bytes, double kept_bytes) {
    tree_bytes_ = bytes;
    kept_tree_bytes_ = kept_bytes;
  }
  /// From now on, keeps the bounds that a tree proves for the next warm solve.
  void keep_tree() { keeps_tree_ = true; }
  /// Shifts the kept tree.
  void shift_tree(const Shift& by) {
    if (tree_ != nullptr) tree_->shift(by);
  }
  /// Call this when the scale factors have changed: all data of earlier runs have other units.
  void forget_scaling() {
    stage_ = Stage::beginning;
    tree_.reset();
  }
  /// Call this when the matrices have new values.
  void forget_matrices() {
    branch_.point.forget_ahead();
    optimality_.forget_convexity();
    if (tree_ != nullptr) tree_->forget_matrices();
  }

 private:
  // The path's point, for solves without a better one.
  struct PathPoint {
    explicit PathPoint(const ScaledProblem& problem) : x(problem) {}
    Iterate x;
    Violations violations;
    double objective = 0.0;  // scaled
  };
  // The result of solving the branch that the path shows.
  enum class PathBranch { exact, path_is_lower, not_exact };

  [[nodiscard]] Answer run_reference(Run& run, ConstVectorRef initial_z);
  [[nodiscard]] Answer run_locally(Run& run, ConstVectorRef initial_z,
                                   const std::optional<WarmStart>& warm_start, Stage from);
  [[nodiscard]] Answer finish_step(Run& run);
  void add_tree(Answer& answer, TreeResult tree) const;
  [[nodiscard]] Answer search_globally(Run& run, Answer local, bool warm);
  [[nodiscard]] bool take_interior(Run& run);
  [[nodiscard]] Answer solve_densely(Run& run, Answer answer);
  [[nodiscard]] bool incumbent_is_loose() const;
  [[nodiscard]] std::optional<Answer> search_densely(Run& run, const Answer& answer);
  [[nodiscard]] std::optional<Answer> solve_branch_densely(Run& run, const Answer& answer);
  [[nodiscard]] bool take_start(ConstVectorRef z);
  void solve_branch_of_start(Run& run);
  [[nodiscard]] double loss_to_violations(const ExactSolution& exact) const;
  [[nodiscard]] double noise_of_start() const;
  void solve_start(Run& run);
  [[nodiscard]] std::optional<Answer> step_from_start(Run& run, ConstVectorRef z,
                                                      const WarmStart& warm_start);
  [[nodiscard]] std::optional<Answer> step_near(Run& run, const How& how);
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
  // cold_solve.cpp
  [[nodiscard]] std::optional<Ending> solve_cold(Run& run, ConstVectorRef initial_z, Stage from);
  // What its stages pass on.
  struct Cold {
    ConstVectorRef initial_z;
    Stage from;                                 // at which the last run was interrupted
    std::optional<Ending> end = {};             // of the path
    PathBranch branch = PathBranch::not_exact;  // at which the path arrived
    bool interior_interrupted = false;
    bool searched = false;       // for branches, by segments
    bool path_borrowed = false;  // by a soft start
    bool at_end_of_path = false;
  };
  struct ColdStage {
    bool (Strategy::*applies)(const Cold&) const;
    bool (Strategy::*run)(Run&, Cold&);  // returns true if the cold solve ends with this stage
  };
  static const std::array<ColdStage, 8> kColdStages;
  [[nodiscard]] bool always(const Cold&) const { return true; }
  [[nodiscard]] bool has_no_pairs(const Cold& cold) const;
  [[nodiscard]] bool searches(const Cold& cold) const;
  [[nodiscard]] bool starts_search(const Cold& cold) const;
  [[nodiscard]] bool has_branch(const Cold& cold) const;
  [[nodiscard]] bool lacks_branch(const Cold& cold) const;
  [[nodiscard]] bool lacks_solution(const Cold& cold) const;
  [[nodiscard]] bool is_at_end_of_path(const Cold& cold) const { return cold.at_end_of_path; }
  [[nodiscard]] bool solve_without_pairs(Run& run, Cold& cold);
  [[nodiscard]] bool follow_path_to_branch(Run& run, Cold& cold);
  [[nodiscard]] bool search_in_segments(Run& run, Cold& cold);
  [[nodiscard]] bool search_near_branch(Run& run, Cold& cold);
  [[nodiscard]] bool find_branch(Run& run, Cold& cold);
  [[nodiscard]] bool search_elsewhere(Run& run, Cold& cold);
  [[nodiscard]] bool follow_rest_of_path(Run& run, Cold& cold);
  [[nodiscard]] bool solve_branch_at_end_of_path(Run& run, Cold& cold);
  void judge_path_point();
  [[nodiscard]] std::optional<Ending> follow_path(Run& run, double kappa_end);
  [[nodiscard]] PathBranch solve_path_branch(Run& run, bool exchanges_pairs);
  [[nodiscard]] bool path_is_lower(bool feasible, double objective) const;
  [[nodiscard]] Answer finish_exact(Run& run, int last_factorization = std::numeric_limits<int>::max());
  [[nodiscard]] Answer finish_exact_cold(Run& run);
  void bring_near(Run& run);
  void show_incumbent(const Run& run) const;
  [[nodiscard]] bool may_search_on() const;
  [[nodiscard]] bool has_small_tree(const Run& run, Index most_pairs, double most_size) const;
  [[nodiscard]] bool is_small(const Run& run) const;
  [[nodiscard]] bool is_small_for_its_pairs(const Run& run) const;
  [[nodiscard]] Answer finish_cold(Run& run, bool is_first);
  [[nodiscard]] bool may_start_again() const;
  [[nodiscard]] bool may_exchange() const;
  [[nodiscard]] std::int64_t small_problem_work() const;
  [[nodiscard]] std::string exchange_pairs(Run& run);
  [[nodiscard]] std::optional<Answer> find_by_small_tree(Run& run, TreeResult& tree);
  [[nodiscard]] TreeResult search_small_tree(Run& run, ConstVectorRef z, bool known_convex,
                                             std::int64_t nodes);
  [[nodiscard]] Answer finish_path(Run& run, ConstVectorRef initial_z, Ending end);
  [[nodiscard]] Optimality::Descended descend_from_path(Run& run);
  [[nodiscard]] std::optional<Answer> find_feasible(Run& run, ConstVectorRef z);
  [[nodiscard]] std::optional<Ending> prove(Run& run, Status status);
  [[nodiscard]] std::optional<Ending> prove_early(Run& run, const Iterate& x);
  [[nodiscard]] Ending contradicted_by(Run& run, FarkasProof proof) const;
  [[nodiscard]] Ending unbounded_along(UnboundedRay ray);

  const ScaledProblem& problem_;
  const Options& options_;
  const ReferenceMethods* methods_;
  Kkt& kkt_;
  PathEngine path_;
  BranchEngines branch_;
  Incumbent incumbent_;
  BranchSearch search_;
  Optimality optimality_;
  PathPoint path_point_;
  std::optional<ExactSolution> start_;  // the caller's feasible start: its branch's solution, or itself
  bool start_is_exact_ = false;
  Stage stage_ = Stage::beginning;             // at which the last run was interrupted
  std::unique_ptr<ReferenceSolve> reference_;  // created when first needed
  std::unique_ptr<Tree> tree_;                 // created when first needed
  double tree_bytes_ = 0.0, kept_tree_bytes_ = 0.0;
  bool keeps_tree_ = false;
  bool looks_for_contradiction_ = false;  // before the path has ended; not where a feasible point is known
  struct {
    bool infeasible, unbounded;
  } looked_for_ = {};  // proofs attempted in this run
};

}  // namespace marble
