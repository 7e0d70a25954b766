// What a supervisor such as systemd is told of the server's life: sd_notify(3)'s protocol.
#pragma once

#include <string>
#include <string_view>

namespace marble::server {

/// Tells the socket that NOTIFY_SOCKET names; without that variable, or where nobody listens, does nothing.
class Supervisor {
 public:
  /// Takes NOTIFY_SOCKET out of the environment, so that no child speaks for the server.
  Supervisor();

  void ready() const;      ///< it answers, and a reload that was told has ended
  void reloading() const;  ///< it reads its configuration again
  void stopping() const;   ///< it drains

 private:
  void tell(std::string_view state) const;

  std::string socket_;
};

}  // namespace marble::server
