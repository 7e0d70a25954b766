#include "info_service.h"

#include "marble/convert.h"
#include "marble/version.h"

namespace marble::server {
namespace {

void fill_limits(const Config& config, v1::Limits* limits) {
  limits->set_message_bytes(config.message_bytes);
  limits->set_queue_jobs(config.queue_jobs);
  limits->set_queue_bytes(config.queue_bytes);
  limits->set_solve_bytes(config.solve_bytes);
  limits->set_sessions(config.sessions);
  limits->set_session_bytes(config.session_bytes);
  limits->set_session_idle_s(config.session_idle_s);
  limits->set_session_updates(config.session_updates);
  limits->set_batch_window(config.batch_window);
  limits->set_history_jobs(config.history_jobs);
  limits->set_trace_rows(config.trace_rows);
  limits->set_result_keep_s(config.result_keep_s);
  limits->set_result_bytes(config.result_bytes);
}

}  // namespace

grpc::ServerUnaryReactor* InfoService::GetInfo(grpc::CallbackServerContext* context,
                                               const v1::GetInfoRequest*, v1::GetInfoResponse* response) {
  response->set_version(kVersion);
  response->set_workers(parts_.scheduler.limits().workers);
  fill_limits(parts_.config, response->mutable_limits());
  for (const OptionInfo& option : option_table()) to_message(option, response->add_options());
  const Counters counters = parts_.scheduler.counters();
  v1::Counters* message = response->mutable_counters();
  message->set_accepted_total(counters.accepted);
  message->set_answered_total(counters.answered);
  message->set_solved_total(counters.solved);
  message->set_refused_total(counters.refused);
  message->set_cancelled_total(counters.cancelled);
  message->set_failed_total(counters.failed);
  message->set_updates_total(counters.updates);
  const SessionTable::Usage sessions = parts_.sessions.usage();
  message->set_sessions(sessions.sessions);
  message->set_session_bytes(sessions.bytes);
  message->set_sessions_total(sessions.total);
  message->set_result_bytes(parts_.results.bytes());
  message->set_queued(counters.queued);
  message->set_running(counters.running);
  response->set_uptime_s(std::chrono::duration<double>(Clock::now() - start_).count());
  grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
  reactor->Finish(grpc::Status::OK);
  return reactor;
}

}  // namespace marble::server
