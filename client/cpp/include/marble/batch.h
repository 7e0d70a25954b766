// Many independent problems on one stream, answered as they finish.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <stop_token>
#include <string>

#include "marble/call_controls.h"
#include "marble/error.h"
#include "marble/options.h"
#include "marble/problem.h"
#include "marble/sensitivity.h"

namespace marble {

/// One problem of many.
struct BatchProblem {
  std::int64_t tag = 0;                    ///< comes back with the answer
  ProblemView problem;                     ///< as Client::solve has it
  Options options = {};                    ///< of this problem
  std::span<const double> initial_z = {};  ///< n or empty
  std::string problem_name = {};           ///< shortened to 256 bytes
  std::string request_id = {};             ///< at most 128 bytes of printable ASCII
  /// Derivatives of its answer that are wanted with it, or none.
  const SensitivityRequest* sensitivity = nullptr;
};

/// Gives one problem after the other, then nothing. Called on a thread of the batch's own; the arrays must
/// live until the next call.
using BatchSource = std::function<std::optional<BatchProblem>()>;

/// Takes an answer, on the thread that called solve_batch, in the order of finishing. Must not throw, nor may
/// the source.
using BatchSink = std::function<void(std::int64_t tag, Expected<RemoteSolution> answer)>;

/// What holds for a batch as a whole; all of it optional.
struct BatchControls {
  Priority priority = Priority::by_method;  ///< of every problem
  std::stop_token stop = {};                ///< gives all of it up
  std::string traceparent = {};             ///< as CallControls has it, of the whole stream
  /// For how long a server that is lost is waited for, seconds >= 0 from the loss on: the batch goes on at
  /// the next one, or at the same one once it is back, with what has no answer yet; each problem is answered
  /// once. Then the rest is `unavailable`. Without it 10 s, and less than one while no server has ever
  /// answered this client. In process it does nothing.
  std::optional<std::chrono::duration<double>> wait = {};
};

}  // namespace marble
