#include "marble/server_info.h"

#include "message/status.h"
#include "remote/calls.h"

namespace marble::client {
namespace {

void take_limits(const v1::Limits& limits, ServerInfo& info) {
#define MARBLE_LIMIT(type, name, field, doc) info.name = limits.field();
#include "marble/server_info.def"
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
#define MARBLE_COUNTER(type, name, field, doc) info.name = counters.field();
#include "marble/server_info.def"
  info.queued_by_priority = {counters.queued_realtime(), counters.queued_interactive(),
                             counters.queued_batch()};
  info.estimated_wait_s = {counters.estimated_wait_realtime_s(), counters.estimated_wait_interactive_s(),
                           counters.estimated_wait_batch_s()};
}

}  // namespace

Expected<ServerInfo> server_info(const Connection& connection, const std::stop_token& stop) {
  grpc::ClientContext context;
  connection.prepare(context, kQuickCall);
  const std::stop_callback cancel_on_stop(stop, [&context] { context.TryCancel(); });
  v1::GetInfoResponse response;
  const grpc::Status status = connection.server().GetInfo(&context, {}, &response);
  if (!status.ok()) return unexpected(to_error(status, stop));
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

}  // namespace marble::client
