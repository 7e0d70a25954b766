// Which engine runs when: from a point to the best exact solution of a branch that the budgets allow.
//
//   path ──► exact solution of its branch ──► better branches: near it, or from where all is soft still
//     └─ branch infeasible ──► interior point ──► branches near its end, exchanged until one is feasible
//
// With a warm start the branch of the point given comes first, and often last.
#pragma once

#include <optional>
#include <span>

#include "further_starts.h"
#include "interior.h"
#include "local_search.h"
#include "path.h"
#include "second_order.h"
#include "termination.h"

namespace marble {

class Strategy {
 public:
  Strategy(const ScaledProblem& problem, Kkt& kkt, const Options& options);

  /// A solution to start from (scaled), and the whole objective that a cold start reached before it.
  struct WarmStart {
    const Iterate* solution;
    double cold_objective;
  };

  /// From z (scaled) to an end; if there is a solution to start from, from its branch first.
  [[nodiscard]] Ending run(Run& run, ConstVectorRef initial_z, const std::optional<WarmStart>& warm_start);
  /// Whether the last run() needed no cold start.
  [[nodiscard]] bool stayed_warm() const { return stayed_warm_; }

  /// What it ended with: exact where the ending says solved by a branch, else the path's.
  [[nodiscard]] const Iterate& best() const { return has_exact_ ? exact_.x : fallback_; }
  /// True if it is exact and solves every branch it belongs to; absent if that was not decided.
  [[nodiscard]] std::optional<bool> b_stationary() const { return b_stationary_; }
  /// What curvature says of it on its branches: `minimum` also where it was not decided whether it is
  /// B-stationary.
  [[nodiscard]] SecondOrder second_order() const { return second_order_; }
  /// Q has new values.
  void forget_convexity() { convexity_ = Convexity::unknown; }

 private:
  enum class Outcome { kept, no_better, path_is_lower, not_exact };
  [[nodiscard]] static bool is_answer(Outcome outcome) {
    return outcome == Outcome::kept || outcome == Outcome::no_better;
  }
  enum class Convexity { unknown, dominant, convex, indefinite };
  [[nodiscard]] Outcome make_exact(Run& run, const char* origin, int budget);
  [[nodiscard]] bool from_solution(Run& run, const WarmStart& warm_start);
  [[nodiscard]] Ending cold(Run& run);
  [[nodiscard]] std::optional<Ending> follow_path(Run& run, double kappa_end);
  [[nodiscard]] Outcome from_path(Run& run);
  [[nodiscard]] bool is_lower(const Violations& violations, double objective) const;
  [[nodiscard]] bool from_interior(Run& run);
  void improve(Run& run, int last_factorization);
  void improve_from_soft(Run& run, int last_factorization);
  void start_again(Run& run);
  [[nodiscard]] bool start_further(Run& run, int first, int count);
  [[nodiscard]] std::optional<Ending> prove(Run& run, Status status);
  [[nodiscard]] std::optional<Ending> prove_unbounded_from(Run& run, ConstVectorRef z,
                                                           ConstVectorRef direction);
  [[nodiscard]] std::optional<Ending> descend_from_path(Run& run);
  [[nodiscard]] std::optional<Ending> descend(Run& run, const Iterate& x, const WorkingSet& set,
                                              ConstVectorRef direction);
  [[nodiscard]] Ending finish_exact(Run& run);
  void decide_b_stationarity(Run& run);
  [[nodiscard]] CriticalCurvature decide_second_order(Run& run);
  [[nodiscard]] bool known_convex() const {
    return convexity_ == Convexity::dominant || convexity_ == Convexity::convex;
  }
  [[nodiscard]] bool is_convex(Run& run);
  [[nodiscard]] bool solves_its_branches(Run& run, std::span<const Index> biactive);
  [[nodiscard]] Ending explain_exact() const;

  const ScaledProblem& problem_;
  Kkt& kkt_;
  const Options& options_;
  PathEngine path_;
  InteriorEngine interior_;
  ActiveSet active_set_;
  LocalSearch search_;
  Vector initial_z_;
  Iterate fallback_;  // what the path ended with, for solves without anything better
  Violations fallback_violations_;
  double fallback_objective_ = 0.0;  // scaled
  bool has_fallback_ = false;
  FurtherStarts further_starts_;
  ExactSolution exact_, candidate_;  // the best one so far, and the one at hand
  WorkingSet branch_base_, branch_set_;
  Images finish_images_;
  bool has_exact_ = false, branch_infeasible_ = false, stayed_warm_ = false, searched_soft_ = false;
  bool tried_infeasible_ = false, tried_unbounded_ = false;
  std::optional<bool> b_stationary_;
  SecondOrder second_order_ = SecondOrder::unknown;
  Convexity convexity_ = Convexity::unknown;  // of Q; found once
  const char* origin_ = "";                   // the engines that found it
};

}  // namespace marble
