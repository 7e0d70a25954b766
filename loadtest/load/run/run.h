// One measurement: warm-up, requests, answers, and what they were like.
#pragma once

#include <functional>
#include <stop_token>

#include "lane/load_target.h"
#include "marble/client.h"
#include "measure/result.h"
#include "plan/workload.h"

namespace marble::load {

struct RunParts {
  const Target& target;
  const Client& server;  ///< on a connection of its own, for the server's counters
  const std::vector<LoadedEntry>& entries;
  std::function<void(const Second&)> told;  ///< after every second; may be empty
};

/// Errors are of what did not run: the server is away, a session was refused. What happens to requests is in
/// the result. A stop ends it early, with the result so far.
[[nodiscard]] Expected<RunResult> run(const RunParts& parts, const Plan& plan, const std::stop_token& stop);

}  // namespace marble::load
