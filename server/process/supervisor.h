// Notifies a supervisor such as systemd of the server's state, by the protocol of sd_notify(3).
#pragma once

#include <string>
#include <string_view>

namespace marble::server {

/// Notifies the socket in NOTIFY_SOCKET; without that variable, or without a listener, does nothing.
class Supervisor {
 public:
  /// Removes NOTIFY_SOCKET from the environment, so that no child process can notify for the server.
  Supervisor();

  void ready() const;      ///< reports that it serves, and that a reload has ended
  void reloading() const;  ///< reports that it reads its configuration again
  void stopping() const;   ///< reports that it drains

 private:
  void report(std::string_view state) const;

  std::string socket_;
};

}  // namespace marble::server
