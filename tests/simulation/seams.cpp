#include "seams.h"

#include <algorithm>
#include <cstdio>
#include <thread>

#include "marble/solver.h"

namespace marble::simulation {

Seams& seams() {
  static Seams all;
  return all;
}

namespace {

constexpr Duration kLook = std::chrono::milliseconds(50);  // how often a solve looks at its stop token

void spend(const SolveControls& controls) {
  const Duration time = seams().solve_time();
  Duration spent(0);
  while (spent < time && !controls.stop.stop_requested()) {
    const Duration step = std::min(time - spent, kLook);
    std::this_thread::sleep_for(step);
    spent += step;
    if (controls.pause != nullptr) controls.pause->look();
  }
}

}  // namespace
}  // namespace marble::simulation

// The names as the compiler has them: marble::solve_once, marble::server::fault_point,
// marble::server::random_id.
#define SOLVE_ONCE                                                                \
  "_ZN6marble10solve_onceERKNS_7ProblemERKNS_7OptionsERKNS_13SolveControlsERKNS_" \
  "13SetupControlsERKSt8functionI"                                                \
  "FvRKNS_6SolverEEE"
#define FAULT_POINT "_ZN6marble6server11fault_pointESt17basic_string_viewIcSt11char_traitsIcEES4_"
#define RANDOM_ID "_ZN6marble6server9random_idB5cxx11Ev"

using namespace marble;
using Report = std::function<void(const Solver&)>;

Expected<Solution> real_solve_once(const Problem&, const Options&, const SolveControls&, const SetupControls&,
                                   const Report&) asm("__real_" SOLVE_ONCE);
Expected<Solution> solve_in_time(const Problem&, const Options&, const SolveControls&, const SetupControls&,
                                 const Report&) asm("__wrap_" SOLVE_ONCE);
void simulated_fault_point(std::string_view, std::string_view) asm("__wrap_" FAULT_POINT);
std::string simulated_id() asm("__wrap_" RANDOM_ID);

Expected<Solution> solve_in_time(const Problem& problem, const Options& options,
                                 const SolveControls& controls, const SetupControls& limits,
                                 const Report& report) {
  simulation::spend(controls);
  return real_solve_once(problem, options, controls, limits, report);
}

void simulated_fault_point(std::string_view name, std::string_view subject) {
  if (simulation::seams().fault_point) simulation::seams().fault_point(name, subject);
}

std::string simulated_id() {
  char text[17];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(simulation::draw()));
  return text;
}
