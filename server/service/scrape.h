// Writes all metrics in the format of Prometheus.
#pragma once

#include <string>

namespace marble::server {

struct ServiceParts;

/// Text format 0.0.4. Values that are kept elsewhere are read now, so the numbers equal those of
/// Server.GetInfo.
[[nodiscard]] std::string scrape(const ServiceParts& parts);

inline const std::string kMetricsContentType = "text/plain; version=0.0.4; charset=utf-8";

}  // namespace marble::server
