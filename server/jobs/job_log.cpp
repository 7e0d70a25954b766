#include "jobs/job_log.h"

#include "base/status.h"
#include "marble/contract.h"

namespace marble::server {
namespace {

void add_trace(Log::Fields& fields, const std::optional<TraceContext>& trace) {
  if (!trace) return;
  fields.push_back({"trace_id", trace->trace_id});
  fields.push_back({"span_id", trace->span_id});
  fields.push_back({"parent_span_id", trace->parent_span_id});
}

Log::Fields fields_of(const JobDescription& what) {
  Log::Fields fields = {{"job", what.id},
                        {"client", what.client},
                        {"priority", to_string(what.priority)},
                        {"request", what.request_id},
                        {"name", what.name},
                        {"peer", what.peer},
                        {"n", std::int64_t{what.variables}},
                        {"n_e", std::int64_t{what.equalities}},
                        {"n_i", std::int64_t{what.inequalities}},
                        {"n_c", std::int64_t{what.pairs}}};
  add_trace(fields, what.trace);
  return fields;
}

void add(Log::Fields& fields, const Log::Fields& more) {
  fields.insert(fields.end(), more.begin(), more.end());
}

bool is_of_access(ErrorCode code) {
  return code == ErrorCode::unauthenticated || code == ErrorCode::permission_denied;
}

LogLevel level_of(const Expected<Solution>& solution, LogLevel otherwise) {
  const bool bug = !solution && solution.error().code == ErrorCode::internal;
  return bug ? spdlog::level::err : otherwise;
}

}  // namespace

void log_refusal(const Log& log, const Origin& origin, const Error& error) {
  const Component component = is_of_access(error.code) ? Component::access : Component::admission;
  const LogLevel level = error.code == ErrorCode::internal ? spdlog::level::err : spdlog::level::info;
  const auto line =
      log.line({level, component, "refused"}, origin.client.empty() ? host_of(origin.peer) : origin.client);
  if (!line) return;
  Log::Fields fields;
  if (!origin.client.empty()) fields.push_back({"client", origin.client});
  // The id may be the error in the request: log no more of it than a valid id may have.
  add(fields, {{"request", origin.request_id.substr(0, contract::longest_request_id)},
               {"peer", origin.peer},
               {"code", to_string(error.code)},
               {"reason", abridged(error).message()}});
  add_trace(fields, origin.trace);
  log.write(*line, fields);
}

void log_end(const Log& log, const Job& job, const Outcome& outcome) {
  const bool of_session = job.ticket.reserved;
  const LogLevel level = level_of(outcome.solution, of_session ? spdlog::level::debug : spdlog::level::info);
  const Component component = of_session ? Component::session : Component::job;
  const JobDescription& what = job.record->description();
  const auto line = log.line({level, component, of_session ? "update" : "job"}, what.client);
  if (!line) return;
  const bool answered = outcome.solution.has_value();
  const Solution nothing;
  const Solution& solution = answered ? *outcome.solution : nothing;
  Log::Fields fields = fields_of(what);
  add(fields, {{"status", answered ? to_string(solution.status) : to_string(outcome.solution.error().code)},
               {"iterations", std::int64_t{solution.iterations}},
               {"factorizations", std::int64_t{solution.factorizations}},
               {"objective", solution.objective},
               {"queue_s", outcome.queue_s},
               {"solve_s", solution.times.solve_s},
               {"total_s", outcome.total_s},
               {"detail", answered ? solution.detail : outcome.solution.error().message()}});
  if (solution.nodes > 0) {
    add(fields, {{"proved", solution.proved ? "true" : "false"},
                 {"bound", solution.bound},
                 {"gap", solution.gap},
                 {"nodes", solution.nodes},
                 {"open_nodes", solution.open_nodes}});
  }
  log.write(*line, fields);
}

void log_array_end(const Log& log, const JobRecord& record, const std::optional<Error>& reason) {
  const JobDescription& what = record.description();
  const bool bug = reason && reason->code == ErrorCode::internal;
  const auto line =
      log.line({bug ? spdlog::level::err : spdlog::level::info, Component::job, "array"}, what.client);
  if (!line) return;
  const JobSnapshot last = record.snapshot();
  const ArrayCounts counts = last.array.value_or(ArrayCounts());
  Log::Fields fields = fields_of(what);
  add(fields, {{"elements", counts.elements},
               {"done", counts.done},
               {"solved", counts.solved},
               {"failed", counts.failed},
               {"total_s", last.total_s},
               {"ended", reason ? to_string(reason->code) : "whole"},
               {"detail", reason ? reason->message() : ""}});
  log.write(*line, fields);
}

void log_session_open(const Log& log, const JobRecord& record) {
  const JobDescription& what = record.description();
  const auto line = log.line({spdlog::level::info, Component::session, "session_open"}, what.client);
  if (!line) return;
  Log::Fields fields = fields_of(what);
  fields.push_back({"memory_bytes", record.snapshot().memory_bytes});
  log.write(*line, fields);
}

void log_session_end(const Log& log, const JobRecord& record, const std::optional<Error>& reason) {
  const JobDescription& what = record.description();
  const bool bug = reason && reason->code == ErrorCode::internal;
  const auto line =
      log.line({bug ? spdlog::level::err : spdlog::level::info, Component::session, "session"}, what.client);
  if (!line) return;
  const JobSnapshot last = record.snapshot();
  Log::Fields fields = fields_of(what);
  add(fields, {{"updates", last.updates},
               {"factorizations", last.factorizations},
               {"memory_bytes", last.memory_bytes},
               {"ended", reason ? to_string(reason->code) : "closed"},
               {"detail", reason ? reason->message() : ""}});
  log.write(*line, fields);
}

}  // namespace marble::server
