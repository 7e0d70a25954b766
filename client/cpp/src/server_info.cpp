#include "marble/server_info.h"

#include "connection/connection.h"
#include "in_process/in_process.h"
#include "marble/client.h"
#include "message/status.h"

namespace marble {
namespace {

void take_limits(const v1::Limits& limits, ServerInfo& info) {
  info.message_bytes = limits.message_bytes();
  info.queue_bytes = limits.queue_bytes();
  info.solve_bytes = limits.solve_bytes();
  info.solve_seconds = limits.solve_seconds();
  info.session_bytes_limit = limits.session_bytes();
  info.result_bytes_limit = limits.result_bytes();
  info.queue_jobs = limits.queue_jobs();
  info.sessions_limit = limits.sessions();
  info.session_updates = limits.session_updates();
  info.batch_window = limits.batch_window();
  info.history_jobs = limits.history_jobs();
  info.trace_rows = limits.trace_rows();
  info.trace_pairs = limits.trace_pairs();
  info.session_idle_s = limits.session_idle_s();
  info.result_keep_s = limits.result_keep_s();
  if (!limits.has_quota()) return;
  const v1::Quota& quota = limits.quota();
  info.quota = ClientQuota{quota.running(),
                           quota.queued(),
                           quota.sessions(),
                           quota.bytes(),
                           static_cast<Priority>(static_cast<int>(quota.priority())),
                           quota.watchers()};
}

void take_counters(const v1::Counters& counters, ServerInfo& info) {
  info.accepted = counters.accepted_total();
  info.answered = counters.answered_total();
  info.solved = counters.solved_total();
  info.refused = counters.refused_total();
  info.cancelled = counters.cancelled_total();
  info.failed = counters.failed_total();
  info.sessions_opened = counters.sessions_total();
  info.updates = counters.updates_total();
  info.queued = counters.queued();
  info.running = counters.running();
  info.sessions = counters.sessions();
  info.session_bytes = counters.session_bytes();
  info.result_bytes = counters.result_bytes();
  info.request_bytes = counters.request_bytes();
  info.updates_solved = counters.updates_solved_total();
  info.busy_s = counters.busy_s_total();
  info.cpu_s = counters.cpu_s_total();
  info.resident_bytes = counters.resident_bytes();
  info.queued_by_priority = {counters.queued_realtime(), counters.queued_interactive(),
                             counters.queued_batch()};
  info.estimated_wait_s = {counters.estimated_wait_realtime_s(), counters.estimated_wait_interactive_s(),
                           counters.estimated_wait_batch_s()};
}

}  // namespace

Expected<ServerInfo> Client::info(const std::stop_token& stop) const {
  if (connection_ == nullptr) return unexpected(client::no_server());
  grpc::ClientContext context;
  connection_->prepare(context, client::kQuickCall);
  const std::stop_callback cancel_on_stop(stop, [&context] { context.TryCancel(); });
  v1::GetInfoResponse response;
  const grpc::Status status = connection_->server().GetInfo(&context, {}, &response);
  if (!status.ok()) return unexpected(client::to_error(status, stop));
  ServerInfo info;
  info.version = response.version();
  info.workers = response.workers();
  info.uptime_s = response.uptime_s();
  info.client = response.client();
  info.roles = {response.roles().begin(), response.roles().end()};
  take_limits(response.limits(), info);
  take_counters(response.counters(), info);
  return info;
}

}  // namespace marble
