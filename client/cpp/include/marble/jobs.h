// Jobs by their ids: submitted ones, which outlive the connection, and all others for those who look.
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
#include "marble/solution.h"
#include "marble/solver.h"

namespace marble {

namespace client {
class Connection;
}

/// What a job came by.
enum class JobKind {
  solve,      ///< a call that waits for its answer
  batch,      ///< a stream of many
  submitted,  ///< Jobs::submit
  session,    ///< a session: one job for all its solves
  scenarios,  ///< a call that waits for one plan for many worlds
  coupled,    ///< a call that waits for problems tied by rows
  array,      ///< Jobs::submit_array: one job for all its elements
};
/// "solve", "batch", "submitted", "session", "scenarios", "coupled", "array".
[[nodiscard]] const char* to_string(JobKind kind);

/// Where a job is in its life.
enum class JobState {
  queued,    ///< it waits for a worker
  running,   ///< a worker has it
  idle,      ///< a session between updates
  finished,  ///< it has its answer, or its error
};
/// "queued", "running", "idle", "finished".
[[nodiscard]] const char* to_string(JobState state);

/// How far an array is.
struct ArrayProgress {
  std::int64_t elements = 0;  ///< how many there are; 0 of what is no array
  std::int64_t done = 0;      ///< those that have ended
  std::int64_t solved = 0;    ///< of these, those whose answer is solved
  std::int64_t failed = 0;    ///< of these, those that ended with an error
};

/// What is known of one job, without its problem and its solution's vectors.
struct JobInfo {
  std::string job_id;                         ///< the server's name for it
  JobKind kind = JobKind::solve;              ///< what it came by
  JobState state = JobState::queued;          ///< where it is
  Priority priority = Priority::interactive;  ///< whose turn it is; never by_method
  std::string client;                         ///< who sent it
  std::string request_id;                     ///< as it was sent; may be empty
  std::string problem_name;                   ///< as it was sent; may be empty
  int variables = 0;                          ///< n
  int equalities = 0;                         ///< n_e
  int inequalities = 0;                       ///< n_i
  int pairs = 0;                              ///< n_c
  double accepted_unix_s = 0.0;               ///< seconds since 1970, UTC
  int queue_position = 0;                     ///< jobs before this one, while queued
  double estimated_wait_s = 0.0;              ///< seconds, while queued
  std::optional<Status> status;               ///< how it ended; of a session its newest solve
  std::optional<Error> error;                 ///< why there is no answer
  std::int64_t iterations = 0;                ///< Newton steps so far
  std::int64_t factorizations = 0;            ///< so far
  double objective = 0.0;                     ///< of the newest iterate
  Violations violations;                      ///< of the newest iterate, user units
  /// Option global: objective of the best point of its tree so far, +∞ while there is none.
  double incumbent = std::numeric_limits<double>::infinity();
  double bound = -std::numeric_limits<double>::infinity();  ///< as Solution::bound, so far
  double gap = std::numeric_limits<double>::infinity();     ///< as Solution::gap, so far
  std::int64_t nodes = 0;                                   ///< bounded so far; 0 before a tree
  std::int64_t open_nodes = 0;                              ///< of the tree, still to be bounded or branched
  bool proved = false;                                      ///< as Solution::proved
  Times times;                                              ///< once it has finished
  double queue_s = 0.0;                                     ///< seconds that it waited for a worker
  double total_s = 0.0;                                     ///< seconds from its acceptance to its answer
  std::int64_t updates = 0;                                 ///< of a session, answered ones
  std::int64_t memory_bytes = 0;                            ///< of its solver, as counted against the limits
  std::int64_t result_bytes = 0;                            ///< of its answer, where that is kept
  std::vector<ScenarioLevel> levels = {};                   ///< of a scenario solve so far, without x
  std::string detail;                                       ///< the numbers that justify the status
  std::string trace_id;          ///< of the W3C traceparent that came with it; may be empty
  std::string server;            ///< of servers that share a store: that runs it, or ran it last; else empty
  double finished_unix_s = 0.0;  ///< seconds since 1970, UTC; 0 while it has not
  std::optional<Activity> activity;  ///< what it is doing, while it runs on the server that was asked
  ArrayProgress array = {};          ///< of an array
};

/// What a job did, oldest first; of a long one every `stride`-th iteration and the newest. Rows have no z.
struct JobTrace {
  std::vector<Progress> rows;  ///< without vectors
  int stride = 1;              ///< >= 1
};

/// All that is known of one job.
struct JobDetails {
  JobInfo job;      ///< as a list has it
  Options options;  ///< in force
  JobTrace trace;   ///< how it converged
};

/// A job that was taken.
struct SubmittedJob {
  std::string job_id;             ///< to ask for it by
  int queue_position = 0;         ///< jobs before this one
  double estimated_wait_s = 0.0;  ///< seconds until a worker is likely to have it
  std::string traceparent = {};   ///< the server's span in the caller's trace; empty if none was sent
};

/// Which jobs to list; all if nothing is said.
struct JobQuery {
  std::vector<JobState> states = {};  ///< any of these; empty: all
  std::string client = {};            ///< who sent it; empty: anybody
  int limit = 0;                      ///< in [0, 10000]; 0 means 100
  std::string before_job_id = {};     ///< to page on: only jobs older than this one
};

/// Jobs, newest first.
struct JobPage {
  std::vector<JobInfo> jobs;  ///< at most JobQuery::limit
  bool more = false;          ///< there are older ones
};

/// A job as it is now, and what it did since it was last told of.
struct JobEvent {
  JobInfo job;                         ///< as it is now
  std::vector<Progress> rows = {};     ///< of one job every row, of all jobs the newest of each; without z
  std::optional<JobTrace> trace = {};  ///< in the first event of one job: what it did until now
  std::int64_t skipped = 0;            ///< told so far of what was not told, because this reader was slow
};

/// All that a job's solve depends on, and what came of it: `marble job --bundle` makes a file of it.
/// Serialized messages of marble.v1, none of which says who asked.
struct JobBundle {
  std::string facts;    ///< a JobBundle: version, processor, options, trace
  std::string request;  ///< a SolveRequest
  std::string answer;   ///< a SolveResponse; empty if there is none, or not yet
};

/// How to wait for an answer.
struct ResultControls {
  bool wait = false;  ///< for the answer; else an unfinished job is the error failed_precondition
  std::optional<std::chrono::duration<double>> deadline = {};  ///< of the waiting; none: for ever
  std::stop_token stop = {};                                   ///< ends the waiting, not the job
};

/// How to be told.
struct WatchControls {
  double progress_interval_s =
      0.0;                    ///< least time between two events about one job's progress, seconds, >= 0
  std::stop_token stop = {};  ///< ends the watching with `cancelled`
};

/// Thread-safe, and may outlive the Client it is from. No call throws. Error not_found: never heard of the
/// job, no longer kept, or not the caller's to see; invalid_argument, field "address": the client has several
/// servers, and jobs stay with the one that took them.
class Jobs {
 public:
  /// Queues a job that outlives this process. Of the controls count initial_z, warm_start, sensitivity and
  /// stop; of the call the deadline (of the submission alone), request_id, problem_name, priority and
  /// traceparent. The same submission made again with its request_id is the same job, on a server that still
  /// keeps it; without one it has a random one, since what got unavailable is sent again as a solve is.
  [[nodiscard]] Expected<SubmittedJob> submit(const ProblemView& problem, const Options& options = {},
                                              const SolveControls& controls = {},
                                              const CallControls& call = {}) const;

