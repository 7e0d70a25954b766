// Requests of the HTTP port that wait for results.
#pragma once

#include <httplib.h>

#include <chrono>
#include <memory>
#include <optional>
#include <string>

#include "http/semaphore.h"
#include "service/service_parts.h"

namespace marble::server::http {

constexpr std::chrono::milliseconds kLook{100};  // between checks whether the wait is still needed

/// Returns the seconds of the parameter `wait`; 0 without it. Errors: invalid_argument.
[[nodiscard]] Expected<double> wait_of(const ServiceParts& parts, const httplib::Request& request);

/// A request that waits for a result counts as a watcher.
class Waiting {
 public:
  [[nodiscard]] static Expected<std::unique_ptr<Waiting>> begin(const ServiceParts& parts,
                                                                Semaphore& semaphore,
                                                                const std::string& client) {
    MARBLE_RETURN_IF_ERROR(parts.feeds.enter(client, parts.access.quota_of(client).watchers));
    auto waiting = std::unique_ptr<Waiting>(new Waiting(parts.feeds, client));
    MARBLE_ASSIGN_OR_RETURN(auto place, semaphore.stay());
    waiting->place_.emplace(std::move(place));
    return waiting;
  }
  ~Waiting() { feeds_.leave(client_); }
  Waiting(const Waiting&) = delete;
  Waiting& operator=(const Waiting&) = delete;

 private:
  Waiting(FeedLimit& feeds, const std::string& client) : feeds_(feeds), client_(client) {}
  FeedLimit& feeds_;
  const std::string client_;
  std::optional<Semaphore::Permit> place_;
};

}  // namespace marble::server::http
