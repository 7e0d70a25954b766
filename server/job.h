// One admitted request on its way through queue and worker.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <stop_token>
#include <string>

#include "marble/options.h"
#include "marble/problem.h"
#include "marble/progress.h"
#include "marble/solution.h"

namespace marble::server {

using Clock = std::chrono::steady_clock;

/// How a job ended: an answer, whatever its status, or why there is none.
struct Outcome {
  Expected<Solution> solution = unexpected(Error{});
  double queue_s = 0.0;
  double total_s = 0.0;
};

/// What a job tells to the one who waits for it. Called by one worker at a time; finished() exactly once, as
/// the last.
class JobObserver {
 public:
  virtual ~JobObserver() = default;
  virtual void started(double /*queue_s*/) {}
  /// Where progress goes; null if nobody looks, and then it costs nothing.
  virtual ProgressSink* progress() { return nullptr; }
  virtual void finished(Outcome outcome) = 0;
};

/// The request's message and the observer belong to the RPC and outlive the job's way to finished().
struct Job {
  std::string id;
  std::string request_id, name, peer;  ///< as the client gave them; for logs
  Problem problem;                     ///< borrows the request's arrays
  Options options;
  std::span<const double> initial_z;
  std::int64_t bytes = 0;  ///< size of the request
  Clock::time_point deadline = Clock::time_point::max();
  Clock::time_point accepted = Clock::now();
  JobObserver* observer = nullptr;
  std::stop_source stop = {};
};

}  // namespace marble::server
