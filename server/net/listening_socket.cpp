#include "net/listening_socket.h"

#include <arpa/inet.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <cerrno>
#include <cstddef>
#include <cstring>
#include <memory>

namespace marble::server {
namespace {

constexpr const char* kUnixPrefix = "unix:";
constexpr const char* kAbstractPrefix = "unix-abstract:";
constexpr int kBacklog = 4096;  // bounded by the system's somaxconn

Error refused(const std::string& address, int reason) {
  const std::string why = reason == EADDRINUSE
                              ? ListeningSocket::kInUse
                              : std::string("cannot listen: ") + std::strerror(reason);  // NOLINT: one thread
  return failure(ErrorCode::unavailable, "listen", address, why);
}

void set(int socket, int level, int option, int value) {
  setsockopt(socket, level, option, &value, sizeof value);
}

int port_of(int socket) {
  sockaddr_storage name = {};
  socklen_t length = sizeof name;
  getsockname(socket, reinterpret_cast<sockaddr*>(&name), &length);
  // Both families have it in the same place.
  return ntohs(reinterpret_cast<const sockaddr_in*>(&name)->sin_port);
}

// The file of a unix socket does not show whether a process still listens on it.
bool somebody_listens(const sockaddr_un& name, socklen_t length) {
  const Descriptor probe(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  return connect(probe.get(), reinterpret_cast<const sockaddr*>(&name), length) == 0;
}

}  // namespace

Expected<ListeningSocket> ListeningSocket::open(const std::string& address,
                                                std::chrono::milliseconds silence) {
  ListeningSocket result;
  result.address_ = address;
  for (const char* prefix : {kUnixPrefix, kAbstractPrefix}) {
    if (address.rfind(prefix, 0) != 0) continue;
    MARBLE_RETURN_IF_ERROR(result.open_unix(address.substr(std::strlen(prefix)), prefix == kAbstractPrefix));
    return result;
  }
  const std::size_t colon = address.rfind(':');
  std::string host = address.substr(0, colon);
  const std::string port = colon == std::string::npos ? "" : address.substr(colon + 1);
  const bool is_port = !port.empty() && port.size() <= 5 &&
                       port.find_first_not_of("0123456789") == std::string::npos && std::stoi(port) <= 65535;
  if (host.empty() || !is_port) {
    return unexpected(failure(ErrorCode::unavailable, "listen", address,
                              "must be HOST:PORT, unix:PATH or unix-abstract:NAME"));
  }
  if (host.size() > 2 && host.front() == '[' && host.back() == ']') host = host.substr(1, host.size() - 2);
  MARBLE_RETURN_IF_ERROR(result.open_port(host, std::stoi(port), silence));
  result.address_ = address.substr(0, colon + 1) + std::to_string(port_of(result.sockets_[0].get()));
  return result;
}

Expected<void> ListeningSocket::open_unix(const std::string& path, bool abstract) {
  sockaddr_un name = {};
  name.sun_family = AF_UNIX;
  const std::size_t start = abstract ? 1 : 0;  // a zero byte marks an abstract name
  if (path.empty() || start + path.size() >= sizeof name.sun_path)
    return unexpected(refused(address_, EINVAL));
  std::memcpy(name.sun_path + start, path.data(), path.size());
  const auto length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + start + path.size());
  if (!abstract) {
    if (somebody_listens(name, length)) return unexpected(refused(address_, EADDRINUSE));
    unlink(path.c_str());
  }
  Descriptor socket(::socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (!socket || bind(socket.get(), reinterpret_cast<const sockaddr*>(&name), length) != 0 ||
      ::listen(socket.get(), kBacklog) != 0)
    return unexpected(refused(address_, errno));
  if (!abstract) file_ = path;
  sockets_.push_back(std::move(socket));
  return {};
}

Expected<void> ListeningSocket::open_port(const std::string& host, int port,
                                          std::chrono::milliseconds silence) {
  addrinfo wanted = {};
  wanted.ai_socktype = SOCK_STREAM;
  wanted.ai_flags = AI_PASSIVE;
  addrinfo* found = nullptr;
  if (const int error = getaddrinfo(host.c_str(), nullptr, &wanted, &found); error != 0) {
    return unexpected(failure(ErrorCode::unavailable, "listen", address_,
                              std::string("cannot listen: ") + gai_strerror(error)));
  }
  const std::unique_ptr<addrinfo, void (*)(addrinfo*)> all(found, freeaddrinfo);
  int reason = 0;
  for (const addrinfo* one = found; one != nullptr; one = one->ai_next) {
    sockaddr_storage name = {};
    std::memcpy(&name, one->ai_addr, one->ai_addrlen);
    reinterpret_cast<sockaddr_in*>(&name)->sin_port = htons(static_cast<std::uint16_t>(port));
    Descriptor socket(::socket(one->ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    if (!socket) {
      reason = errno;
      continue;
    }
    // Connections of a server that has just ended do not block its port. No SO_REUSEPORT: a second server
    // must fail, not take half of the calls.
    set(socket.get(), SOL_SOCKET, SO_REUSEADDR, 1);
    if (one->ai_family == AF_INET6) {
      const in6_addr& ip = reinterpret_cast<const sockaddr_in6*>(&name)->sin6_addr;
      set(socket.get(), IPPROTO_IPV6, IPV6_V6ONLY, IN6_IS_ADDR_UNSPECIFIED(&ip) ? 0 : 1);
    }
    set(socket.get(), IPPROTO_TCP, TCP_NODELAY, 1);  // connections inherit it
    set(socket.get(), IPPROTO_TCP, TCP_USER_TIMEOUT, static_cast<int>(silence.count()));
    if (bind(socket.get(), reinterpret_cast<const sockaddr*>(&name), one->ai_addrlen) != 0 ||
        ::listen(socket.get(), kBacklog) != 0) {
      reason = errno;
      if (reason == EADDRINUSE) return unexpected(refused(address_, reason));  // all addresses or none
      continue;
    }
    port = port_of(socket.get());
    sockets_.push_back(std::move(socket));
  }
  if (sockets_.empty()) return unexpected(refused(address_, reason));
  return {};
}

ListeningSocket::~ListeningSocket() {
  if (!file_.empty() && !sockets_.empty()) unlink(file_.c_str());  // first: the next server creates its own
}

std::string peer_of(int socket) {
  sockaddr_storage name = {};
  socklen_t length = sizeof name;
  if (getpeername(socket, reinterpret_cast<sockaddr*>(&name), &length) != 0) return "";
  std::string text(INET6_ADDRSTRLEN, '\0');
  const auto ip_text = [&](int family, const void* ip) {
    return inet_ntop(family, ip, text.data(), static_cast<socklen_t>(text.size())) != nullptr
               ? std::string(text.c_str())
               : std::string();
  };
  if (name.ss_family == AF_INET) {
    const auto& ip = reinterpret_cast<const sockaddr_in&>(name);
    return "ipv4:" + ip_text(AF_INET, &ip.sin_addr) + ":" + std::to_string(ntohs(ip.sin_port));
  }
  if (name.ss_family == AF_INET6) {
    const auto& ip = reinterpret_cast<const sockaddr_in6&>(name);
    const std::string port = ":" + std::to_string(ntohs(ip.sin6_port));
    if (IN6_IS_ADDR_V4MAPPED(&ip.sin6_addr))
      return "ipv4:" + ip_text(AF_INET, ip.sin6_addr.s6_addr + 12) + port;
    const std::string scope = ip.sin6_scope_id == 0 ? "" : "%25" + std::to_string(ip.sin6_scope_id);
    return "ipv6:%5B" + ip_text(AF_INET6, &ip.sin6_addr) + scope + "%5D" + port;
  }
  return "unix:";
}

}  // namespace marble::server
