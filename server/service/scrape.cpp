#include "service/scrape.h"

#include <prometheus/text_serializer.h>

#include <ctime>
#include <sstream>

#include "base/process.h"
#include "base/refusal.h"
#include "config/certificates.h"
#include "marble/version.h"
#include "service/service_parts.h"
#include "store/submissions.h"

namespace marble::server {
namespace {

using Families = std::vector<prometheus::MetricFamily>;

// Writes the families whose values are read at a scrape.
class Reading {
 public:
  explicit Reading(Families families) : families_(std::move(families)) {}

  void one(Metric metric, double value) { add(family(metric), "", value); }
  void one(Metric metric, const std::string& label, double value) { add(family(metric), label, value); }
  /// Writes the family without a sample.
  void none(Metric metric) { family(metric); }
  /// Writes one sample for each value of the label.
  template <class Values, class Name>
  void each(Metric metric, const Values& values, const Name& name) {
    prometheus::MetricFamily& all = family(metric);
    for (std::size_t at = 0; at < values.size(); ++at) add(all, name(at), static_cast<double>(values[at]));
  }
  [[nodiscard]] Families families() && { return std::move(families_); }

 private:
  prometheus::MetricFamily& family(Metric metric) {
    const MetricInfo& info = info_of(metric);
    const auto type = info.kind == MetricKind::read_counter ? prometheus::MetricType::Counter
                                                            : prometheus::MetricType::Gauge;
    label_ = info.labels.empty() ? "" : info.labels[0];
    return families_.emplace_back(prometheus::MetricFamily{info.name, info.help, type, {}});
  }
  void add(prometheus::MetricFamily& family, const std::string& label, double value) const {
    prometheus::ClientMetric& sample = family.metric.emplace_back();
    if (!label_.empty()) sample.label.push_back({label_, label});
    (family.type == prometheus::MetricType::Counter ? sample.counter.value : sample.gauge.value) = value;
  }

  Families families_;
  std::string label_;  // label of the newest family, which has at most one
};

const char* priority_name(std::size_t at) { return kPriorityNames[at]; }

void read_scheduler(const Scheduler& scheduler, Reading& reading) {
  const Counters now = scheduler.counters();
  const QueueLimits& limits = scheduler.limits();
  const auto number = [](std::int64_t value) { return static_cast<double>(value); };
  reading.one(Metric::jobs_accepted, number(now.accepted));
  reading.one(Metric::jobs_answered, number(now.answered));
  reading.one(Metric::jobs_cancelled, number(now.cancelled));
  reading.one(Metric::jobs_failed, number(now.failed));
  reading.each(Metric::jobs_refused, now.refused_by_reason, refusal_name);
  reading.each(Metric::queue_jobs, now.queued_by_priority, priority_name);
  reading.one(Metric::queue_jobs_limit, limits.jobs);
  reading.one(Metric::queue_bytes, number(now.request_bytes));
  reading.one(Metric::queue_bytes_limit, number(limits.bytes));
  reading.each(Metric::queue_estimated_wait, now.estimated_wait_s, priority_name);
  reading.one(Metric::workers, limits.workers);
  reading.one(Metric::workers_busy, now.running);
  reading.one(Metric::worker_busy_seconds, now.busy_s);
  reading.one(Metric::session_updates_answered, number(now.updates));
  reading.one(Metric::draining, scheduler.is_draining() ? 1.0 : 0.0);
}

void read_bounded(const ServiceParts& parts, Reading& reading) {
  const SessionTable::Usage sessions = parts.sessions.usage();
  const auto number = [](std::int64_t value) { return static_cast<double>(value); };
  reading.one(Metric::sessions, sessions.sessions);
  reading.one(Metric::sessions_limit, parts.config.sessions);
  reading.one(Metric::sessions_opened, number(sessions.total));
  reading.one(Metric::session_memory, number(sessions.bytes));
  reading.one(Metric::session_memory_limit, number(parts.config.session_bytes));
  reading.one(Metric::watchers, parts.feeds.open());
  reading.one(Metric::watchers_limit, parts.feeds.most());
  reading.one(Metric::results_bytes, number(parts.results.bytes()));
  reading.one(Metric::results_limit, number(parts.config.result_bytes));
  const ConnectionTable::Usage connections = parts.connections.usage();
  reading.one(Metric::connections, number(connections.open));
  reading.one(Metric::connections_limit, parts.connections.limits().all);
  reading.one(Metric::connections_accepted, number(connections.accepted));
  reading.each(Metric::connections_closed, connections.closed,
               [](std::size_t at) { return kCloseReasons[at]; });
  const Access::Refused refused = parts.access.refused();
  const std::array counts = {refused.unauthenticated, refused.permission_denied};
  reading.each(Metric::access_refused, counts, [](std::size_t at) {
    return to_string(at == 0 ? ErrorCode::unauthenticated : ErrorCode::permission_denied);
  });
  reading.one(Metric::log_lines_dropped, number(parts.log.dropped()));
}

void read_store(const std::optional<StoreUsage>& usage, Reading& reading) {
  if (!usage) {
    for (const Metric metric : {Metric::state_written, Metric::state_bytes, Metric::state_commits,
                                Metric::state_changes, Metric::state_commit_seconds})
      reading.none(metric);
    return;
  }
  reading.one(Metric::state_written, usage->written ? 1.0 : 0.0);
  reading.one(Metric::state_bytes, static_cast<double>(usage->bytes));
  reading.one(Metric::state_commits, static_cast<double>(usage->commits));
  reading.one(Metric::state_changes, static_cast<double>(usage->changes));
  reading.one(Metric::state_commit_seconds, usage->commit_s);
}

void read_certificate(const Config& config, Reading& reading) {
  const auto certificates = config.tls_certificate.empty() ? unexpected(Error{}) : read_certificates(config);
  std::tm end = {};
  if (!certificates || strptime(expiry_of(*certificates).c_str(), "%Y-%m-%dT%H:%M:%SZ", &end) == nullptr)
    return reading.none(Metric::certificate_expiry);
  reading.one(Metric::certificate_expiry, static_cast<double>(timegm(&end)));
}

void read_process(Reading& reading) {
  const ProcessUsage usage = process_usage();
  const ProcessFacts facts = process_facts();
  reading.one(Metric::build_info, std::string(kVersion), 1.0);
  reading.one(Metric::process_cpu, usage.cpu_s);
  reading.one(Metric::process_memory, static_cast<double>(usage.resident_bytes));
  reading.one(Metric::process_fds, facts.open_fds);
  reading.one(Metric::process_threads, facts.threads);
  reading.one(Metric::process_start, facts.start_time_s);
}

}  // namespace

std::string scrape(const ServiceParts& parts) {
  Reading reading(parts.metrics.registry().collect());
  read_scheduler(parts.scheduler, reading);
  read_bounded(parts, reading);
  read_store(parts.submissions->usage(), reading);
  read_certificate(parts.config, reading);
  read_process(reading);
  std::ostringstream text;
  prometheus::TextSerializer().Serialize(text, std::move(reading).families());
  return text.str();
}

}  // namespace marble::server
