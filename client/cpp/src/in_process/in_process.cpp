#include "in_process/in_process.h"

#include <algorithm>
#include <limits>
#include <new>

#include "message/status.h"

namespace marble::client {

using Clock = std::chrono::steady_clock;

DeadlineLimit::DeadlineLimit(std::optional<std::chrono::duration<double>> from_now)
    : begin_(Clock::now()),
      seconds_(from_now ? std::max(from_now->count(), 0.0) : std::numeric_limits<double>::infinity()) {}

double DeadlineLimit::left_s() const {
  return seconds_ - std::chrono::duration<double>(Clock::now() - begin_).count();
}

Options DeadlineLimit::limit(Options options) const {
  options.time_limit_s = std::clamp(left_s(), 0.0, options.time_limit_s);
  return options;
}

Expected<RemoteSolution> DeadlineLimit::answer(Expected<Solution> solution) const {
  if (!solution) return unexpected(std::move(solution.error()));
  if (solution->status == Status::cancelled) return unexpected(given_up());
  if (!(left_s() > 0.0)) {
    return unexpected(
        failure(ErrorCode::deadline_exceeded, "the deadline passed while the problem was solved"));
  }
  return answer_of_session(std::move(solution));
}

Expected<RemoteSolution> DeadlineLimit::answer_of_session(Expected<Solution> solution) const {
  if (!solution) return unexpected(std::move(solution.error()));
  if (solution->status == Status::cancelled) return unexpected(given_up());
  RemoteSolution answer;
  static_cast<Solution&>(answer) = std::move(*solution);
  answer.total_s = std::chrono::duration<double>(Clock::now() - begin_).count();
  return answer;
}

void ThinnedProgress::report(const Progress& progress) {
  if (last_s_ >= 0.0 && progress.elapsed_s - last_s_ < interval_s_) return;
  last_s_ = progress.elapsed_s;
  Progress reported = without_vectors(progress);
  if (iterate_every_ > 0 && progress.iteration % iterate_every_ == 0) reported.z = progress.z;
  sink_->report(reported);
}

Expected<RemoteSolution> solve_locally(const ProblemView& problem, const Options& options,
                                       const SolveControls& controls, const CallControls& call) {
  if (auto valid = validate(options); !valid) return unexpected(valid.error());
  const DeadlineLimit deadline(call.deadline);
  ThinnedProgress progress(controls.progress, call.progress_interval_s, call.iterate_every);
  if (call.started) call.started(0.0);
  SolveControls own = controls;
  own.progress = progress.sink();
  return deadline.answer(solve_in_process(problem, deadline.limit(options), own));
}

Expected<void> solve_batch_locally(const BatchSource& source, const BatchSink& sink,
                                   const BatchControls& controls) {
  while (!controls.stop.stop_requested()) {
    const std::optional<BatchProblem> p = source();
    if (!p) return {};
    CallControls call;
    call.problem_name = p->problem_name;
    sink(p->tag,
         solve_locally(p->problem, p->options,
                       {.stop = controls.stop, .initial_z = p->initial_z, .sensitivity = p->sensitivity},
                       call));
  }
  return unexpected(given_up());
}

}  // namespace marble::client
