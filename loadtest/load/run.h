// Runs one measurement: warm-up, requests, and their results.
#pragma once

#include <functional>
#include <stop_token>

#include "load_target.h"
#include "marble/client.h"
#include "result.h"
#include "workload.h"

namespace marble::load {

struct RunParts {
  const Target& target;
  const Client& server;  ///< on a separate connection, for the server's counters
  const std::vector<LoadedEntry>& entries;
  std::function<void(const Second&)> reported;  ///< called after every second; may be empty
};

/// Errors are those of a run that did not start: the server is unreachable, a session was refused. Failed
/// requests are in the result. A stop ends it early, with the result so far.
[[nodiscard]] Expected<RunResult> run(const RunParts& parts, const Plan& plan, const std::stop_token& stop);

}  // namespace marble::load
