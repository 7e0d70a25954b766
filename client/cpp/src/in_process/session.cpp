// Provides a session without a server: the same warm solver, in the caller's thread.
#include <deque>

#include "in_process/in_process.h"
#include "marble/warm_solver.h"
#include "session_state.h"

namespace marble::client {
namespace {

// Solves each update at once, so that none ever waits or is superseded.
class InProcessSession final : public Session::State {
 public:
  InProcessSession(WarmSolver solver, const Options& options, const SessionOptions& session)
      : solver_(std::move(solver)),
        options_(options),
        reports_(session.progress),
        interval_s_(session.progress_interval_s),
        iterate_every_(session.iterate_every),
        stop_(session.stop) {
    memory_bytes = solver_.memory_bytes();
    setup_s = solver_.setup_s();
  }

  Expected<RemoteSolution> solve(const ProblemUpdate& update, const UpdateControls& controls) override {
    if (!is_open()) return unexpected(reason());
    MARBLE_RETURN_IF_ERROR(take(controls.options));
    ++sequence_;
    const DeadlineLimit deadline(controls.deadline);
    ThinnedProgress progress(reports_ ? controls.progress : nullptr, interval_s_, iterate_every_);
    MARBLE_RETURN_IF_ERROR(solver_.set_options(deadline.limit(options_)));
    return deadline.answer_of_session(
        solver_.solve(update, {controls.initial_z, controls.cold, controls.shift},
                      {.progress = progress.sink(), .stop = stop_, .sensitivity = controls.sensitivity}));
  }

  Expected<std::int64_t> prepare(const ProblemUpdate& update, const UpdateControls& controls) override {
    if (!is_open()) return unexpected(reason());
    MARBLE_RETURN_IF_ERROR(take(controls.options));
    MARBLE_RETURN_IF_ERROR(solver_.set_options(options_));
    MARBLE_RETURN_IF_ERROR(
        solver_.prepare(update, {controls.initial_z, controls.cold, controls.shift}, {.stop = stop_}));
    return ++sequence_;
  }

  Expected<std::int64_t> send(const ProblemUpdate& update, const UpdateControls& controls) override {
    if (!is_open()) return unexpected(reason());
    auto answer = solve(update, controls);
    SessionEvent& event = unfetched_.emplace_back(SessionEvent{sequence_, Superseded{}});
    if (answer) {
      event.outcome = std::move(*answer);
    } else {
      event.outcome = std::move(answer.error());
    }
    return sequence_;
  }

  Expected<std::optional<SessionEvent>> next() override {
    if (!unfetched_.empty()) {
      std::optional<SessionEvent> event = std::move(unfetched_.front());
      unfetched_.pop_front();
      return event;
    }
    if (stop_.stop_requested()) return unexpected(reason());
    return std::nullopt;
  }

  Expected<void> close() override {
    closed_ = true;
    return {};
  }

  [[nodiscard]] bool is_open() const override { return !closed_ && !stop_.stop_requested(); }

 private:
  [[nodiscard]] Expected<void> take(const std::optional<Options>& options) {
    if (!options) return {};
    MARBLE_RETURN_IF_ERROR(validate_without_explain(*options));
    options_ = *options;
    return {};
  }
  [[nodiscard]] Error reason() const { return closed_ ? session_ended() : given_up(); }

  WarmSolver solver_;
  Options options_;
  bool reports_;
  double interval_s_;
  std::int32_t iterate_every_;
  std::stop_token stop_;
  std::int64_t sequence_ = 0;
  bool closed_ = false;
  std::deque<SessionEvent> unfetched_;
};

}  // namespace

Expected<std::unique_ptr<Session::State>> open_session_in_process(const ProblemView& view,
                                                                  const Options& options,
                                                                  const SessionOptions& session) {
  MARBLE_ASSIGN_OR_RETURN(const auto problem, Problem::create(view));
  MARBLE_ASSIGN_OR_RETURN(auto solver, WarmSolver::create(problem, options, session.initial_z));
  return std::make_unique<InProcessSession>(std::move(solver), options, session);
}

}  // namespace marble::client
