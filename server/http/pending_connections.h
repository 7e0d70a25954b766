// Connections whose next request has not arrived yet. One thread waits for all of them, so that none has a
// thread of its own before its request arrives.
#pragma once

#include <functional>
#include <memory>
#include <thread>
#include <vector>

#include "http/connection.h"
#include "mutex.h"

namespace marble::server::http {

/// Thread-safe.
class PendingConnections {
 public:
  using Pending = std::shared_ptr<Connection>;
  /// Called on this object's thread with each connection whose request has arrived, or as much of it as
  /// arrived in time.
  using Handler = std::function<void(Pending)>;

  /// At most `most` wait: beyond that, the one that came first is closed.
  PendingConnections(std::size_t most, Handler handler);
  ~PendingConnections();
  PendingConnections(const PendingConnections&) = delete;
  PendingConnections& operator=(const PendingConnections&) = delete;

  void enter(Pending connection) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Closes all of them, including later ones.
  void close() ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  void run() ABSL_LOCKS_EXCLUDED(mutex_);
  void wait(const std::vector<Pending>& connections) const;
  // False once the connection no longer waits here.
  [[nodiscard]] bool look_at(const Pending& connection) const;
  [[nodiscard]] bool take_newcomers(std::vector<Pending>& connections) ABSL_LOCKS_EXCLUDED(mutex_);
  void wake() const;

  const std::size_t most_;
  const Handler handler_;
  const int bell_;  // eventfd
  Mutex mutex_;
  std::vector<Pending> newcomers_ ABSL_GUARDED_BY(mutex_);
  bool closed_ ABSL_GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

}  // namespace marble::server::http
