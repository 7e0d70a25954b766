// Local search for a convex Q among the branches that differ from a given one in one pair or in two. Where
// rows tie pairs together, as a limit on the number of positive variables does, no branch with one other pair
// may be feasible, and every single switch fails. The neighbours are solved in the space of their rows, by
// the engine of the tree's nodes, and left as soon as their bound is not below the present objective.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "global/relaxation.h"
#include "search/incumbent.h"

namespace marble {

class ExchangeSearch {
 public:
  /// Solves better branches exactly on `point`, with the incumbent's engine.
  ExchangeSearch(const ScaledProblem& problem, BranchPoint& point, Incumbent& incumbent);

  /// True if a row of A or C ties at least half of the pairs together. Elsewhere exchanges hardly ever gain.
  [[nodiscard]] static bool applies(const ScaledProblem& problem);
  /// Searches from the incumbent, then again and again from branches that differ from the best one in a few
  /// exchanges, until the engine has computed `most_points` points: each takes about as long as a
  /// factorization. Returns how many branches it bounded: none if memory or a stop prevents it.
  [[nodiscard]] std::int64_t run(Run& run, std::int64_t most_points, double most_bytes);

 private:
  using Sides = std::vector<std::uint8_t>;  // as WorkingSet::s_fixed
  struct Neighbour {
    Index one, other;       // pairs that change sides; the same for a single one
    double decrease = 0.0;  // of the objective, estimated
  };
  [[nodiscard]] bool prepare(Run& run, double most_bytes);
  [[nodiscard]] bool start(Run& run);
  [[nodiscard]] bool move(Run& run, const Sides& to, double cutoff);
  [[nodiscard]] bool move_to(Run& run, const Neighbour& to, double cutoff);
  void list_neighbours();
  [[nodiscard]] bool find_better(Run& run);
  [[nodiscard]] bool descend(Run& run);
  [[nodiscard]] bool perturb(Run& run);
  void offer(Run& run);
  [[nodiscard]] Index draw_pair();
  [[nodiscard]] bool ended(const Run& run) const {
    return engine_->points() >= most_points_ || run.interrupted();
  }
  [[nodiscard]] double cutoff() const;

  const ScaledProblem& problem_;
  BranchPoint& point_;
  Incumbent& incumbent_;
  std::unique_ptr<Gram> gram_;
  std::unique_ptr<Relaxation> engine_;  // its saved state is the present branch's solution
  std::optional<Box> box_;
  Sides sides_, trial_;     // of the present branch, of a neighbour
  double objective_ = 0.0;  // of the present branch, scaled: what the engine proves of it
  std::vector<Neighbour> neighbours_;
  std::uint64_t draws_ = 0;  // random numbers so far
  std::int64_t bounded_ = 0, most_points_ = 0;
};

}  // namespace marble
