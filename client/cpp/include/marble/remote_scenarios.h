// Provides the result of Client::solve_scenarios: one plan for many scenarios, solved by a server.
#pragma once

#include <cstdint>
#include <string>

#include "marble/composite/scenario_samples.h"
#include "marble/composite/scenarios.h"

namespace marble {

/// A plan with what the server adds to it.
struct RemoteScenarios : ScenarioSolution {
  std::string job_id;                 ///< as in the server's log; empty if it was solved in process
  double queue_s = 0.0;               ///< waiting for a worker
  double total_s = 0.0;               ///< from acceptance to the solution, on the server
  std::int64_t progress_skipped = 0;  ///< reports that were dropped because the network was slower
  std::string traceparent = {};       ///< the server's span in the caller's trace; empty if none was sent
};

}  // namespace marble
