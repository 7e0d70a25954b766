// Solves subproblems in sessions of a client: in process or on its server.
#include <chrono>

#include "marble/client.h"
#include "marble/real_time.h"
#include "marble/retrospective.h"

namespace marble::nonlinear {
namespace {

constexpr double kForever = 1e8;  // seconds: no deadline is sent

class SessionTicks final : public Ticks {
 public:
  explicit SessionTicks(Session session) : session_(std::move(session)) {}

  Expected<Solution> solve(const ProblemUpdate& update, const TickControls& controls) override {
    MARBLE_ASSIGN_OR_RETURN(auto answer, session_.solve(update, of_session(controls)));
    reopened_ += answer.reopened ? 1 : 0;
    return Solution(std::move(answer));
  }

  Expected<bool> prepare(const ProblemUpdate& update, const TickControls& controls) override {
    MARBLE_RETURN_IF_ERROR(session_.prepare(update, of_session(controls)));
    return true;
  }

  [[nodiscard]] std::int32_t reopened() const override { return reopened_; }

 private:
  [[nodiscard]] static UpdateControls of_session(const TickControls& controls) {
    UpdateControls tick{.initial_z = controls.initial_z,
                        .cold = controls.cold,
                        .shift = controls.shift,
                        .progress = controls.progress};
    if (controls.deadline_s < kForever) tick.deadline = std::chrono::duration<double>(controls.deadline_s);
    return tick;
  }

  Session session_;
  std::int32_t reopened_ = 0;
};

OpenTicks sessions_of(const Client& client) {
  return [&client](const ProblemView& view, const Settings& of) -> Expected<std::unique_ptr<Ticks>> {
    SessionOptions wanted;
    wanted.progress = of.progress != nullptr, wanted.stop = of.stop, wanted.reopen = of.reopen;
    MARBLE_ASSIGN_OR_RETURN(auto session, client.open_session(view, of.lcqp, wanted));
    return std::make_unique<SessionTicks>(std::move(session));
  };
}

}  // namespace

Expected<Answer> solve(const Problem& problem, const Client& client, const Settings& settings) {
  return solve(problem, sessions_of(client), settings);
}

Expected<RetrospectiveAnswer> solve_retrospective(const SampledProblem& sampled, const Client& client,
                                                  const RetrospectiveSettings& settings) {
  return solve_retrospective(sampled, sessions_of(client), settings);
}

Expected<RealTime> RealTime::create(const Problem& problem, const Measured& measured, const Client& client,
                                    const RealTimeSettings& settings) {
  return create(problem, measured, sessions_of(client), settings);
}

}  // namespace marble::nonlinear
