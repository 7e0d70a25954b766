#include "marble/warm_solver.h"

#include <chrono>
#include <utility>

namespace marble {

Expected<CheckedUpdate> CheckedUpdate::check(const PartSizes& sizes, const ProblemUpdate& numbers,
                                             Restart restart) {
  MARBLE_RETURN_IF_ERROR(restart.check(sizes));
  MARBLE_RETURN_IF_ERROR(sizes.check(numbers));
  return CheckedUpdate(sizes, numbers, std::move(restart));
}

CheckedUpdate CheckedUpdate::of_checked(const PartSizes& sizes, const ProblemUpdate& numbers, Restart restart,
                                        const Options& options) {
  CheckedUpdate update(sizes, numbers, std::move(restart));
  update.options_ = options;
  return update;
}

WarmSolver::WarmSolver(Solver solver, const PartSizes& sizes, double setup_s,
                       std::span<const double> initial_z)
    : solver_(std::move(solver)),
      sizes_(sizes),
      setup_s_(setup_s),
      initial_z_(initial_z.begin(), initial_z.end()),
      start_is_new_(!initial_z.empty()) {}

Expected<WarmSolver> WarmSolver::create(const Problem& problem, const Options& options,
                                        std::span<const double> initial_z, const SetupControls& controls) {
  MARBLE_RETURN_IF_ERROR(Problem::check_initial_point(initial_z, problem.variables()));
  MARBLE_RETURN_IF_ERROR(validate_without_explain(options));
  const auto begin = std::chrono::steady_clock::now();
  MARBLE_ASSIGN_OR_RETURN(auto solver, Solver::create(problem, options, controls));
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  return WarmSolver(std::move(solver), PartSizes::of(problem), took.count(), initial_z);
}

std::int64_t WarmSolver::memory_bytes() const {
  const std::size_t numbers = 3 * sizes_.g + sizes_.b + sizes_.d + 2 * sizes_.l;
  return solver_.memory_bytes() + static_cast<std::int64_t>(numbers * sizeof(double));
}

void WarmSolver::begin_at(const Restart& restart) {
  solver_.keep_tree();
  if (restart.cold || !restart.initial_z.empty()) solver_.forget_unfinished();
  if (restart.cold) newest_.reset();
  if (newest_) {
    solver_.shift_tree(restart.shift);
    if (!start_is_new_) shift(restart.shift.variables, newest_->z);  // else it is a start that was given
    shift(restart.shift.equalities, newest_->equality_multipliers);
    shift(restart.shift.inequalities, newest_->inequality_multipliers);
    shift(restart.shift.pairs, newest_->complementarity_multipliers_L);
    shift(restart.shift.pairs, newest_->complementarity_multipliers_R);
  }
  if (restart.initial_z.empty()) return;
  initial_z_.assign(restart.initial_z.begin(), restart.initial_z.end());
  start_is_new_ = true;
  if (newest_) newest_->z = initial_z_;
}

Expected<Solution> WarmSolver::solve(const ProblemUpdate& update, const Restart& restart,
                                     const SolveControls& controls) {
  const auto checked = CheckedUpdate::check(sizes_, update, restart);
  return checked ? solve(*checked, controls) : unexpected(checked.error());
}

Expected<void> WarmSolver::take(const CheckedUpdate& update) {
  if (update.sizes() != sizes_)
    return unexpected(
        failure(ErrorCode::failed_precondition, "the update is one of another problem's sizes"));
  if (update.options()) solver_.take(*update.options());
  solver_.take(update.numbers());
  begin_at(update.restart());
  return {};
}

Expected<void> WarmSolver::prepare(const ProblemUpdate& update, const Restart& restart,
                                   const SolveControls& controls) {
  const auto checked = CheckedUpdate::check(sizes_, update, restart);
  return checked ? prepare(*checked, controls) : unexpected(checked.error());
}

Expected<void> WarmSolver::prepare(const CheckedUpdate& update, const SolveControls& controls) {
  MARBLE_RETURN_IF_ERROR(take(update));
  if (newest_ && !solver_.is_unfinished())
    solver_.prepare(*newest_, {.stop = controls.stop, .pause = controls.pause});
  return {};
}

Expected<Solution> WarmSolver::solve(const CheckedUpdate& update, const SolveControls& controls) {
  if (controls.sensitivity != nullptr) {
    if (auto valid = check(*controls.sensitivity, sizes_); !valid)
      return unexpected(inside("sensitivity", valid.error()));
  }
  MARBLE_RETURN_IF_ERROR(take(update));
  // Not in prepare(): its numbers may be replaced before a solve, which must not depend on them.
  solver_.fit_scaling();
  SolveControls own = controls;
  own.initial_z = initial_z_;
  own.warm_start = newest_ ? &*newest_ : nullptr;
  MARBLE_ASSIGN_OR_RETURN(auto solution, solver_.solve(own, true, std::exchange(start_is_new_, false)));
  solution.times.setup_s = 0.0;
  take_answer(solution);
  return solution;
}

// Keeps what the next solve starts from: a solution, or the feasible point of a solve that was cut off in a
// later phase, such as the tree.
void WarmSolver::take_answer(Solution& solution) {
  const bool cut_off = solution.status == Status::time_limit || solution.status == Status::cancelled;
  if (!cut_off) solver_.forget_unfinished();  // max_iterations is the same for every solve
  const bool kept = cut_off && newest_ && solver_.take_better(*newest_, solution);
  if (kept) solution.detail = "the solution before it, which is feasible still; " + solution.detail;
  const bool is_start = is_solved(solution.status) ||
                        (cut_off && !kept && !solver_.is_unfinished() && solver_.is_feasible(solution));
  if (is_start) {
    auto sensitivity = std::exchange(solution.sensitivity, std::nullopt);  // not kept
    newest_ = solution;
    solution.sensitivity = std::move(sensitivity);
  }
  misses_ = cut_off ? misses_ + 1 : 0;
  if (misses_ < most_misses_) return;
  solver_.forget_unfinished();
  newest_.reset();
  misses_ = 0;
  ++restarts_;
}

}  // namespace marble
