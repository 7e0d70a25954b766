// One admitted request on its way through queue and worker.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <span>
#include <stop_token>
#include <string>

#include "marble/options.h"
#include "marble/problem.h"
#include "marble/progress.h"
#include "marble/solution.h"
#include "marble/v1/service.pb.h"

namespace marble::server {

using Clock = std::chrono::steady_clock;

constexpr std::size_t kLongestRequestId = 128;  // bytes
constexpr std::size_t kLongestName = 256;       // bytes

/// How a job ended: an answer, whatever its status, or why there is none.
struct Outcome {
  Expected<Solution> solution = unexpected(Error{});
  double queue_s = 0.0;
  double total_s = 0.0;
  double retry_delay_s = 0.0;  ///< for errors that say "try again"
};

/// The error of a job that needs more memory than there is.
[[nodiscard]] inline Error out_of_memory() {
  return {ErrorCode::resource_exhausted, "problem", -1, "", "does not fit the server's memory"};
}

/// Who waits for a job. Called by one thread at a time; finished() exactly once, as the last.
class JobObserver {
 public:
  virtual ~JobObserver() = default;
  /// A worker took the job.
  virtual void started(double /*queue_s*/) {}
  /// Where progress goes; null if nobody looks, and then it costs nothing.
  virtual ProgressSink* progress() { return nullptr; }
  virtual void finished(Outcome outcome) = 0;
};

struct Job {
  std::string id;
  std::string request_id, name, peer;  ///< as the client gave them; for logs
  std::shared_ptr<const v1::SolveRequest>
      request;  ///< what `problem` and `initial_z` borrow; freed at the end
  Problem problem;
  Options options;
  std::span<const double> initial_z;
  std::int64_t bytes = 0;  ///< size of the request
  Clock::time_point deadline = Clock::time_point::max();
  Clock::time_point accepted = Clock::now();
  std::shared_ptr<JobObserver> observer = nullptr;  ///< let go after finished()
  std::stop_source stop = {};
};

}  // namespace marble::server
