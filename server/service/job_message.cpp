#include "service/job_message.h"

#include <algorithm>

#include "base/status.h"
#include "jobs/unix_time.h"
#include "marble/convert.h"
#include "marble/convert_scenarios.h"

namespace marble::server {
namespace {

constexpr std::int64_t kMostStored = std::int64_t{1} << 40;  // of a stored message

// Converts a number of a message's enumeration, which counts from `first`, to one that counts from 0; its
// first value if unknown.
template <class Enum>
Enum enum_of(int number, int first, Enum last) {
  const std::int64_t at = std::int64_t{number} - first;
  return at >= 0 && at <= static_cast<int>(last) ? static_cast<Enum>(at) : Enum{};
}

void to_message(const Infeasibility& why, v1::Infeasibility* message) {
  if (why.conflict) marble::to_message(*why.conflict, message->mutable_conflict());
  message->set_more_parts(why.more_parts);
  for (const auto& [row, multiplier] : why.rows) {
    message->add_rows(row);
    message->add_multipliers(multiplier);
  }
  message->set_more_rows(why.more_rows);
}

}  // namespace

v1::Priority to_message(Priority priority) {
  return static_cast<v1::Priority>(static_cast<int>(priority) + v1::PRIORITY_REALTIME);
}

void to_message(const JobRecord& record, v1::JobInfo* message) {
  const JobDescription& what = record.description();
  const JobSnapshot now = record.snapshot();
  message->set_job_id(utf8(what.id));
  message->set_kind(static_cast<v1::JobKind>(static_cast<int>(what.kind) + v1::JOB_KIND_SOLVE));
  message->set_state(static_cast<v1::JobState>(static_cast<int>(now.state) + v1::JOB_STATE_QUEUED));
  message->set_priority(to_message(what.priority));
  message->set_client(utf8(what.client));
  message->set_request_id(utf8(what.request_id));
  message->set_problem_name(utf8(what.name));
  message->set_variables(what.variables);
  message->set_equalities(what.equalities);
  message->set_inequalities(what.inequalities);
  message->set_pairs(what.pairs);
  message->set_accepted_unix_s(unix_s(what.accepted));
  if (now.state == JobState::queued) {
    const QueuePlace place = record.place();
    message->set_queue_position(place.position);
    message->set_estimated_wait_s(place.estimated_wait_s);
  }
  if (now.state == JobState::running) to_message(record.activity().read(), message->mutable_activity());
  if (now.error) {
    *message->mutable_error() = to_message(*now.error);
  } else if (now.status) {
    message->set_status(to_message(*now.status));
  }
  message->set_iterations(now.iterations);
  message->set_factorizations(now.factorizations);
  message->set_objective(now.objective);
  to_message(now.violations, message->mutable_violations());
  tree_to_message(now, message);
  message->set_proved(now.proved);
  for (const SampleAverageStage& stage : now.stages) to_message(stage, message->add_sample_average_stages());
  const bool under_way = now.state == JobState::queued || now.state == JobState::running;
  const double age_s =
      std::chrono::duration<double>(std::chrono::system_clock::now() - what.accepted).count();
  const bool ages = under_way && what.kind != JobKind::session;  // a session's times are of its newest solve
  v1::Times* times = message->mutable_times();
  times->set_queue_s(ages && now.state == JobState::queued ? age_s : now.queue_s);
  times->set_setup_s(now.times.setup_s);
  times->set_factorization_s(now.times.factorization_s);
  times->set_line_search_s(now.times.line_search_s);
  times->set_solve_s(now.times.solve_s);
  times->set_total_s(ages ? age_s : now.total_s);
  message->set_updates(now.updates);
  message->set_memory_bytes(now.memory_bytes);
  times->set_polish_s(now.times.polish_s);
  times->set_tree_s(now.times.tree_s);
  message->set_result_bytes(now.result_bytes);
  message->set_detail(utf8(now.detail));
  if (what.trace) message->set_trace_id(utf8(what.trace->trace_id));
  if (now.finished) message->set_finished_unix_s(unix_s(*now.finished));
  message->set_server(utf8(now.server));
  if (!now.array) return;
  v1::ArrayProgress* array = message->mutable_array();
  array->set_elements(now.array->elements);
  array->set_done(now.array->done);
  array->set_solved(now.array->solved);
  array->set_failed(now.array->failed);
}

void to_message(const JobRecord::Trace& trace, v1::Trace* message) {
  for (const Progress& row : trace.rows) to_message(row, message->add_rows());
  message->set_stride(trace.stride);
  for (const PairHistory::Frame& frame : trace.pairs) to_message(frame, message->add_pairs());
}

void to_message(const PairHistory::Frame& frame, v1::PairSides* message) {
  message->set_iteration(frame.iteration);
  message->set_kappa(frame.kappa);
  message->mutable_s()->Assign(frame.s.begin(), frame.s.end());
  message->mutable_t()->Assign(frame.t.begin(), frame.t.end());
}

void to_message(const JobRecord& record, v1::GetJobResponse* message) {
  to_message(record, message->mutable_job());
  marble::to_message(record.options(), message->mutable_options());
  to_message(record.trace(), message->mutable_trace());
  if (const auto why = record.snapshot().infeasibility) to_message(*why, message->mutable_infeasibility());
}

JobDescription description_of(const v1::JobInfo& message) {
  JobDescription what = {.id = message.job_id(),
                         .kind = enum_of(message.kind(), v1::JOB_KIND_SOLVE, JobKind::array),
                         .priority = priority_of(std::int64_t{message.priority()} - v1::PRIORITY_REALTIME),
                         .client = message.client(),
                         .request_id = message.request_id(),
                         .name = message.problem_name(),
                         .variables = message.variables(),
                         .equalities = message.equalities(),
                         .inequalities = message.inequalities(),
                         .pairs = message.pairs(),
                         .accepted = time_of(message.accepted_unix_s())};
  if (!message.trace_id().empty()) what.trace = TraceContext{message.trace_id(), {}, {}};
  return what;
}

JobSnapshot snapshot_of(const v1::JobInfo& message) {
  JobSnapshot now;
  now.state = enum_of(message.state(), v1::JOB_STATE_QUEUED, JobState::finished);
  if (message.status() != v1::STATUS_UNSPECIFIED) now.status = status_of(message.status());
  if (message.has_error()) now.error = error_of(message.error());
  now.iterations = message.iterations();
  now.factorizations = message.factorizations();
  now.objective = message.objective();
  now.violations = violations_of(message.violations());
  take_tree(message, now);
  now.proved = message.proved();
  for (const v1::SampleAverageStage& stage : message.sample_average_stages())
    now.stages.push_back(sample_average_stage_of(stage));
  const v1::Times& times = message.times();
  now.times.setup_s = times.setup_s();
  now.times.factorization_s = times.factorization_s();
  now.times.line_search_s = times.line_search_s();
  now.times.polish_s = times.polish_s();
  now.times.tree_s = times.tree_s();
  now.times.solve_s = times.solve_s();
  now.queue_s = times.queue_s();
  now.total_s = times.total_s();
  now.updates = message.updates();
  now.memory_bytes = message.memory_bytes();
  now.result_bytes = message.result_bytes();
  now.detail = message.detail();
  now.server = message.server();
  if (message.has_array()) {
    const v1::ArrayProgress& array = message.array();
    now.array = {array.elements(), array.done(),         array.solved(),
                 array.failed(),   message.iterations(), message.factorizations()};
  }
  if (message.finished_unix_s() > 0.0) now.finished = time_of(message.finished_unix_s());
  return now;
}

// A stored message may contain anything.
JobSnapshot snapshot_of(const v1::GetJobResponse& message) {
  JobSnapshot now = snapshot_of(message.job());
  if (!message.has_infeasibility()) return now;
  const v1::Infeasibility& stored = message.infeasibility();
  auto why = std::make_shared<Infeasibility>();
  if (stored.has_conflict()) {
    why->conflict = marble::conflict_of(stored.conflict());
    why->more_parts = std::clamp<std::int64_t>(stored.more_parts(), 0, kMostStored) + shorten(*why->conflict);
  }
  const int rows =
      std::min({stored.rows_size(), stored.multipliers_size(), static_cast<int>(Infeasibility::kMostRows)});
  for (int i = 0; i < rows; ++i) why->rows.push_back({stored.rows(i), stored.multipliers(i)});
  why->more_rows = std::clamp<std::int64_t>(stored.more_rows(), 0, kMostStored);
  now.infeasibility = std::move(why);
  return now;
}

JobRecord::Trace trace_of(const v1::Trace& message) {
  JobRecord::Trace trace;
  trace.stride = std::max(message.stride(), 1);
  for (const v1::Progress& row : message.rows()) {
    trace.rows.push_back(without_vectors(progress_of(row)));  // the vectors belong to the message
  }
  for (const v1::PairSides& sides : message.pairs()) {
    trace.pairs.push_back({.iteration = sides.iteration(),
                           .kappa = sides.kappa(),
                           .s = {sides.s().begin(), sides.s().end()},
                           .t = {sides.t().begin(), sides.t().end()}});
  }
  return trace;
}

}  // namespace marble::server
