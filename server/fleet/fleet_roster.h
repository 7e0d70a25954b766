// Reports this server to the store every two seconds, and reads the reports of the others, on a connection of
// its own: a slow write of jobs must not make a server look lost.
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <thread>

#include "base/postgres.h"
#include "mutex.h"
#include "service/server_list.h"
#include "service/service_parts.h"

namespace marble::server {

/// Thread-safe.
class FleetRoster final : public ServerRoster {
 public:
  explicit FleetRoster(const ServiceParts& parts);
  /// Removes this server's report, if the store responded last time.
  ~FleetRoster() override;
  FleetRoster(const FleetRoster&) = delete;
  FleetRoster& operator=(const FleetRoster&) = delete;

  /// Begins to report. `address`: of the gRPC port; `page`: URL of the HTTP port, or empty; the setting
  /// public_url takes its place. For a port on all addresses, the host is this machine's name.
  void start(const std::string& address, const std::string& page);
  [[nodiscard]] ServerList servers() const override ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  using Time = std::chrono::steady_clock::time_point;
  void run() ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] bool wait() ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] Expected<ServerList> report();
  [[nodiscard]] Expected<void> connect();
  [[nodiscard]] PgStatement announcement() const;
  [[nodiscard]] ListedServer listed(const PgRows& rows, int row) const;

  const ServiceParts& parts_;
  const std::string instance_;
  std::string name_, address_, page_;
  std::optional<Postgres> database_;  // used by the thread only
  mutable Mutex mutex_;
  Condition wake_;
  ServerList list_ ABSL_GUARDED_BY(mutex_);
  std::optional<Time> read_ ABSL_GUARDED_BY(mutex_);
  bool closing_ ABSL_GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

/// Returns the address as other machines can use it: for all addresses, with the name of this machine.
[[nodiscard]] std::string reachable(const std::string& address, const std::string& host);

}  // namespace marble::server
