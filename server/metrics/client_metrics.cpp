#include "metrics/client_metrics.h"

#include <algorithm>

namespace marble::server {
namespace {

// A name in a certificate may contain any bytes; the text format requires UTF-8.
std::string printable(std::string name) {
  std::replace_if(
      name.begin(), name.end(), [](unsigned char c) { return c < 0x20 || c >= 0x7f; }, '?');
  return name;
}

}  // namespace

void ClientMetrics::solved(const std::string& client, double solve_s) {
  if (most_ == 0) return;
  const Series series = series_of(client);
  series.solves->Increment();
  series.solve_s->Increment(solve_s);
}

ClientMetrics::Series ClientMetrics::series_of(const std::string& client) {
  const MutexLock lock(mutex_);
  if (const auto known = known_.find(client); known != known_.end()) return known->second;
  if (known_.size() < static_cast<std::size_t>(most_))
    return known_.emplace(client, make(printable(client))).first->second;
  if (other_.solves == nullptr) other_ = make("other");
  return other_;
}

ClientMetrics::Series ClientMetrics::make(const std::string& label) {
  return {&registry_.counter(Metric::client_solves, {label}),
          &registry_.counter(Metric::client_solve_seconds, {label})};
}

}  // namespace marble::server
