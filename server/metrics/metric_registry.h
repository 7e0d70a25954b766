// The metrics that are counted where their events happen. Creates each series once; the counting code keeps
// it.
#pragma once

#include <prometheus/counter.h>
#include <prometheus/gauge.h>
#include <prometheus/histogram.h>
#include <prometheus/registry.h>

#include "metrics/metric_table.h"

namespace marble::server {

/// Thread-safe; so are the series. A series is created at its first request, takes a lock and some hashing,
/// and lives as long as the registry.
class MetricRegistry {
 public:
  /// `values` are the labels' values, in the order of the metric's labels.
  [[nodiscard]] prometheus::Counter& counter(Metric metric, const std::vector<std::string>& values = {});
  [[nodiscard]] prometheus::Gauge& gauge(Metric metric, const std::vector<std::string>& values = {});
  [[nodiscard]] prometheus::Histogram& histogram(Metric metric, const std::vector<std::string>& values = {});

  [[nodiscard]] std::vector<prometheus::MetricFamily> collect() const { return registry_.Collect(); }

 private:
  prometheus::Registry registry_;
};

}  // namespace marble::server
