#include "service/server_info.h"

#include <algorithm>

#include "base/process.h"
#include "marble/convert.h"
#include "marble/version.h"
#include "service/job_message.h"
#include "service/service_parts.h"

namespace marble::server {
namespace {

/// Copies the settings that the message has; tests/proto compares the names. A template, so that all other
/// settings are skipped.
template <class Limits>
void to_message(const Config& config, Limits* limits) {
#define MARBLE_SETTING(type, name, ...) \
  if constexpr (requires { limits->set_##name(config.name); }) limits->set_##name(config.name);
#define MARBLE_TEXT_SETTING(...)
#include "config/config.def"
#undef MARBLE_SETTING
#undef MARBLE_TEXT_SETTING
}

/// Where the quota sets no limit, the server's limit applies to the client.
void to_message(const Quota& quota, const Config& config, int workers, v1::Quota* message) {
  message->set_running(std::min(quota.running, workers));
  message->set_queued(std::min(quota.queued, config.queue_jobs));
  message->set_sessions(std::min(quota.sessions, config.sessions));
  message->set_bytes(std::min(quota.bytes, config.queue_bytes));
  message->set_watchers(std::min(quota.watchers, config.watchers));
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
  message->set_updates_solved_total(counters.updates_solved);
  message->set_busy_s_total(counters.busy_s);
  message->set_request_bytes(counters.request_bytes);
  message->set_queued(counters.queued);
  message->set_running(counters.running);
  const auto at = [](Priority priority) { return static_cast<std::size_t>(priority); };
  message->set_queued_realtime(counters.queued_by_priority[at(Priority::realtime)]);
  message->set_queued_interactive(counters.queued_by_priority[at(Priority::interactive)]);
  message->set_queued_batch(counters.queued_by_priority[at(Priority::batch)]);
  message->set_estimated_wait_realtime_s(counters.estimated_wait_s[at(Priority::realtime)]);
  message->set_estimated_wait_interactive_s(counters.estimated_wait_s[at(Priority::interactive)]);
  message->set_estimated_wait_batch_s(counters.estimated_wait_s[at(Priority::batch)]);
}

}  // namespace

void fill_counters(const ServiceParts& parts, v1::Counters* message) {
  to_message(parts.scheduler.counters(), message);
  const SessionTable::Usage sessions = parts.sessions.usage();
  message->set_sessions(sessions.sessions);
  message->set_session_bytes(sessions.bytes);
  message->set_sessions_total(sessions.total);
  message->set_result_bytes(parts.results.bytes());
  const ProcessUsage process = process_usage();
  message->set_resident_bytes(process.resident_bytes);
  message->set_cpu_s_total(process.cpu_s);
}

void fill_info(const ServiceParts& parts, const Identity& caller, v1::GetInfoResponse* response) {
  const int workers = parts.scheduler.limits().workers;
  response->set_version(kVersion);
  response->set_workers(workers);
  response->set_client(caller.client);
  for (const std::string& role : caller.roles.names()) response->add_roles(role);
  to_message(parts.config, response->mutable_limits());
  to_message(parts.access.quota_of(caller.client), parts.config, workers,
             response->mutable_limits()->mutable_quota());
  for (const OptionInfo& option : option_table()) {
    v1::OptionSchema* schema = response->add_options();
    marble::to_message(option, schema);
    schema->set_default_value(get_option(parts.config.solver_defaults, option.name));
  }
  fill_counters(parts, response->mutable_counters());
  response->set_uptime_s(std::chrono::duration<double>(Clock::now() - parts.started).count());
}

}  // namespace marble::server
