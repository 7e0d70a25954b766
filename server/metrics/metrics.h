// Counts jobs, sessions and streams at their events.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "base/priority.h"
#include "marble/error.h"
#include "marble/solution.h"
#include "metrics/metric_registry.h"

namespace marble::server {

/// A job, or an update of a session, that has ended.
struct EndedJob {
  const std::string& client;
  Priority priority = Priority::interactive;
  double queue_s = 0.0;
  std::optional<double> setup_s = {};  ///< if it was set up
  const Solution* solution = nullptr;  ///< null if nothing was solved
};

/// Thread-safe, and cheap: a few atomic additions per job, none per iteration.
class Metrics {
 public:
  /// If off, it counts nothing. `clients` have series of their own.
  Metrics(bool on, int clients);
  ~Metrics();
  Metrics(const Metrics&) = delete;
  Metrics& operator=(const Metrics&) = delete;

  [[nodiscard]] bool on() const { return counted_ != nullptr; }
  /// For other modules that count their own events.
  [[nodiscard]] MetricRegistry& registry() { return registry_; }
  [[nodiscard]] const MetricRegistry& registry() const { return registry_; }

  void job_ended(const EndedJob& job);
  void update_superseded();
  void session_restarted();
  void update_refused(const Error& error);
  /// `skipped`: rows dropped before these, since the last that were sent.
  void progress_sent(std::size_t rows, std::int64_t skipped);

 private:
  void count_tree(const Solution& solution);

  struct Counted;
  MetricRegistry registry_;
  const std::unique_ptr<Counted> counted_;  // null if off
};

}  // namespace marble::server
