// Further starts of two kinds. One softens the best branch so far and hardens it again, softer each time. The
// other begins at the end of an interior point method from a random point.
//
// They come in rounds. All starts of a round begin with what the previous round has left and do not exchange
// information, so they may run at once: which threads run them, and when, changes nothing.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "branch/branch_engines.h"
#include "model/tuning.h"
#include "path/interior.h"
#include "search/incumbent.h"
#include "search/local_search.h"

namespace marble {

class FurtherStarts {
 public:
  enum class Kind { softened, random };
  struct Start {
    Kind kind;
    int number;  ///< softened: how often `rho_first` of the plan is reduced; random: which point
  };
  /// What all starts of a round have in common.
  struct Plans {
    SearchPlan softened, random;
    int most_factorizations;  ///< of one start
    int made, asked;  ///< starts before this round, and all that were asked for or 0: for the progress
  };
  /// How many starts of each kind have improved the incumbent.
  struct Gains {
    int softened = 0, random = 0;
  };

  FurtherStarts(const ScaledProblem& problem, const Options& options, BranchEngines& branch,
                LocalSearch& search, InteriorEngine& interior);

  /// Sets the point (scaled) around which the random points are; zero until then.
  void center_at(ConstVectorRef z) { center_ = z; }
  /// Runs starts, at most tuning::further_round of them. In their order, each that found a better solution
  /// than the incumbent replaces it; then `settle` is called, if given, which may improve the incumbent. More
  /// starts never give a worse result than the first of them.
  Gains round(Run& run, const Plans& plans, std::span<const Start> starts, Incumbent& incumbent,
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
    InteriorEngine interior;
  };
  // One search of a round: its start and its result.
  struct Attempt {
    explicit Attempt(const ScaledProblem& problem) : point(problem.variables()), found(problem) {}
    BranchEngines* branch = nullptr;
    LocalSearch* search = nullptr;
    InteriorEngine* interior = nullptr;
    Kind kind = Kind::softened;
    SearchPlan plan = {};
    int most_factorizations = 0;
    const ExactSolution* begin = nullptr;
    Vector point;  // of the random kind
    std::optional<Run> run;
    ExactSolution found;
    bool succeeded = false, out_of_memory = false;
  };
  [[nodiscard]] bool make_engines(Run& run, std::size_t count);
  void set_up(Attempt& attempt, const Start& start, const Plans& plans) const;
  void make(Attempt& attempt);
  [[nodiscard]] static bool begin(Attempt& attempt);

  const ScaledProblem& problem_;
  const Options& options_;
  BranchEngines& branch_;
  LocalSearch& search_;
  InteriorEngine& interior_;
  Vector center_;
  std::vector<std::unique_ptr<Engine>> engines_;  // made when first needed
  std::vector<Attempt> attempts_;
  std::vector<std::function<void()>> tasks_;  // each makes one attempt
  Reporter reporter_;
  const Run* whole_ = nullptr;  // the run of the current round
  int asked_ = 0;
  std::atomic<int> made_ = 0;  // starts before the round, plus the completed ones in it
};

}  // namespace marble
