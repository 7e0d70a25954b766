// Many independent problems: on one stream, answered as they finish; or as one job on a server, for more than
// a client may wait for (Jobs::submit_array and Jobs::array).
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
#include "marble/solution.h"

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

/// One problem of an array.
struct ArrayElement {
  /// One of its own; or nothing: the base problem with the numbers of `update`.
  std::optional<ProblemView> problem = {};
  ProblemUpdate update = {};               ///< of the base problem; what is absent stays
  std::optional<Options> options = {};     ///< its own; nothing: those of the array
  std::span<const double> initial_z = {};  ///< n or empty
  const Solution* warm_start = nullptr;    ///< an answer of these sizes to start from, or none
  /// Derivatives of its answer that are wanted with it, or none.
  const SensitivityRequest* sensitivity = nullptr;
  std::string problem_name = {};  ///< of one with a problem of its own; shortened to 256 bytes
};

/// Gives one element after the other, then nothing. Called on the thread that submits; the arrays must live
/// until the next call. Must not throw.
using ArraySource = std::function<std::optional<ArrayElement>()>;

/// What holds for an array as a whole; all of it optional.
struct ArrayControls {
  const Problem* base = nullptr;            ///< the base problem, or none
  Options options = {};                     ///< of all elements
  Priority priority = Priority::by_method;  ///< of all elements; by_method is batch
  std::string name = {};                    ///< for the server's log and page; shortened to 256 bytes
  /// At most 128 bytes of printable ASCII: the same array sent again by its id is the same job. A random one
  /// without.
  std::string request_id = {};
  std::optional<std::chrono::duration<double>> deadline = {};  ///< of the submission alone
  std::stop_token stop = {};                                   ///< gives the submission up
};

/// An array that was taken.
struct SubmittedArray {
  std::string job_id;         ///< to ask for it by
  std::int64_t elements = 0;  ///< how many it has
};

/// The answer to one element.
struct ArrayAnswer {
  std::int64_t index = 0;           ///< its position in the array, from 0
  std::int64_t sequence = 0;        ///< of the answer among the array's, from 1; it stays
  Expected<RemoteSolution> answer;  ///< or why there is none
};

/// Takes an answer, on the thread that called Jobs::array. Must not throw.
using ArraySink = std::function<void(ArrayAnswer answer)>;

/// How to be told of answers.
struct ArrayReading {
  std::int64_t after = 0;     ///< only answers after this one: the largest sequence that was received before
  std::stop_token stop = {};  ///< ends the reading with `cancelled`, not the array
};

}  // namespace marble
