// One request of a run, and what came of it.
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
  std::size_t client = 0;      ///< whose connection and whose session it takes
  bool measured = false;       ///< not a part of the warm-up
  bool checked = false;        ///< its answer is to be checked
  Clock::time_point intended;  ///< when it should have been sent: latency counts from here
  Clock::time_point sent;      ///< when it was
};

struct Reply {
  std::string error;  ///< code of an RPC error as in "resource_exhausted"; empty for an answer
  std::string error_message;
  bool retry_info = false;                               ///< the error came with RetryInfo
  v1::Solution solution;                                 ///< meaningless with an error
  std::int64_t progress_rows = 0, progress_skipped = 0;  ///< streamed: told, and dropped by the server
};

/// Called once a request, on any thread.
using Done = std::function<void(const Work&, Reply&&)>;

/// A way to send requests. send() may be called by any threads.
class Lane {
 public:
  virtual ~Lane() = default;
  virtual void send(const Work& work) = 0;
  virtual void cancel() = 0;  ///< gives up what is not answered: it is done soon, as cancelled
};

}  // namespace marble::load
