#include "http/connection.h"

#include <fcntl.h>
#include <netdb.h>
#include <openssl/err.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>

namespace marble::server::http {
namespace {

constexpr std::chrono::milliseconds kStopCheck{200};
constexpr int kSendBuffer =
    256 << 10;  // bytes: a reader that is slower misses events instead of getting old ones

void address_of(const sockaddr_storage& address, socklen_t length, std::string& ip, int& port) {
  char host[NI_MAXHOST], service[NI_MAXSERV];
  if (getnameinfo(reinterpret_cast<const sockaddr*>(&address), length, host, sizeof host, service,
                  sizeof service, NI_NUMERICHOST | NI_NUMERICSERV) != 0)
    return;
  ip = host;
  port = std::atoi(service);
}

}  // namespace

Connection::Connection(int socket, const std::atomic<bool>& stopping) : socket_(socket), stopping_(stopping) {
  fcntl(socket_, F_SETFL, fcntl(socket_, F_GETFL) | O_NONBLOCK);
  setsockopt(socket_, SOL_SOCKET, SO_SNDBUF, &kSendBuffer, sizeof kSendBuffer);
}

Connection::~Connection() {
  if (shaken_) SSL_shutdown(session_.get());
  ERR_clear_error();
  session_.reset();
  // What was sent but not read is taken away: closing over it would tear down the answer on its way too.
  ::shutdown(socket_, SHUT_WR);
  const auto until = Clock::now() + kLinger;
  for (bool more = true; more;) {
    const ssize_t got = recv(socket_, buffer_.data(), buffer_.size(), 0);
    more = got > 0 ? Clock::now() < until : got < 0 && errno == EAGAIN && lingers_ && wait(POLLIN, until);
  }
  close(socket_);
}

bool Connection::wait(short events, Clock::time_point until) const {
  while (true) {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(until - Clock::now());
    if (left.count() < 0) return false;
    pollfd entry = {socket_, events, 0};
    const int ready = poll(&entry, 1, stopping_ ? 0 : static_cast<int>(std::min(left, kStopCheck).count()));
    if (ready > 0) return true;
    if (stopping_ || (ready < 0 && errno != EINTR)) return false;
  }
}

short Connection::awaited(int result) const {
  switch (SSL_get_error(session_.get(), result)) {
    case SSL_ERROR_WANT_READ:
      return POLLIN;
    case SSL_ERROR_WANT_WRITE:
      return POLLOUT;
    default:
      return 0;
  }
}

bool Connection::shake_hands(TlsSession session) {
  session_ = std::move(session);
  if (session_ == nullptr) return false;
  const auto until = Clock::now() + kRequestTime;
  while (true) {
    ERR_clear_error();
    const int result = SSL_accept(session_.get());
    shaken_ = result == 1;
    if (shaken_) return true;
    const short events = awaited(result);
    if (events == 0 || !wait(events, until)) return false;
  }
}

bool Connection::fill(Clock::time_point until) {
  begin_ = end_ = 0;
  while (true) {
    short events = POLLIN;
    if (session_ != nullptr) {
      ERR_clear_error();
      const int got = SSL_read(session_.get(), buffer_.data(), static_cast<int>(buffer_.size()));
      if (got > 0) end_ = static_cast<std::size_t>(got);
      if (got <= 0) events = awaited(got);
    } else {
      const ssize_t got = recv(socket_, buffer_.data(), buffer_.size(), 0);
      if (got > 0) end_ = static_cast<std::size_t>(got);
      if (got == 0 || (got < 0 && errno != EAGAIN && errno != EINTR)) events = 0;
    }
    if (end_ > 0) return true;
    if (events == 0 || !wait(events, until)) return false;
  }
}

bool Connection::wait_for_request(Clock::duration patience) {
  if (stopping_ || (begin_ == end_ && !fill(Clock::now() + patience))) return false;
  left_ = kLongestRequest;
  until_ = Clock::now() + kRequestTime;
  return true;
}

ssize_t Connection::read(char* bytes, std::size_t size) {
  if (left_ == 0 || (begin_ == end_ && !fill(until_))) return -1;
  const std::size_t taken = std::min({size, end_ - begin_, left_});
  std::memcpy(bytes, buffer_.data() + begin_, taken);
  begin_ += taken;
  left_ -= taken;
  return static_cast<ssize_t>(taken);
}

ssize_t Connection::write(const char* bytes, std::size_t size) {
  const auto until = Clock::now() + kWriteTime;
  while (true) {
    short events = POLLOUT;
    if (session_ != nullptr) {
      ERR_clear_error();
      const int sent =
          SSL_write(session_.get(), bytes, static_cast<int>(std::min(size, std::size_t{1} << 20)));
      if (sent > 0) return sent;
      events = awaited(sent);
    } else {
      const ssize_t sent = send(socket_, bytes, size, MSG_NOSIGNAL);
      if (sent >= 0) return sent;
      if (errno != EAGAIN && errno != EINTR) return -1;
    }
    if (events == 0 || !wait(events, until)) return -1;
  }
}

void Connection::get_remote_ip_and_port(std::string& ip, int& port) const {
  sockaddr_storage address;
  socklen_t length = sizeof address;
  if (getpeername(socket_, reinterpret_cast<sockaddr*>(&address), &length) == 0)
    address_of(address, length, ip, port);
}

void Connection::get_local_ip_and_port(std::string& ip, int& port) const {
  sockaddr_storage address;
  socklen_t length = sizeof address;
  if (getsockname(socket_, reinterpret_cast<sockaddr*>(&address), &length) == 0)
    address_of(address, length, ip, port);
}

}  // namespace marble::server::http
