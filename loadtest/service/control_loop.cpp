#include "control_loop.h"

#include <algorithm>
#include <thread>

#include "marble/convert.h"

namespace marble::bench {
namespace {

examples::HopperParameters of_stages(int stages) {
  examples::HopperParameters parameters;
  parameters.steps = stages;
  return parameters;
}

}  // namespace

ControlLoop::ControlLoop(const std::string& address, int stages, v1::Priority priority,
                         const std::string& client)
    : parameters_(of_stages(stages)),
      session_(connect(address), setup_of(examples::hopper(parameters_), priority), client),
      plan_(solution_of(session_.solve({}))) {}

ControlLoop::Steps ControlLoop::run(int count) {
  Steps steps;
  auto next = Clock::now();
  for (int k = 0; k < count; ++k) {
    parameters_ = examples::advance(parameters_, plan_.z);
    const OwnedProblem problem = examples::hopper(parameters_);
    const v1::SessionUpdate update = next_tick(problem, parameters_.steps);
    next = std::max(next + kPeriod, Clock::now());
    std::this_thread::sleep_until(next);
    const auto sent = Clock::now();
    const v1::Solution answer = session_.solve(update);
    steps.latency_ms.push_back(ms_since(sent));
    const bool right = is_right(problem, answer);
    steps.wrong += right ? 0 : 1;
    if (right) plan_ = solution_of(answer);
  }
  return steps;
}

}  // namespace marble::bench
