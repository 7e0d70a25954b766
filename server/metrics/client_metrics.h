// Counts what each client has solved, for a bounded number of clients.
#pragma once

#include <string>
#include <unordered_map>

#include "metrics/metric_registry.h"
#include "mutex.h"

namespace marble::server {

/// Thread-safe.
class ClientMetrics {
 public:
  /// The first `most` clients have series of their own, later ones share "other"; with 0, all clients do.
  ClientMetrics(MetricRegistry& registry, int most) : registry_(registry), most_(most) {}

  void solved(const std::string& client, double solve_s) ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  struct Series {
    prometheus::Counter* solves = nullptr;
    prometheus::Counter* solve_s = nullptr;
  };
  [[nodiscard]] Series series_of(const std::string& client) ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] Series make(const std::string& label);

  MetricRegistry& registry_;
  const int most_;
  Mutex mutex_;
  std::unordered_map<std::string, Series> known_ ABSL_GUARDED_BY(mutex_);
  Series other_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace marble::server
