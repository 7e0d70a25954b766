// Solves one problem repeatedly; each solve starts from the last solution. An MPC loop without a server.
//
//   auto solver = marble::WarmSolver::create(*problem, options);
//   auto answer = solver->solve({.b = state});
#pragma once

#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "marble/restart.h"
#include "marble/solver.h"

namespace marble {

/// The checked inputs of one solve of a sequence: a WarmSolver of the same sizes does not check them again.
/// Borrows its arrays.
class CheckedUpdate {
 public:
  /// Errors: invalid_argument, with the fields of PartSizes::check and Restart::check.
  [[nodiscard]] static Expected<CheckedUpdate> check(const PartSizes& sizes, const ProblemUpdate& numbers,
                                                     Restart restart = {});
  /// Makes an update from parts that have already passed their own checks, all for these sizes, and from
  /// valid options.
  [[nodiscard]] static CheckedUpdate of_checked(const PartSizes& sizes, const ProblemUpdate& numbers,
                                                Restart restart, const Options& options);

  /// Returns the sizes of the problem that it was checked for.
  [[nodiscard]] const PartSizes& sizes() const { return sizes_; }
  /// Returns the new numbers.
  [[nodiscard]] const ProblemUpdate& numbers() const { return numbers_; }
  /// Returns how the solve starts.
  [[nodiscard]] const Restart& restart() const { return restart_; }
  /// Returns the options for this solve and the following ones; if absent, the current options stay.
  [[nodiscard]] const std::optional<Options>& options() const { return options_; }

 private:
  CheckedUpdate(const PartSizes& sizes, const ProblemUpdate& numbers, Restart restart)
      : sizes_(sizes), numbers_(numbers), restart_(std::move(restart)) {}

  PartSizes sizes_;
  ProblemUpdate numbers_;
  Restart restart_;
  std::optional<Options> options_;
};

/// A Solver that keeps its newest solved solution as the next start. It implements sessions on the server and
/// in process: the same updates give the same solutions, to the last bit. One thread at a time.
///
/// A solve that its time limit or its stop token ends early returns its best point, or the last solution if
/// only that is feasible (`origin`). The next solve resumes it with its own new numbers, unless its Restart
/// says where to begin. After a number of early ends in a row the next solve is cold.
class WarmSolver {
 public:
  /// As Solver::create. `initial_z` (n or empty) is where a cold start begins until a Restart sets another
  /// point.
  [[nodiscard]] static Expected<WarmSolver> create(const Problem& problem, const Options& options = {},
                                                   std::span<const double> initial_z = {},
                                                   const SetupControls& controls = {});

  /// Sets the new numbers and solves from the last solution, as `restart` says. `controls` must not contain
  /// initial_z or warm_start, which this class sets itself. Errors: as Solver::update and Restart::check;
  /// nothing has changed then.
  [[nodiscard]] Expected<Solution> solve(const ProblemUpdate& update = {}, const Restart& restart = {},
                                         const SolveControls& controls = {});
  /// The same for an update that was checked before. Errors: failed_precondition if it was checked for other
  /// sizes.
  [[nodiscard]] Expected<Solution> solve(const CheckedUpdate& update, const SolveControls& controls = {});

  /// The preparation phase of a solve: sets the new numbers and the start, and factorizes the branch with
  /// which the solve will begin. The following solve() brings the remaining numbers and returns, to the last
  /// bit, the solution of a single solve() with both, but sooner. It saves most if it only brings vectors
  /// that leave the rows of the branch unchanged, such as b. Of `controls` only stop and pause are used.
  /// Errors: as solve(); nothing has changed then.
  [[nodiscard]] Expected<void> prepare(const ProblemUpdate& update, const Restart& restart = {},
                                       const SolveControls& controls = {});
  /// The same for an update that was checked before.
  [[nodiscard]] Expected<void> prepare(const CheckedUpdate& update, const SolveControls& controls = {});

  /// Sets other options for the following solves; scaling_passes keeps its value from the set-up. Options
  /// must be valid and without explain.
  [[nodiscard]] Expected<void> set_options(const Options& options) {
    if (auto valid = validate_without_explain(options); !valid) return valid;
    return solver_.set_options(options);
  }

  /// Sets the number (>= 1) of consecutive solves that ended early after which the next solve discards
  /// everything before it.
  void set_most_misses(int count) { most_misses_ = count; }
  /// Returns how often this has happened.
  [[nodiscard]] std::int64_t restarts() const { return restarts_; }

  /// Returns the memory in use, in bytes, as estimated by Solver::create, including the solution it keeps.
  [[nodiscard]] std::int64_t memory_bytes() const;
  /// Returns the time of scaling, ordering, analysis and allocation. Solutions do not contain it.
  [[nodiscard]] double setup_s() const { return setup_s_; }

 private:
  WarmSolver(Solver solver, const PartSizes& sizes, double setup_s, std::span<const double> initial_z);
  [[nodiscard]] Expected<void> take(const CheckedUpdate& update);
  void begin_at(const Restart& restart);
  void take_answer(Solution& solution);

  Solver solver_;
  PartSizes sizes_;
  double setup_s_;
  std::vector<double> initial_z_;   // where a cold start begins
  bool start_is_new_;               // no solve has started from it yet
  std::optional<Solution> newest_;  // the newest solved solution, the next start
  int misses_ = 0;                  // consecutive solves that ended early
  int most_misses_ = 20;
  std::int64_t restarts_ = 0;
};

}  // namespace marble
