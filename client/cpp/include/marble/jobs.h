// Provides access to jobs by their ids: submitted jobs, which outlive the connection, and all others for
// observers.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "marble/batch.h"
#include "marble/call_controls.h"
#include "marble/coupled.h"
#include "marble/error.h"
#include "marble/options.h"
#include "marble/problem.h"
#include "marble/progress.h"
#include "marble/remote_scenarios.h"
#include "marble/report/conflict.h"
#include "marble/solution.h"
#include "marble/solver.h"

namespace marble {

namespace client {
class Connection;
}

/// The kind of request that a job came from.
enum class JobKind {
  solve,      ///< a call that waits for its solution
  batch,      ///< a stream of many
  submitted,  ///< Jobs::submit
  session,    ///< a session: one job for all its solves
  scenarios,  ///< a call that waits for one plan for many scenarios
  coupled,    ///< a call that waits for problems coupled by rows
  array,      ///< Jobs::submit_array: one job for all its elements
};
/// "solve", "batch", "submitted", "session", "scenarios", "coupled", "array".
[[nodiscard]] const char* to_string(JobKind kind);

/// The state of a job.
enum class JobState {
  queued,    ///< waits for a worker
  running,   ///< runs on a worker
  idle,      ///< a session between updates
  finished,  ///< has its result or its error
};
/// "queued", "running", "idle", "finished".
[[nodiscard]] const char* to_string(JobState state);

/// The progress of an array.
struct ArrayProgress {
  std::int64_t elements = 0;  ///< number of elements; 0 if the job is not an array
  std::int64_t done = 0;      ///< elements that have ended
  std::int64_t solved = 0;    ///< of these, those with a solved solution
  std::int64_t failed = 0;    ///< of these, those that ended with an error
};

/// All information about one job except its problem and its solution's vectors.
struct JobInfo {
  std::string job_id;                         ///< the server's id for it
  JobKind kind = JobKind::solve;              ///< the kind of request
  JobState state = JobState::queued;          ///< its state
  Priority priority = Priority::interactive;  ///< its priority; never by_method
  std::string client;                         ///< the client that sent it
  std::string request_id;                     ///< as it was sent; may be empty
  std::string problem_name;                   ///< as it was sent; may be empty
  int variables = 0;                          ///< n
  int equalities = 0;                         ///< n_e
  int inequalities = 0;                       ///< n_i
  int pairs = 0;                              ///< n_c
  double accepted_unix_s = 0.0;               ///< seconds since 1970, UTC
  int queue_position = 0;                     ///< jobs before this one, while queued
  double estimated_wait_s = 0.0;              ///< seconds, while queued
  std::optional<Status> status;               ///< how it ended; for a session, its newest solve
  std::optional<Error> error;                 ///< why there is no solution
  std::int64_t iterations = 0;                ///< Newton steps so far
  std::int64_t factorizations = 0;            ///< so far
  double objective = 0.0;                     ///< of the newest iterate
  Violations violations;                      ///< of the newest iterate, user units
  /// With global search: objective of the best point of the tree so far, +∞ while there is none.
  double incumbent = std::numeric_limits<double>::infinity();
  double bound = -std::numeric_limits<double>::infinity();  ///< as Solution::bound, so far
  double gap = std::numeric_limits<double>::infinity();     ///< as Solution::gap, so far
  std::int64_t nodes = 0;                                   ///< bounded so far; 0 before there is a tree
  std::int64_t open_nodes = 0;                              ///< of the tree, to be bounded or branched
  bool proved = false;                                      ///< as Solution::proved
  Times times;                                              ///< set once it has finished
  double queue_s = 0.0;                                     ///< seconds that it waited for a worker
  double total_s = 0.0;                                     ///< seconds from its acceptance to its solution
  std::int64_t updates = 0;                                 ///< for a session, completed updates
  std::int64_t memory_bytes = 0;                            ///< of its solver, as counted against the limits
  std::int64_t result_bytes = 0;                            ///< of its result, if the server keeps it
  std::vector<SampleAverageStage> stages = {};              ///< of a scenario solve so far, without x
  std::string detail;                                       ///< the numbers that justify the status
  std::string trace_id;          ///< of the W3C traceparent sent with it; may be empty
  std::string server;            ///< with a shared store: the server that runs it, or ran it last; else empty
  double finished_unix_s = 0.0;  ///< seconds since 1970, UTC; 0 before the end
  std::optional<Activity> activity;  ///< current activity, if it runs on the server that was asked
  ArrayProgress array = {};          ///< for an array
};

/// A job's progress, oldest row first; of a long job every `stride`-th iteration and the newest. Rows have no
/// z.
struct JobTrace {
  std::vector<Progress> rows;  ///< without vectors
  int stride = 1;              ///< >= 1
};

/// Why a problem is infeasible, of bounded length: Solution::conflict and Solution::certificate have all of
/// it.
struct Infeasibility {
  /// With option explain: the conflict with its first 100 parts in the order of its members.
  std::optional<Conflict> conflict = {};
  std::int64_t more_parts = 0;  ///< number of further parts
  /// Positions in the certificate of its largest multipliers, at most 8, largest first; empty without one.
  std::vector<Index> rows = {};
  std::vector<double> multipliers = {};  ///< of these rows
  std::int64_t more_rows = 0;  ///< further rows whose multiplier is above a thousandth of the largest
};

/// All information about one job.
struct JobDetails {
  JobInfo job;      ///< as in a list
  Options options;  ///< in force
  JobTrace trace;   ///< its convergence
  /// Why its problem is infeasible; unset for any other status. Of a session, for its newest solve.
  std::optional<Infeasibility> infeasibility = {};
};

/// A job that the server accepted.
struct SubmittedJob {
  std::string job_id;             ///< the id for later requests
  int queue_position = 0;         ///< jobs before this one
  double estimated_wait_s = 0.0;  ///< seconds until a worker is likely to take it
  std::string traceparent = {};   ///< the server's span in the caller's trace; empty if none was sent
};

/// Which jobs to list; all by default.
struct JobQuery {
  std::vector<JobState> states = {};  ///< any of these; empty: all
  std::string client = {};            ///< the sending client; empty: any
  int limit = 0;                      ///< in [0, 10000]; 0 means 100
  std::string before_job_id = {};     ///< for the next page: only jobs older than this one
};

/// A page of jobs, newest first.
struct JobPage {
  std::vector<JobInfo> jobs;  ///< at most JobQuery::limit
  bool more = false;          ///< there are older ones
};

/// The current state of a job, and its progress since the last event.
struct JobEvent {
  JobInfo job;                      ///< its current state
  std::vector<Progress> rows = {};  ///< for one job every row, for all jobs the newest row of each; without z
  std::optional<JobTrace> trace = {};  ///< in the first event of one job: its progress until now
  std::int64_t skipped = 0;  ///< rows not sent, jobs forgotten before they were sent: this reader was slow
};

/// Everything that a job's solve depends on, and its result: `marble job --bundle` makes a file of it.
/// Serialized messages of marble.v1; none names the caller.
struct JobBundle {
  std::string facts;    ///< a JobBundle: version, processor, options, trace
  std::string request;  ///< a SolveRequest
  std::string answer;   ///< a SolveResponse; empty if there is none, or not yet
};

/// How to wait for a result.
struct ResultControls {
  bool wait = false;  ///< wait for the result; else an unfinished job is the error failed_precondition
  std::optional<std::chrono::duration<double>> deadline = {};  ///< for the wait; absent: no limit
  std::stop_token stop = {};                                   ///< ends the wait, not the job
};

/// How to receive events.
struct WatchControls {
  double progress_interval_s =
      0.0;                    ///< least time between two events about one job's progress, seconds, >= 0
  std::stop_token stop = {};  ///< ends the watch with `cancelled`
};

/// Is thread-safe, and may outlive its Client. No call throws. Errors: not_found if the job is unknown, no
/// longer kept, or not visible to the caller. With several addresses, the servers must share a store; else a
/// job is known only to the server that accepted it.
class Jobs {
 public:
  /// Queues a job that outlives this process. Of the controls only initial_z, warm_start, sensitivity and
  /// stop are used; of the call, the deadline (for the submission only), request_id, problem_name, priority,
  /// traceparent, queue_wait and waiting. A repeated submission with the same request_id is the same job, on
  /// a server that still keeps it. Without one the id is random, because a submission that gets unavailable
  /// is retried as a solve is.
  [[nodiscard]] Expected<SubmittedJob> submit(const ProblemView& problem, const Options& options = {},
                                              const SolveControls& controls = {},
                                              const CallControls& call = {}) const;

