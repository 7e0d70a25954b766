#include "http/port_probe.h"

#include <netinet/in.h>
#include <openssl/ssl.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <memory>
#include <string>

#include "base/descriptor.h"

namespace marble::server {
namespace {

// Returns the first message of a TLS client.
std::string client_hello() {
  const std::unique_ptr<SSL_CTX, void (*)(SSL_CTX*)> context(SSL_CTX_new(TLS_client_method()), SSL_CTX_free);
  if (context == nullptr) return "";
  const std::unique_ptr<SSL, void (*)(SSL*)> session(SSL_new(context.get()), SSL_free);
  BIO* const out = BIO_new(BIO_s_mem());
  SSL_set_bio(session.get(), BIO_new(BIO_s_mem()), out);  // now owned by the session
  SSL_connect(session.get());
  std::string bytes(BIO_ctrl_pending(out), '\0');
  BIO_read(out, bytes.data(), static_cast<int>(bytes.size()));
  return bytes;
}

bool answers(int listener, bool tls, std::chrono::milliseconds patience) {
  sockaddr_storage name = {};
  socklen_t length = sizeof name;
  if (getsockname(listener, reinterpret_cast<sockaddr*>(&name), &length) != 0) return false;
  if (name.ss_family == AF_INET) {
    in_addr& ip = reinterpret_cast<sockaddr_in*>(&name)->sin_addr;
    if (ip.s_addr == htonl(INADDR_ANY)) ip.s_addr = htonl(INADDR_LOOPBACK);
  } else if (name.ss_family == AF_INET6) {
    in6_addr& ip = reinterpret_cast<sockaddr_in6*>(&name)->sin6_addr;
    if (IN6_IS_ADDR_UNSPECIFIED(&ip)) ip = in6addr_loopback;
  }
  const Descriptor client(socket(name.ss_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  // If no descriptor is left, the listener is not at fault.
  if (!client) return true;
  const auto end = std::chrono::steady_clock::now() + patience;
  const auto wait = [&](short events) {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
    pollfd waited = {client.get(), events, 0};
    return poll(&waited, 1, std::max(0, static_cast<int>(left.count()))) == 1;
  };
  if (connect(client.get(), reinterpret_cast<const sockaddr*>(&name), length) != 0 &&
      (errno != EINPROGRESS || !wait(POLLOUT)))
    return false;
  if (tls && name.ss_family != AF_UNIX) {
    const std::string hello = client_hello();
    if (send(client.get(), hello.data(), hello.size(), MSG_NOSIGNAL) < 0) return errno == EPIPE;
  }
  return wait(POLLIN);
}

}  // namespace

bool ports_answer(const std::vector<int>& listeners, bool tls, std::chrono::milliseconds patience) {
  return std::all_of(listeners.begin(), listeners.end(),
                     [&](int listener) { return answers(listener, tls, patience); });
}

}  // namespace marble::server