  /// The same of one plan for many worlds, whose numbers are sent.
  [[nodiscard]] Expected<SubmittedJob> submit(const ScenarioProblem& problem,
                                              const ScenarioSettings& settings = {},
                                              const SolveControls& controls = {},
                                              const CallControls& call = {}) const;

  /// The same of a coupled problem; of the controls count the prices to start with and stop.
  [[nodiscard]] Expected<SubmittedJob> submit(const CoupledView& view, const CoupledOptions& options = {},
                                              const CoupledControls& controls = {},
                                              const CallControls& call = {}) const;

  /// The same of a long horizon in pieces, as marble::solve_in_pieces takes it; of the controls counts stop.
  [[nodiscard]] Expected<SubmittedJob> submit_in_pieces(const Problem& problem,
                                                        std::span<const Index> stage_of_variable,
                                                        const PiecesOptions& options = {},
                                                        const CoupledControls& controls = {},
                                                        const CallControls& call = {}) const;

  /// Queues many problems as one job that outlives this process. Nothing of it is kept unless all is. One
  /// that was refused or lost may be sent again by its request_id.
  [[nodiscard]] Expected<SubmittedArray> submit_array(const ArraySource& source,
                                                      const ArrayControls& controls = {}) const;

  /// Tells the answers of an array, each once: those that are there, and each of the others as it comes, over
  /// as many connections as it takes; of one that was lost for longer it is unavailable, and may be gone on
  /// with `after`. Error of an array that ended before all its elements had an answer: why.
  [[nodiscard]] Expected<void> array(const std::string& job_id, const ArraySink& sink,
                                     const ArrayReading& reading = {}) const;

