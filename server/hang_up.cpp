#include "hang_up.h"

#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <set>

#include "config.h"

namespace marble::server {
namespace {

std::string port_or_path(const std::string& address) {
  return is_unix_address(address) ? address : address.substr(address.rfind(':') + 1);
}

// The port or path that the socket has on our side; empty if it is no socket of these kinds.
std::string own_port_or_path(int socket) {
  sockaddr_storage name = {};
  socklen_t length = sizeof name;
  if (getsockname(socket, reinterpret_cast<sockaddr*>(&name), &length) != 0) return "";
  switch (name.ss_family) {
    case AF_INET:
      return std::to_string(ntohs(reinterpret_cast<const sockaddr_in&>(name).sin_port));
    case AF_INET6:
      return std::to_string(ntohs(reinterpret_cast<const sockaddr_in6&>(name).sin6_port));
    case AF_UNIX: {
      const char* path = reinterpret_cast<const sockaddr_un&>(name).sun_path;
      const std::size_t size = length - offsetof(sockaddr_un, sun_path);
      if (size == 0) return "";
      return path[0] != '\0' ? "unix:" + std::string(path, strnlen(path, size))
                             : "unix-abstract:" + std::string(path + 1, size - 1);
    }
    default:
      return "";
  }
}

bool listens(int socket) {
  int listening = 0;
  socklen_t length = sizeof listening;
  return getsockopt(socket, SOL_SOCKET, SO_ACCEPTCONN, &listening, &length) == 0 && listening != 0;
}

}  // namespace

void hang_up(const std::vector<std::string>& addresses) {
  std::set<std::string> own;
  for (const std::string& address : addresses) own.insert(port_or_path(address));
  for (const bool listening : {true, false}) {  // or whoever is cut off is back at once
    std::error_code ignored;
    for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd", ignored)) {
      const int socket = std::atoi(entry.path().filename().c_str());
      if (own.count(own_port_or_path(socket)) != 0 && listens(socket) == listening)
        shutdown(socket, SHUT_RDWR);
    }
  }
}

}  // namespace marble::server
