#include "info_service.h"

#include <algorithm>

#include "job_message.h"
#include "marble/convert.h"
#include "marble/version.h"
#include "reply.h"
#include "status.h"

namespace marble::server {
namespace {

void to_message(const Config& config, v1::Limits* message) {
  message->set_message_bytes(config.message_bytes);
  message->set_queue_jobs(config.queue_jobs);
  message->set_queue_bytes(config.queue_bytes);
  message->set_solve_bytes(config.solve_bytes);
  message->set_sessions(config.sessions);
  message->set_session_bytes(config.session_bytes);
  message->set_session_idle_s(config.session_idle_s);
  message->set_session_updates(config.session_updates);
  message->set_batch_window(config.batch_window);
  message->set_history_jobs(config.history_jobs);
  message->set_trace_rows(config.trace_rows);
  message->set_result_keep_s(config.result_keep_s);
  message->set_result_bytes(config.result_bytes);
}

/// Where the quota sets no limit, the server's is the client's.
void to_message(const Quota& quota, const Config& config, int workers, v1::Quota* message) {
  message->set_running(std::min(quota.running, workers));
  message->set_queued(std::min(quota.queued, config.queue_jobs));
  message->set_sessions(std::min(quota.sessions, config.sessions));
  message->set_bytes(std::min(quota.bytes, config.queue_bytes));
  message->set_priority(marble::server::to_message(quota.priority));
}

void to_message(const Counters& counters, v1::Counters* message) {
  message->set_accepted_total(counters.accepted);
  message->set_answered_total(counters.answered);
  message->set_solved_total(counters.solved);
  message->set_refused_total(counters.refused);
  message->set_cancelled_total(counters.cancelled);
  message->set_failed_total(counters.failed);
  message->set_updates_total(counters.updates);
  message->set_queued(counters.queued);
  message->set_running(counters.running);
}

}  // namespace

grpc::ServerUnaryReactor* InfoService::GetInfo(grpc::CallbackServerContext* context,
                                               const v1::GetInfoRequest*, v1::GetInfoResponse* response) {
  grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
  const auto identity = parts_.access.identify(*context);
  if (!identity) {
    log_refusal(parts_.log, context->peer(), "", identity.error());
    reactor->Finish(to_status(identity.error()));
    return reactor;
  }
  const int workers = parts_.scheduler.limits().workers;
  response->set_version(kVersion);
  response->set_workers(workers);
  response->set_client(identity->client);
  for (const std::string& role : identity->roles.names()) response->add_roles(role);
  to_message(parts_.config, response->mutable_limits());
  to_message(parts_.access.quota_of(identity->client), parts_.config, workers,
             response->mutable_limits()->mutable_quota());
  for (const OptionInfo& option : option_table()) {
    v1::OptionSchema* schema = response->add_options();
    marble::to_message(option, schema);
    schema->set_default_value(get_option(parts_.config.solver_defaults, option.name));
  }
  v1::Counters* counters = response->mutable_counters();
  to_message(parts_.scheduler.counters(), counters);
  const SessionTable::Usage sessions = parts_.sessions.usage();
  counters->set_sessions(sessions.sessions);
  counters->set_session_bytes(sessions.bytes);
  counters->set_sessions_total(sessions.total);
  counters->set_result_bytes(parts_.results.bytes());
  response->set_uptime_s(std::chrono::duration<double>(Clock::now() - start_).count());
  reactor->Finish(grpc::Status::OK);
  return reactor;
}

}  // namespace marble::server