  /// The answer of a submitted job, or the error it ended with.
  [[nodiscard]] Expected<RemoteSolution> result(const std::string& job_id,
                                                const ResultControls& controls = {}) const;

  /// The same of a job that was submitted with worlds; failed_precondition of others.
  [[nodiscard]] Expected<RemoteScenarios> scenarios(const std::string& job_id,
                                                    const ResultControls& controls = {}) const;

  /// The same of a coupled problem; `view` as it was submitted, for the sizes of its blocks and rows: error
  /// invalid_argument, field "blocks", of another's.
  [[nodiscard]] Expected<RemoteCoupledSolution> coupled(const std::string& job_id, const CoupledView& view,
                                                        const ResultControls& controls = {}) const;

  /// The same of pieces.
  [[nodiscard]] Expected<RemotePiecesSolution> pieces(const std::string& job_id,
                                                      const ResultControls& controls = {}) const;

  /// A submitted job to be solved again elsewhere, finished or not; its own client's and the role admin's.
  /// Errors: failed_precondition (it was not submitted, or its request is not kept any more).
  [[nodiscard]] Expected<JobBundle> bundle(const std::string& job_id, const std::stop_token& stop = {}) const;

  /// Lets a submitted job and its answer go; ends it if it has not finished.
  [[nodiscard]] Expected<void> remove(const std::string& job_id) const;

  /// Those that the query asks for, newest first. `stop` gives the question up, with the error cancelled.
  [[nodiscard]] Expected<JobPage> list(const JobQuery& query = {}, const std::stop_token& stop = {}) const;
  /// One job, with its options and its convergence.
  [[nodiscard]] Expected<JobDetails> get(const std::string& job_id) const;

  /// Ends a job: a waiting one at once, a running one within an iteration. Returns it as it is then.
  [[nodiscard]] Expected<JobInfo> cancel(const std::string& job_id) const;

  /// Calls `happened` on this thread: of one job until it has finished, of all (`job_id` empty) for ever.
  [[nodiscard]] Expected<void> watch(const std::string& job_id,
                                     const std::function<void(const JobEvent&)>& happened,
                                     const WatchControls& controls = {}) const;

 private:
  friend class Client;
  explicit Jobs(std::shared_ptr<const client::Connection> connection) : connection_(std::move(connection)) {}
  std::shared_ptr<const client::Connection> connection_;
};

}  // namespace marble
