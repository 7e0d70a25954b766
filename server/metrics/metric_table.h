// The list of all metrics, from the table metrics.def.
#pragma once

#include <string>
#include <vector>

namespace marble::server {

enum class MetricKind { counter, gauge, seconds, counts, ratios, read_counter, read_gauge };

enum class Metric {
#define MARBLE_METRIC(kind, id, name, labels, help) id,
#include "metrics/metrics.def"
#undef MARBLE_METRIC
};

struct MetricInfo {
  MetricKind kind;
  std::string name;
  std::vector<std::string> labels;  ///< names
  std::string help;
};

/// In the order of Metric.
[[nodiscard]] const std::vector<MetricInfo>& metric_table();
[[nodiscard]] const MetricInfo& info_of(Metric metric);

/// Returns the type in Prometheus's terms: "counter", "gauge" or "histogram".
[[nodiscard]] const char* type_of(MetricKind kind);
/// Returns the upper bounds of a histogram's buckets, ascending: 50 µs to 100 s, 1 to 100000, or 1e-9 to 1.
[[nodiscard]] std::vector<double> buckets_of(MetricKind kind);

/// Returns the table in Markdown: name, type, labels, help.
[[nodiscard]] std::string metrics_markdown();

}  // namespace marble::server
