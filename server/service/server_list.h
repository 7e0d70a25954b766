// The servers that share a store, as they reported themselves to it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "marble/error.h"

namespace marble::server {

struct ListedServer {
  std::string name;     ///< HOST:PORT
  std::string address;  ///< of its gRPC port
  std::string page;     ///< URL of its page; empty if it has none
  std::string version;
  std::string state;  ///< "serving" or "draining"
  bool is_this = false;
  bool is_lost = false;  ///< it has been silent for longer than a lease
  double seen_s = 0.0;   ///< seconds since its last report
  double uptime_s = 0.0;
  std::int64_t workers = 0, running = 0, queued = 0, sessions = 0;
  std::int64_t answered = 0, solved = 0;  ///< in the last minute, as the next two
  double median_s = 0.0, p99_s = 0.0;     ///< NaN: there were no results
};

struct ServerList {
  std::vector<ListedServer> servers;  ///< by name
  std::int64_t waiting = 0;           ///< submitted jobs that no server has taken yet
  double age_s = 0.0;                 ///< seconds since the list was read
  std::optional<Error> error;         ///< why it is older than usual, or empty
};

/// Thread-safe.
class ServerRoster {
 public:
  virtual ~ServerRoster() = default;
  [[nodiscard]] virtual ServerList servers() const = 0;
};

}  // namespace marble::server
