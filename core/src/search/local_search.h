// Local search over branches: which side of each pair is zero.
//
// The moves are switches (switches) of one pair and exchanges of two, which Parametric evaluates without a
// factorization. The search works on the elastic problem while its ρ rises: in a soft problem a pair can
// change sides before all others have settled, in a feasible one it cannot.
#pragma once

#include <limits>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "branch/parametric.h"
#include "model/tuning.h"
#include "path/reporter.h"

namespace marble {

/// The values of ρ of a search, and its effort at each.
struct SearchPlan {
  double rho_first;
  double rho_factor = tuning::penalty_factor;
  double rho_last = tuning::exact_rho;
  double rho_soft = 0.0;  ///< switches are searched at the first ρ, up to this one, and at the last
  double rho_exchange = std::numeric_limits<double>::infinity();  ///< exchanges are searched from this ρ on
  bool from_exact = false;  ///< the point is the exact solution of its branch, not only near it
  bool resumes = false;  ///< continues at the ρ and with the anchor of the last run, which was interrupted
  double cutoff = std::numeric_limits<double>::infinity();  ///< scaled; see run()
  int first_patience = 0;     ///< consecutive switches that may fail at the first ρ
  int switch_patience = 0;    ///< the same at later ones
  int exchange_patience = 0;  ///< consecutive exchanges of two pairs that may fail
};

class LocalSearch {
 public:
  LocalSearch(const ScaledProblem& problem, Kkt& kkt, ElasticRelaxation& elastic);

  /// Searches from the branch and the point of `elastic`, up to the run's given count of factorizations, and
  /// leaves `elastic` at the best elastic optimum found, for the last ρ. Returns false if there is none, or
  /// if the search at some ρ ends above the plan's cutoff: a higher ρ raises the elastic optimum of a branch.
  [[nodiscard]] bool run(Run& run, const SearchPlan& plan, int last_factorization);
  /// Returns the number of pairs of an exact solution whose fixed side has a wrong-sign multiplier: the
  /// candidates of a search.
  [[nodiscard]] static int pulling(const Iterate& x, const WorkingSet& set);
  [[nodiscard]] Parametric& parametric() { return parametric_; }
  [[nodiscard]] int accepted() const { return accepted_; }  ///< accepted moves of the last run()

 private:
  struct Candidate {
    Index pair;
    double rank;  // lower ranks are tried first
  };
  [[nodiscard]] std::optional<bool> follow_switch(Index pair);
  void search_switches(Run& run, int patience, int last_factorization);
  void search_blocks(Run& run, int patience, int last_factorization);
  [[nodiscard]] bool add_to_block(Index pair);
  [[nodiscard]] bool take_block(Run& run);
  [[nodiscard]] bool take_first(Run& run, std::size_t count);
  void search_exchanges(Run& run, int patience, int last_factorization);
  [[nodiscard]] bool exchange_some(Run& run, int patience, int last_factorization);
  void rank_switches();
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
  Vector failed_multiplier_, failed_slack_;  // at a pair's last failure: not retried if similar
  Reporter reporter_;
  int accepted_ = 0;
  int switch_failures_ = 0, exchange_failures_ = 0;  // consecutive; kept if a run is interrupted
  double rho_ = 0.0;                                 // the current ρ, or that of the interrupted last run
  const bool blocks_;                                // switches are made together
  struct Member {
    Index pair;
    std::size_t end;  // of its rows in block_rows_
  };
  std::vector<Member> block_;        // pairs that switch together
  std::vector<Index> block_rows_;    // other rows that become active or inactive with them
  std::vector<std::uint8_t> taken_;  // rows that a member of the block changes
  bool lost_ = false;                // a move was undone, and the optimum before it was not found again
};

}  // namespace marble
