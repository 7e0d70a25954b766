// Jobs by their ids: submitted ones, which outlive the connection, and all others for those who look.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "marble/call_controls.h"
#include "marble/error.h"
#include "marble/options.h"
#include "marble/problem.h"
#include "marble/progress.h"
#include "marble/solution.h"
#include "marble/solver.h"

namespace marble {

namespace client {
class Connection;
}

/// What a job came by.
enum class JobKind { solve, batch, submitted, session };
[[nodiscard]] const char* to_string(JobKind kind);

enum class JobState {
  queued,
  running,
  idle,      ///< a session between updates
  finished,  ///< it has its answer, or its error
};
[[nodiscard]] const char* to_string(JobState state);

/// What is known of one job, without its problem and its solution's vectors.
struct JobInfo {
  std::string job_id;
  JobKind kind = JobKind::solve;
  JobState state = JobState::queued;
  Priority priority = Priority::interactive;
  std::string client;  ///< who sent it
  std::string request_id, problem_name;
  int variables = 0, equalities = 0, inequalities = 0, pairs = 0;
  double accepted_unix_s = 0.0;  ///< seconds since 1970, UTC
  int queue_position = 0;        ///< jobs before this one, while queued
  double estimated_wait_s = 0.0;
  std::optional<Status> status;  ///< how it ended; of a session its newest solve
  std::optional<Error> error;    ///< why there is no answer
  std::int64_t iterations = 0, factorizations = 0;
  double objective = 0.0;
  Violations violations;
  Times times;
  double queue_s = 0.0, total_s = 0.0;
  std::int64_t updates = 0;  ///< of a session, answered ones
  std::int64_t memory_bytes = 0, result_bytes = 0;
  std::string detail;            ///< the numbers that justify the status
  std::string trace_id;          ///< of the W3C traceparent that came with it; may be empty
  double finished_unix_s = 0.0;  ///< seconds since 1970, UTC; 0 while it has not
};

/// What a job did, oldest first; of a long one every `stride`-th iteration and the newest. Rows have no z.
struct JobTrace {
  std::vector<Progress> rows;
  int stride = 1;
};

struct JobDetails {
  JobInfo job;
  Options options;  ///< in force
  JobTrace trace;
};

struct SubmittedJob {
  std::string job_id;
  int queue_position = 0;
  double estimated_wait_s = 0.0;
  std::string traceparent = {};  ///< the server's span in the caller's trace; empty if none was sent
};

/// Which jobs to list; all if nothing is said.
struct JobQuery {
  std::vector<JobState> states = {};
  std::string client = {};
  int limit = 0;                   ///< in [0, 10000]; 0 means 100
  std::string before_job_id = {};  ///< to page on: only jobs older than this one
};

/// Jobs, newest first.
struct JobPage {
  std::vector<JobInfo> jobs;
  bool more = false;
};

/// A job as it is now, and what it did since it was last told of.
struct JobEvent {
  JobInfo job;
  std::vector<Progress> rows = {};     ///< of one job every row, of all jobs the newest of each; without z
  std::optional<JobTrace> trace = {};  ///< in the first event of one job: what it did until now
  std::int64_t skipped = 0;            ///< told so far of what was not told, because this reader was slow
};

struct ResultControls {
  bool wait = false;  ///< for the answer; else an unfinished job is the error failed_precondition
  std::optional<std::chrono::duration<double>> deadline = {};
  std::stop_token stop = {};  ///< ends the waiting, not the job
};

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
  /// Queues a job that outlives this process. Of the controls count initial_z and stop; of the call the
  /// deadline (of the submission alone), request_id, problem_name, priority and traceparent.
  [[nodiscard]] Expected<SubmittedJob> submit(const ProblemView& problem, const Options& options = {},
                                              const SolveControls& controls = {},
                                              const CallControls& call = {}) const;

  /// The answer of a submitted job, or the error it ended with.
  [[nodiscard]] Expected<RemoteSolution> result(const std::string& job_id,
                                                const ResultControls& controls = {}) const;

  /// Lets a submitted job and its answer go; ends it if it has not finished.
  [[nodiscard]] Expected<void> remove(const std::string& job_id) const;

  /// `stop` gives the question up, with the error cancelled.
  [[nodiscard]] Expected<JobPage> list(const JobQuery& query = {}, const std::stop_token& stop = {}) const;
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
