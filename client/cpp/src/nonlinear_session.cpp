// Subproblems by sessions of a client: here or on its server.
#include <chrono>

#include "marble/client.h"
#include "marble/retrospective.h"

namespace marble::nonlinear {
namespace {

constexpr double kForever = 1e8;  // seconds: no deadline is sent

class SessionTicks final : public Ticks {
 public:
  explicit SessionTicks(Session session) : session_(std::move(session)) {}

  Expected<Solution> solve(const ProblemUpdate& update, const TickControls& controls) override {
    UpdateControls tick{.cold = controls.cold, .progress = controls.progress};
    if (controls.deadline_s < kForever) tick.deadline = std::chrono::duration<double>(controls.deadline_s);
    auto answer = session_.solve(update, tick);
    if (!answer) return unexpected(std::move(answer.error()));
    return Solution(std::move(*answer));
  }

 private:
  Session session_;
};

OpenTicks sessions_of(const Client& client) {
  return [&client](const ProblemView& view, const Settings& of) -> Expected<std::unique_ptr<Ticks>> {
    auto session = client.open_session(view, of.lcqp, {.progress = of.progress != nullptr, .stop = of.stop});
    if (!session) return unexpected(std::move(session.error()));
    return std::make_unique<SessionTicks>(std::move(*session));
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

}  // namespace marble::nonlinear
