// One problem again and again: each solve starts from the last answer. A planner's loop, without a server.
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

/// What one solve of a sequence takes, checked once: a WarmSolver of its sizes looks at none of it again.
/// Borrows its arrays.
class CheckedUpdate {
 public:
  /// Errors: invalid_argument, as PartSizes::check and Restart::check name the fields.
  [[nodiscard]] static Expected<CheckedUpdate> check(const PartSizes& sizes, const ProblemUpdate& numbers,
                                                     Restart restart = {});
  /// Of parts that have passed their own checks before, all for these sizes, and of valid options: for who
  /// puts such parts together.
  [[nodiscard]] static CheckedUpdate of_checked(const PartSizes& sizes, const ProblemUpdate& numbers,
                                                Restart restart, const Options& options);

  /// Of the problem it was checked for.
  [[nodiscard]] const PartSizes& sizes() const { return sizes_; }
  /// What changes.
  [[nodiscard]] const ProblemUpdate& numbers() const { return numbers_; }
  /// How the solve starts.
  [[nodiscard]] const Restart& restart() const { return restart_; }
  /// For this solve and those to come; those in force stay if there are none.
  [[nodiscard]] const std::optional<Options>& options() const { return options_; }

 private:
  CheckedUpdate(const PartSizes& sizes, const ProblemUpdate& numbers, Restart restart)
      : sizes_(sizes), numbers_(numbers), restart_(std::move(restart)) {}

  PartSizes sizes_;
  ProblemUpdate numbers_;
  Restart restart_;
  std::optional<Options> options_;
};

/// A Solver that remembers the newest answer that was solved. What a session is on the server, and what it is
/// in process: the same updates give the same answers, to the last bit. One thread at a time.
///
/// A solve that is cut off, by its time limit or its stop token, is answered with its best point, or with the
/// last solution where only that is feasible (`origin`). The next solve goes on where it was, with the
/// numbers of then, unless its Restart says where to begin. After a number of such in a row the next one is
/// cold.
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
  /// The same of what was checked before. Errors: failed_precondition if it was for other sizes.
  [[nodiscard]] Expected<Solution> solve(const CheckedUpdate& update, const SolveControls& controls = {});

  /// The first part of a solve: takes the new numbers and how it starts, and factorizes for the branch that
  /// it will begin on. The solve() that follows brings the rest and gives the answer of one solve() of both,
  /// to the last bit, sooner: most if what it brings are vectors that leave the branch's rows as they are,
  /// such as b. Of `controls` only stop counts. Errors: as solve(); nothing has changed then.
  [[nodiscard]] Expected<void> prepare(const ProblemUpdate& update, const Restart& restart = {},
                                       const SolveControls& controls = {});
  /// The same of what was checked before.
  [[nodiscard]] Expected<void> prepare(const CheckedUpdate& update, const SolveControls& controls = {});

  /// Other options for solves to come; scaling_passes stays as it was set up. Options must be valid, without
  /// explain.
  [[nodiscard]] Expected<void> set_options(const Options& options) {
    if (auto valid = validate_without_explain(options); !valid) return valid;
    return solver_.set_options(options);
  }

  /// After so many solves in a row that were cut off, >= 1, the next one forgets all before it.
  void set_most_misses(int count) { most_misses_ = count; }
  /// How often it has.
  [[nodiscard]] std::int64_t restarts() const { return restarts_; }

  /// With the answer it keeps, in bytes, by the estimate of Solver::create.
  [[nodiscard]] std::int64_t memory_bytes() const;
  /// Scaling, ordering, analysis and allocation took this long. Answers tell it no more.
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
  bool start_is_new_;               // no solve has begun with it yet
  std::optional<Solution> newest_;  // that was solved, to start from
  int misses_ = 0;                  // solves in a row that were cut off
  int most_misses_ = 20;
  std::int64_t restarts_ = 0;
};

}  // namespace marble
