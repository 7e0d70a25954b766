#include "metrics/metric_table.h"

#include <sstream>

namespace marble::server {
namespace {

std::vector<std::string> split(const std::string& text) {
  std::vector<std::string> words;
  std::istringstream stream(text);
  for (std::string word; std::getline(stream, word, ',');) words.push_back(word);
  return words;
}

}  // namespace

const std::vector<MetricInfo>& metric_table() {
  static const std::vector<MetricInfo> table = {
#define MARBLE_METRIC(kind, id, name, labels, help) {MetricKind::kind, name, split(labels), help},
#include "metrics/metrics.def"
#undef MARBLE_METRIC
  };
  return table;
}

const MetricInfo& info_of(Metric metric) { return metric_table()[static_cast<std::size_t>(metric)]; }

const char* type_of(MetricKind kind) {
  switch (kind) {
    case MetricKind::counter:
    case MetricKind::read_counter:
      return "counter";
    case MetricKind::gauge:
    case MetricKind::read_gauge:
      return "gauge";
    case MetricKind::seconds:
    case MetricKind::counts:
    case MetricKind::ratios:
      return "histogram";
  }
  return "";
}

std::vector<double> buckets_of(MetricKind kind) {
  if (kind == MetricKind::seconds) {
    return {5e-5, 1e-4, 2.5e-4, 5e-4, 1e-3, 2.5e-3, 5e-3, 1e-2, 2.5e-2, 5e-2,
            0.1,  0.25, 0.5,    1.0,  2.5,  5.0,    10.0, 25.0, 50.0,   100.0};
  }
  if (kind == MetricKind::ratios)
    return {1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 3e-3, 0.01, 0.03, 0.1, 0.3, 1.0};
  return {1, 2.5, 5, 10, 25, 50, 100, 250, 500, 1000, 2500, 5000, 10000, 25000, 50000, 100000};
}

std::string metrics_markdown() {
  std::string text = "| metric | type | labels | meaning |\n| --- | --- | --- | --- |\n";
  for (const MetricInfo& metric : metric_table()) {
    std::string labels;
    for (const std::string& label : metric.labels) labels += (labels.empty() ? "`" : ", `") + label + "`";
    text +=
        "| `" + metric.name + "` | " + type_of(metric.kind) + " | " + labels + " | " + metric.help + " |\n";
  }
  return text;
}

}  // namespace marble::server
