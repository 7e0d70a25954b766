// Further starts: searches that each soften the best branch so far and harden it again, softer each time.
//
// They come in rounds. All starts of a round begin at the branch that the previous round has left and do not
// exchange information, so they may run at once: which threads run them, and when, changes nothing.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "branch/branch_engines.h"
#include "model/tuning.h"
#include "search/incumbent.h"
#include "search/local_search.h"

namespace marble {

class FurtherStarts {
 public:
  FurtherStarts(const ScaledProblem& problem, const Options& options, BranchEngines& branch,
                LocalSearch& search);

  /// Runs starts number `first` to `first` + `count` - 1, at most tuning::further_round of them, each from
  /// the incumbent. In their order, each that found a better one replaces it; then `settle` is called, if
  /// given, which may improve the incumbent. More starts never give a worse result than the first of them.
  /// Returns true if the incumbent was replaced.
  bool round(Run& run, const SearchPlan& plan, int first, int count, Incumbent& incumbent,
             const std::function<void()>& settle = {});

  /// Returns the memory of the engines that a round needs in addition to the given ones.
  [[nodiscard]] static double extra_bytes(const Options& options, double engine_bytes);

 private:
  // The engines of one search.
  struct Engine {
    Engine(const ScaledProblem& problem, std::unique_ptr<Kkt> own_kkt);
    std::unique_ptr<Kkt> kkt;
    BranchEngines branch;
    LocalSearch search;
  };
  // One search of a round: its start and its result.
  struct Attempt {
    explicit Attempt(const ScaledProblem& problem) : found(problem) {}
    BranchEngines* branch = nullptr;
    LocalSearch* search = nullptr;
    SearchPlan plan = {};
    const ExactSolution* begin = nullptr;
    std::optional<Run> run;
    ExactSolution found;
    bool succeeded = false, out_of_memory = false;
  };
  [[nodiscard]] bool make_engines(Run& run, std::size_t count);
  void make(Attempt& attempt);

  const ScaledProblem& problem_;
  const Options& options_;
  BranchEngines& branch_;
  LocalSearch& search_;
  std::vector<std::unique_ptr<Engine>> engines_;  // made when first needed
  std::vector<Attempt> attempts_;
  std::vector<std::function<void()>> tasks_;  // each makes one attempt
  Reporter reporter_;
  const Run* whole_ = nullptr;  // the run of the current round
  std::atomic<int> made_ = 0;   // starts before the round, plus the completed ones in it
};

}  // namespace marble
