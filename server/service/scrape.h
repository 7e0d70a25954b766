// All metrics as Prometheus reads them.
#pragma once

#include <string>

namespace marble::server {

struct ServiceParts;

/// Text format 0.0.4. What is kept elsewhere is read now: the numbers are those of Server.GetInfo.
[[nodiscard]] std::string scrape(const ServiceParts& parts);

inline const std::string kMetricsContentType = "text/plain; version=0.0.4; charset=utf-8";

}  // namespace marble::server
