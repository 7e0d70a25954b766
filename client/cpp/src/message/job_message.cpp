#include "message/job_message.h"

#include "marble/convert.h"
#include "marble/convert_scenarios.h"
#include "message/status.h"
#include "message_text.h"

namespace marble {

const char* to_string(JobKind kind) {
  return client::name_of(kind, {"solve", "batch", "submitted", "session", "scenarios", "coupled", "array"});
}

const char* to_string(JobState state) {
  return client::name_of(state, {"queued", "running", "idle", "finished"});
}

namespace client {

static_assert(static_cast<int>(JobKind::array) + 1 == v1::JOB_KIND_ARRAY &&
                  static_cast<int>(JobState::finished) + 1 == v1::JOB_STATE_FINISHED,
              "messages count from one, for the unspecified");

v1::JobState to_message(JobState state) { return static_cast<v1::JobState>(static_cast<int>(state) + 1); }

JobInfo job_info(const v1::JobInfo& m) {
  JobInfo job;
  job.job_id = m.job_id();
  job.kind = static_cast<JobKind>(static_cast<int>(m.kind()) - 1);
  job.state = static_cast<JobState>(static_cast<int>(m.state()) - 1);
  job.priority = static_cast<Priority>(static_cast<int>(m.priority()));
  job.client = m.client();
  job.request_id = m.request_id();
  job.problem_name = m.problem_name();
  job.variables = m.variables();
  job.equalities = m.equalities();
  job.inequalities = m.inequalities();
  job.pairs = m.pairs();
  job.accepted_unix_s = m.accepted_unix_s();
  job.queue_position = m.queue_position();
  job.estimated_wait_s = m.estimated_wait_s();
  if (m.has_error()) {
    job.error = to_error(m.error());
  } else if (m.status() != v1::STATUS_UNSPECIFIED) {
    job.status = status_of(m.status());
  }
  job.iterations = m.iterations();
  job.factorizations = m.factorizations();
  job.objective = m.objective();
  job.violations = violations_of(m.violations());
  take_tree(m, job);
  job.proved = m.proved();
  const v1::Times& times = m.times();
  job.times = {times.setup_s(), times.factorization_s(), times.line_search_s(),
               times.solve_s(), times.polish_s(),        times.tree_s()};
  job.queue_s = times.queue_s();
  job.total_s = times.total_s();
  job.updates = m.updates();
  job.memory_bytes = m.memory_bytes();
  job.result_bytes = m.result_bytes();
  for (const v1::SampleAverageStage& stage : m.sample_average_stages())
    job.stages.push_back(sample_average_stage_of(stage));
  job.detail = m.detail();
  job.trace_id = m.trace_id();
  job.server = m.server();
  job.finished_unix_s = m.finished_unix_s();
  if (m.has_activity()) job.activity = activity_of(m.activity());
  if (m.has_array())
    job.array = {m.array().elements(), m.array().done(), m.array().solved(), m.array().failed()};
  return job;
}

std::vector<Progress> progress_rows(const google::protobuf::RepeatedPtrField<v1::Progress>& rows) {
  std::vector<Progress> result;
  result.reserve(static_cast<std::size_t>(rows.size()));
  for (const v1::Progress& row : rows) {
    result.push_back(without_vectors(progress_of(row)));  // the message ends before the row
  }
  return result;
}

JobTrace job_trace(const v1::Trace& message) { return {progress_rows(message.rows()), message.stride()}; }

Infeasibility infeasibility(const v1::Infeasibility& message) {
  Infeasibility why{.more_parts = message.more_parts(),
                    .rows = {message.rows().begin(), message.rows().end()},
                    .multipliers = {message.multipliers().begin(), message.multipliers().end()},
                    .more_rows = message.more_rows()};
  if (message.has_conflict()) why.conflict = conflict_of(message.conflict());
  return why;
}

}  // namespace client
}  // namespace marble
