// Runs a solve in its own thread.
#include <functional>
#include <new>
#include <optional>
#include <stop_token>
#include <thread>

#include "in_process/in_process.h"
#include "marble/convert.h"
#include "message/status.h"
#include "pending_solve.h"

namespace marble::client {
namespace {

class InProcessPending final : public PendingSolution::State {
 public:
  InProcessPending(const SolveControls& controls, CallControls call)
      : controls_(controls),
        call_(std::move(call)),
        deadline_(call_.deadline),
        progress_(controls.progress, call_.progress_interval_s, call_.iterate_every),
        stop_with_caller_(controls.stop, [this] { stop_.request_stop(); }) {}

  // The solver copies the problem; afterwards its arrays belong to the caller again.
  [[nodiscard]] Expected<void> begin(const ProblemView& view, const Options& options) {
    MARBLE_ASSIGN_OR_RETURN(const auto problem, Problem::create(view));
    MARBLE_RETURN_IF_ERROR(Problem::check_initial_point(controls_.initial_z, problem.variables()));
    if (controls_.warm_start != nullptr) {
      MARBLE_RETURN_IF_ERROR(check_warm_start(*controls_.warm_start, PartSizes::of(problem)));
      controls_.warm_start = &warm_start_.emplace(*controls_.warm_start);
    }
    if (controls_.sensitivity != nullptr) {
      if (auto valid = check(*controls_.sensitivity, PartSizes::of(problem)); !valid)
        return unexpected(inside("sensitivity", valid.error()));
      marble::to_message(*controls_.sensitivity, &sensitivity_copy_);
      controls_.sensitivity = &sensitivity_.emplace(request_of(sensitivity_copy_));
    }
    options_ = deadline_.limit(options);
    MARBLE_ASSIGN_OR_RETURN(auto solver, Solver::create(problem, options_));
    if (options.explain) {  // explain reads the problem after the solve
      marble::to_message(view, &problem_copy_);
      MARBLE_ASSIGN_OR_RETURN(auto copy, Problem::create(view_of(problem_copy_)));
      problem_.emplace(copy);
    } else {
      solver_ = std::move(solver);
    }
    initial_z_.assign(controls_.initial_z.begin(), controls_.initial_z.end());
    controls_.initial_z = initial_z_;
    controls_.progress = progress_.sink();
    controls_.stop = stop_.get_token();
    thread_ = std::jthread([this] { run(); });
    return {};
  }

  void cancel() override { stop_.request_stop(); }
  Expected<RemoteSolution> answer() override { return std::move(answer_); }

 private:
  void run() {
    if (call_.started) call_.started(0.0);
    answer_ = or_out_of_memory([&] {
      return deadline_.answer(problem_ ? solve_once(*problem_, options_, controls_)
                                       : solver_->solve(controls_));
    });
    end();
  }

  SolveControls controls_;
  const CallControls call_;
  DeadlineLimit deadline_;
  ThinnedProgress progress_;
  std::stop_source stop_;
  std::stop_callback<std::function<void()>> stop_with_caller_;
  Options options_;
  std::optional<Solver> solver_;
  v1::Problem problem_copy_;
  std::optional<Problem> problem_;  // views the copy
  std::vector<double> initial_z_;
  std::optional<Solution> warm_start_;
  v1::SensitivityRequest sensitivity_copy_;
  std::optional<SensitivityRequest> sensitivity_;  // views the copy
  Expected<RemoteSolution> answer_;
  std::jthread thread_;  // the last member: it uses the others
};

}  // namespace

Expected<PendingSolution> begin_solve_locally(const ProblemView& problem, const Options& options,
                                              const SolveControls& controls, const CallControls& call) {
  MARBLE_RETURN_IF_ERROR(validate(options));
  auto state = std::make_unique<InProcessPending>(controls, call);
  MARBLE_RETURN_IF_ERROR(state->begin(problem, options));
  return PendingSolution(std::move(state));
}

}  // namespace marble::client
