// The sockets that listen on one address.
#pragma once

#include <chrono>
#include <string>
#include <vector>

#include "base/descriptor.h"
#include "marble/error.h"

namespace marble::server {

/// Removes a unix socket's file at its end.
class ListeningSocket {
 public:
  /// `address` is HOST:PORT, [HOST]:PORT, unix:PATH or unix-abstract:NAME. A name stands for all of its
  /// addresses; an IPv4 address listens on IPv4 only, [::] on both. A peer that does not acknowledge sent
  /// data for `silence` counts as dead. Errors: unavailable, with the reason; `bound` is kInUse if another
  /// process uses the address.
  [[nodiscard]] static Expected<ListeningSocket> open(const std::string& address,
                                                      std::chrono::milliseconds silence);
  static constexpr const char* kInUse = "cannot listen: in use by another process";

  ~ListeningSocket();
  ListeningSocket(ListeningSocket&&) = default;
  ListeningSocket& operator=(ListeningSocket&&) = delete;

  [[nodiscard]] const std::vector<Descriptor>& sockets() const { return sockets_; }
  /// As given, with the assigned port in place of 0.
  [[nodiscard]] const std::string& address() const { return address_; }

 private:
  ListeningSocket() = default;
  [[nodiscard]] Expected<void> open_unix(const std::string& path, bool abstract);
  [[nodiscard]] Expected<void> open_port(const std::string& host, int port,
                                         std::chrono::milliseconds silence);

  std::string address_;
  std::vector<Descriptor> sockets_;
  std::string file_;  // path of a unix socket
};

/// Returns a peer as gRPC names it: "ipv4:127.0.0.1:4711", "ipv6:%5B::1%5D:4711", "unix:".
[[nodiscard]] std::string peer_of(int socket);

}  // namespace marble::server
