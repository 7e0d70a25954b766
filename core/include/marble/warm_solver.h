// One problem again and again: each solve starts from the last answer. A planner's loop, without a server.
//
//   auto solver = marble::WarmSolver::create(*problem, options);
//   auto answer = solver->solve({.b = state});
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "marble/restart.h"
#include "marble/solver.h"

namespace marble {

/// A Solver that remembers the newest answer that was solved. What a session is on the server, and what it is
/// in process: the same updates give the same answers, to the last bit. One thread at a time.
class WarmSolver {
 public:
  /// As Solver::create. `initial_z` (n or empty) is where a cold start begins until a Restart says otherwise.
  [[nodiscard]] static Expected<WarmSolver> create(const Problem& problem, const Options& options = {},
                                                   std::span<const double> initial_z = {},
                                                   const SetupControls& controls = {});

  /// Takes the new numbers and solves from the last answer, as `restart` says. `controls` may not have
  /// initial_z or warm_start: they are this class's own. Errors: as Solver::update and Restart::check name
  /// them; nothing has changed then.
  [[nodiscard]] Expected<Solution> solve(const ProblemUpdate& update = {}, const Restart& restart = {},
                                         const SolveControls& controls = {});

  /// Other options for solves to come; scaling_passes stays as it was set up. Options must be valid.
  [[nodiscard]] Expected<void> set_options(const Options& options) { return solver_.set_options(options); }

  /// With the answer it keeps, in bytes, by the estimate of Solver::create.
  [[nodiscard]] std::int64_t memory_bytes() const;
  /// Scaling, ordering, analysis and allocation took this long. Answers tell it no more.
  [[nodiscard]] double setup_s() const { return setup_s_; }

 private:
  WarmSolver(Solver solver, const PartSizes& sizes, double setup_s, std::span<const double> initial_z);
  void begin_at(const Restart& restart);

  Solver solver_;
  PartSizes sizes_;
  double setup_s_;
  std::vector<double> initial_z_;   // where a cold start begins
  std::optional<Solution> newest_;  // that was solved, to start from
};

}  // namespace marble
