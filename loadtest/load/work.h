// Describes one request of a run, and its reply.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "marble/v1/solution.pb.h"

namespace marble::load {

using Clock = std::chrono::steady_clock;

struct Work {
  std::size_t entry = 0;       ///< of the scenario
  std::size_t variant = 0;     ///< of the entry
  std::size_t client = 0;      ///< whose connection and session it uses
  bool measured = false;       ///< not part of the warm-up
  bool checked = false;        ///< its solution is to be checked
  Clock::time_point intended;  ///< intended send time: latency counts from here
  Clock::time_point sent;      ///< actual send time
};

struct Reply {
  std::string error;  ///< code of an RPC error, such as "resource_exhausted"; empty for a result
  std::string error_message;
  bool retry_info = false;                               ///< the error came with RetryInfo
  v1::Solution solution;                                 ///< undefined with an error
  std::int64_t progress_rows = 0, progress_skipped = 0;  ///< streamed: received, and dropped by the server
};

/// Called once per request, on any thread.
using Done = std::function<void(const Work&, Reply&&)>;

/// Sends requests. Any thread may call send().
class Lane {
 public:
  virtual ~Lane() = default;
  virtual void send(const Work& work) = 0;
  virtual void cancel() = 0;  ///< cancels what has no result: it ends soon, as cancelled
};

}  // namespace marble::load
