// Solves subproblems with core alone, for programs without the client's library, such as the wheel's
// extension.
#include <algorithm>
#include <chrono>

#include "marble/nonlinear.h"
#include "marble/warm_solver.h"

namespace marble::nonlinear {
namespace {

class WarmTicks final : public Ticks {
 public:
  WarmTicks(WarmSolver solver, const Settings& settings)
      : solver_(std::move(solver)), options_(settings.lcqp), stop_(settings.stop) {}

  Expected<Solution> solve(const ProblemUpdate& update, const TickControls& controls) override {
    Options options = options_;
    options.time_limit_s = std::min(options_.time_limit_s, controls.deadline_s);
    if (auto set = solver_.set_options(options); !set) return unexpected(set.error());
    return solver_.solve(update, {controls.initial_z, controls.cold, controls.shift},
                         {.progress = controls.progress, .stop = stop_});
  }

  Expected<bool> prepare(const ProblemUpdate& update, const TickControls& controls) override {
    if (auto set = solver_.set_options(options_); !set) return unexpected(set.error());
    auto prepared =
        solver_.prepare(update, {controls.initial_z, controls.cold, controls.shift}, {.stop = stop_});
    if (!prepared) return unexpected(prepared.error());
    return true;
  }

 private:
  WarmSolver solver_;
  Options options_;
  std::stop_token stop_;
};

}  // namespace

Expected<std::unique_ptr<Ticks>> open_ticks_in_process(const ProblemView& view, const Settings& settings) {
  const auto problem = marble::Problem::create(view);
  if (!problem) return unexpected(problem.error());
  auto solver = WarmSolver::create(*problem, settings.lcqp);
  if (!solver) return unexpected(solver.error());
  return std::make_unique<WarmTicks>(std::move(*solver), settings);
}

}  // namespace marble::nonlinear