  /// The same for one plan for many scenarios, whose numbers are sent.
  [[nodiscard]] Expected<SubmittedJob> submit(const ScenarioProblem& problem,
                                              const ScenarioSettings& settings = {},
                                              const SolveControls& controls = {},
                                              const CallControls& call = {}) const;

  /// The same for a coupled problem; of the controls only the coupling_multipliers to start with and stop are
  /// used.
  [[nodiscard]] Expected<SubmittedJob> submit(const CoupledView& view, const CoupledOptions& options = {},
                                              const CoupledControls& controls = {},
                                              const CallControls& call = {}) const;

  /// The same for a long horizon in segments, as in marble::solve_in_segments; of the controls only stop is
  /// used.
  [[nodiscard]] Expected<SubmittedJob> submit_in_segments(const Problem& problem,
                                                          std::span<const Index> stage_of_variable,
                                                          const SegmentsOptions& options = {},
                                                          const CoupledControls& controls = {},
                                                          const CallControls& call = {}) const;

  /// Queues many problems as one job that outlives this process. The server keeps all of it or nothing. A
  /// refused or lost submission may be repeated with its request_id.
  [[nodiscard]] Expected<SubmittedArray> submit_array(const ArraySource& source,
                                                      const ArrayControls& controls = {}) const;

