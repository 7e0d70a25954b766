#include "marble/server_info.h"

#include "connection/connection.h"
#include "in_process/in_process.h"
#include "marble/client.h"
#include "message/status.h"

namespace marble {
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
