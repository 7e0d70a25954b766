// Provides many independent problems in one call: on one stream, with results as they finish, or as one job
// on a server, for work that outlasts the client (Jobs::submit_array and Jobs::array).
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
  std::int64_t tag = 0;                    ///< returned with the solution
  ProblemView problem;                     ///< as in Client::solve
  Options options = {};                    ///< of this problem
  std::span<const double> initial_z = {};  ///< n or empty
  std::string problem_name = {};           ///< shortened to 256 bytes
  std::string request_id = {};             ///< at most 128 bytes of printable ASCII
  /// Derivatives of its solution to return with it, or null.
  const SensitivityRequest* sensitivity = nullptr;
};

/// Returns one problem after the other, then nothing. Called on a thread of the batch; the arrays must live
/// until the next call.
using BatchSource = std::function<std::optional<BatchProblem>()>;

/// Receives a solution, on the thread that called solve_batch, in the order of completion. Neither it nor the
/// source may throw.
using BatchSink = std::function<void(std::int64_t tag, Expected<RemoteSolution> answer)>;

/// Options of a whole batch; all of them optional.
struct BatchControls {
  Priority priority = Priority::by_method;  ///< of every problem
  std::stop_token stop = {};                ///< cancels the whole batch
  std::string traceparent = {};             ///< as CallControls::traceparent, for the whole stream
  /// How long to wait for a lost server, seconds >= 0 from the loss on. The batch continues on the next
  /// server, or on the same one once it is back, with the problems that have no result yet; each problem gets
  /// one result. After that time the rest is `unavailable`. Default: 10 s, and less than one second if no
  /// server has ever responded to this client. No effect in process.
  std::optional<std::chrono::duration<double>> wait = {};
  /// A server keeps problems of a batch waiting while its queue, or the client's share of it, is full. Called
  /// once if it refuses one all the same, with its reason: the batch sends that problem again after the time
  /// that the server names.
  std::function<void(const Error& reason)> waiting = {};
};

/// One problem of an array.
struct ArrayElement {
  /// A problem of its own; or nothing: the base problem with the numbers of `update`.
  std::optional<ProblemView> problem = {};
  ProblemUpdate update = {};               ///< changes to the base problem; absent parts stay
  std::optional<Options> options = {};     ///< its own; nothing: those of the array
  std::span<const double> initial_z = {};  ///< n or empty
  const Solution* warm_start = nullptr;    ///< a solution of these sizes to start from, or null
  /// Derivatives of its solution to return with it, or null.
  const SensitivityRequest* sensitivity = nullptr;
  std::string problem_name = {};  ///< for an element with a problem of its own; shortened to 256 bytes
};

/// Returns one element after the other, then nothing. Called on the submitting thread; the arrays must live
/// until the next call. Must not throw.
using ArraySource = std::function<std::optional<ArrayElement>()>;

/// Options of a whole array; all of them optional.
struct ArrayControls {
  const Problem* base = nullptr;            ///< the base problem, or null
  Options options = {};                     ///< of all elements
  Priority priority = Priority::by_method;  ///< of all elements; by_method is batch
  std::string name = {};                    ///< for the server's log and page; shortened to 256 bytes
  /// At most 128 bytes of printable ASCII. An array sent again with the same id is the same job. Empty: a
  /// random id.
  std::string request_id = {};
  std::optional<std::chrono::duration<double>> deadline = {};  ///< of the submission alone
  std::stop_token stop = {};                                   ///< cancels the submission
  /// As CallControls::queue_wait. An array is repeated only if at most 64 MiB of it were sent before the
  /// refusal. The client keeps what it sends up to this size; with 0 s it keeps nothing.
  std::optional<std::chrono::duration<double>> queue_wait = {};
  std::function<void(const Error& reason)> waiting = {};  ///< as CallControls::waiting
};

/// An array that the server accepted.
struct SubmittedArray {
  std::string job_id;         ///< the id for later requests
  std::int64_t elements = 0;  ///< number of elements
};

/// The result of one element.
struct ArrayAnswer {
  std::int64_t index = 0;           ///< its position in the array, from 0
  std::int64_t sequence = 0;        ///< position among the array's results, from 1; never changes
  Expected<RemoteSolution> answer;  ///< or the reason why there is none
};

/// Receives a result, on the thread that called Jobs::array. Must not throw.
using ArraySink = std::function<void(ArrayAnswer answer)>;

/// How to read results.
struct ArrayReading {
  std::int64_t after = 0;     ///< only results after this one: the largest sequence received before
  std::stop_token stop = {};  ///< ends the reading with `cancelled`, not the array
};

}  // namespace marble