  /// Passes each result of an array to `sink` once: first the existing ones, then the others as they arrive.
  /// A lost connection is made again. If no server responds for 10 s, the call ends with unavailable, and may
  /// be continued with `after`. If the array ended before all its elements had a result, returns the reason
  /// as the error.
  [[nodiscard]] Expected<void> array(const std::string& job_id, const ArraySink& sink,
                                     const ArrayReading& reading = {}) const;

  /// Returns the solution of a submitted job, or the error it ended with.
  [[nodiscard]] Expected<RemoteSolution> result(const std::string& job_id,
                                                const ResultControls& controls = {}) const;

  /// The same for a job submitted with scenarios; failed_precondition for others.
  [[nodiscard]] Expected<RemoteScenarios> scenarios(const std::string& job_id,
                                                    const ResultControls& controls = {}) const;

  /// The same for a coupled problem; `view` as submitted, for the sizes of its blocks and rows. Error
  /// invalid_argument, field "blocks", if it is another problem's.
  [[nodiscard]] Expected<RemoteCoupledSolution> coupled(const std::string& job_id, const CoupledView& view,
                                                        const ResultControls& controls = {}) const;

  /// The same for segments.
  [[nodiscard]] Expected<RemoteSegmentsSolution> segments(const std::string& job_id,
                                                          const ResultControls& controls = {}) const;

  /// Returns a submitted job in a form that can be solved again elsewhere, finished or not; only for its own
  /// client and the role admin. Errors: failed_precondition (it was not submitted, or its request is no
  /// longer kept).
  [[nodiscard]] Expected<JobBundle> bundle(const std::string& job_id, const std::stop_token& stop = {}) const;

  /// Removes a submitted job and its result; cancels it if it has not finished.
  [[nodiscard]] Expected<void> remove(const std::string& job_id) const;

  /// Returns the jobs that match the query, newest first. `stop` cancels the request with the error
  /// cancelled.
  [[nodiscard]] Expected<JobPage> list(const JobQuery& query = {}, const std::stop_token& stop = {}) const;
  /// Returns one job, with its options and its convergence.
  [[nodiscard]] Expected<JobDetails> get(const std::string& job_id) const;

  /// Cancels a job: a waiting one at once, a running one within an iteration. Returns its state afterwards.
  [[nodiscard]] Expected<JobInfo> cancel(const std::string& job_id) const;

  /// Calls `happened` on this thread: for one job until it has finished, for all (`job_id` empty) without
  /// end.
  [[nodiscard]] Expected<void> watch(const std::string& job_id,
                                     const std::function<void(const JobEvent&)>& happened,
                                     const WatchControls& controls = {}) const;

 private:
  friend class Client;
  explicit Jobs(std::shared_ptr<const client::Connection> connection) : connection_(std::move(connection)) {}
  std::shared_ptr<const client::Connection> connection_;
};

}  // namespace marble
