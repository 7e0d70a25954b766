// Local search over branches: which side of each pair is zero.
//
// The moves are flips of one pair and exchanges of two, judged by Parametric without a factorization. They
// are searched on the elastic problem while its ρ rises: a soft problem lets a pair change sides before all
// others have settled, which a feasible one does not.
#pragma once

#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "branch/parametric.h"
#include "run/reporter.h"
#include "tuning.h"

namespace marble {

/// At which ρ to look, and how hard.
struct SearchPlan {
  double rho_first;
  double rho_factor = tuning::search_rho_factor;
  double rho_last = tuning::exact_rho;
  double rho_soft = 0.0;  ///< flips are searched at the first ρ, up to this one, and at the last
  double rho_exchange = std::numeric_limits<double>::infinity();  ///< exchanges are searched from here on
  bool from_exact = false;  ///< the point is the exact solution of its branch, not just near one
  bool resumes = false;  ///< it goes on at the ρ and with the anchor of the last run, which was interrupted
  int first_patience = 0;     ///< flips in a row that may fail at the first ρ
  int flip_patience = 0;      ///< and at later ones
  int exchange_patience = 0;  ///< exchanges of two pairs in a row that may fail
};

class LocalSearch {
 public:
  LocalSearch(const ScaledProblem& problem, Kkt& kkt, ElasticRelaxation& elastic);

  /// Searches from the branch and the point of `elastic`, up to the run's given count of factorizations, and
  /// leaves that at the best elastic optimum found, for the last ρ. False if there is none.
  [[nodiscard]] bool run(Run& run, const SearchPlan& plan, int last_factorization);
  /// Pairs of an exact solution whose fixed side has descent on its other side: what there is to search.
  [[nodiscard]] static int pulling(const Iterate& x, const WorkingSet& set);
  [[nodiscard]] int accepted() const { return accepted_; }  ///< moves, of the last run()

 private:
  struct Candidate {
    Index pair;
    double rank;  // lower is tried first
  };
  void search_flips(Run& run, int patience, int last_factorization);
  void search_exchanges(Run& run, int patience, int last_factorization);
  [[nodiscard]] bool exchange_some(Run& run, int patience, int last_factorization);
  void rank_flips();
  void rank_exchanges();
  void find_companions(Index pair);
  [[nodiscard]] bool failed_before(const Candidate& candidate, const Candidate& companion) const;
  [[nodiscard]] bool take(Run& run, std::span<const Index> pairs);
  [[nodiscard]] double least_improvement() const;
  [[nodiscard]] double largest_violation() const;
  void sort_candidates();
  void report(Run& run);

  const ScaledProblem& problem_;
  ElasticRelaxation& elastic_;
  Parametric parametric_;
  WorkingSet before_, next_;
  std::vector<Candidate> candidates_, companions_;
  std::vector<std::pair<Candidate, Candidate>> failed_exchanges_;
  Vector failed_multiplier_, failed_slack_;  // of a pair when it last failed: not tried again where alike
  Reporter reporter_;
  int accepted_ = 0;
  int flip_failures_ = 0, exchange_failures_ = 0;  // in a row; kept where a run is interrupted
  double rho_ = 0.0;                               // at hand, or where the last run was interrupted
  bool lost_ = false;  // a move was taken back and the optimum before it not found again
};

}  // namespace marble
