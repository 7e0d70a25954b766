// Provides sockets on this machine.
#pragma once

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdint>
#include <stdexcept>
#include <string>

namespace marble::testing {

/// An address for bind and connect: a port of 127.0.0.1, 0 for any free one.
[[nodiscard]] inline sockaddr_in loopback(int port = 0) {
  sockaddr_in name = {};
  name.sin_family = AF_INET;
  name.sin_port = htons(static_cast<std::uint16_t>(port));
  name.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return name;
}
/// Of "127.0.0.1:4711", or of a URL that ends in its port.
[[nodiscard]] inline sockaddr_in loopback(const std::string& address) {
  return loopback(std::stoi(address.substr(address.rfind(':') + 1)));
}

/// Listens with a TCP socket. Returns the port; throws if it is taken.
inline int listen_on(int listener, sockaddr_in name) {
  socklen_t size = sizeof name;
  if (bind(listener, reinterpret_cast<const sockaddr*>(&name), size) != 0 || listen(listener, 16) != 0 ||
      getsockname(listener, reinterpret_cast<sockaddr*>(&name), &size) != 0)
    throw std::runtime_error("cannot listen on port " + std::to_string(ntohs(name.sin_port)));
  return ntohs(name.sin_port);
}

/// Connects a TCP socket to the port of an address or a URL; throws if nothing listens there.
inline void connect_to(const std::string& address, int one) {
  const sockaddr_in name = loopback(address);
  if (connect(one, reinterpret_cast<const sockaddr*>(&name), sizeof name) != 0)
    throw std::runtime_error("cannot connect to " + address);
}

/// Returns a connected TCP socket, which is the caller's to close.
[[nodiscard]] inline int connected_to(const std::string& address) {
  const int one = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  try {
    connect_to(address, one);
  } catch (const std::runtime_error&) {
    close(one);
    throw;
  }
  return one;
}

/// Returns a port that no process has at this moment.
[[nodiscard]] inline int free_port() {
  const int probe = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const int port = listen_on(probe, loopback());
  close(probe);
  return port;
}

}  // namespace marble::testing
