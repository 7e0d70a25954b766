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
    MARBLE_RETURN_IF_ERROR(solver_.set_options(options));
    return solver_.solve(update, {controls.initial_z, controls.cold, controls.shift},
                         {.progress = controls.progress, .stop = stop_});
  }

  Expected<bool> prepare(const ProblemUpdate& update, const TickControls& controls) override {
    MARBLE_RETURN_IF_ERROR(solver_.set_options(options_));
    MARBLE_RETURN_IF_ERROR(
        solver_.prepare(update, {controls.initial_z, controls.cold, controls.shift}, {.stop = stop_}));
    return true;
  }

 private:
  WarmSolver solver_;
  Options options_;
  std::stop_token stop_;
};

}  // namespace

Expected<std::unique_ptr<Ticks>> open_ticks_in_process(const ProblemView& view, const Settings& settings) {
  MARBLE_ASSIGN_OR_RETURN(const auto problem, marble::Problem::create(view));
  MARBLE_ASSIGN_OR_RETURN(auto solver, WarmSolver::create(problem, settings.lcqp));
  return std::make_unique<WarmTicks>(std::move(solver), settings);
}

}  // namespace marble::nonlinear
