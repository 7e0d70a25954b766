#include "metrics/metric_registry.h"

namespace marble::server {
namespace {

prometheus::Labels labels_of(const MetricInfo& info, const std::vector<std::string>& values) {
  prometheus::Labels labels;
  for (std::size_t i = 0; i < info.labels.size(); ++i) labels[info.labels[i]] = values.at(i);
  return labels;
}

}  // namespace

prometheus::Counter& MetricRegistry::counter(Metric metric, const std::vector<std::string>& values) {
  const MetricInfo& info = info_of(metric);
  auto& family = prometheus::BuildCounter().Name(info.name).Help(info.help).Register(registry_);
  return family.Add(labels_of(info, values));
}

prometheus::Gauge& MetricRegistry::gauge(Metric metric, const std::vector<std::string>& values) {
  const MetricInfo& info = info_of(metric);
  auto& family = prometheus::BuildGauge().Name(info.name).Help(info.help).Register(registry_);
  return family.Add(labels_of(info, values));
}

prometheus::Histogram& MetricRegistry::histogram(Metric metric, const std::vector<std::string>& values) {
  const MetricInfo& info = info_of(metric);
  auto& family = prometheus::BuildHistogram().Name(info.name).Help(info.help).Register(registry_);
  return family.Add(labels_of(info, values), buckets_of(info.kind));
}

}  // namespace marble::server
