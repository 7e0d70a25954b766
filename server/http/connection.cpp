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
constexpr std::size_t kFirstBuffer = 4096;  // bytes; grows with a request's head
constexpr int kSendBuffer = 256 << 10;  // bytes: a slower reader misses events instead of getting old ones

void address_of(const sockaddr_storage& address, socklen_t length, std::string& ip, int& port) {
  char host[NI_MAXHOST], service[NI_MAXSERV];
  if (getnameinfo(reinterpret_cast<const sockaddr*>(&address), length, host, sizeof host, service,
                  sizeof service, NI_NUMERICHOST | NI_NUMERICSERV) != 0)
    return;
  ip = host;
  port = std::atoi(service);
}

}  // namespace

Connection::Connection(int socket, TlsSession session, Clock::duration line_time, double answer_rate,
                       const std::atomic<Clock::time_point>& stop)
    : socket_(socket),
      stop_(stop),
      session_(std::move(session)),
      line_time_(line_time),
      answer_rate_(answer_rate),
      buffer_(kFirstBuffer) {
  fcntl(socket_, F_SETFL, fcntl(socket_, F_GETFL) | O_NONBLOCK);
  setsockopt(socket_, SOL_SOCKET, SO_SNDBUF, &kSendBuffer, sizeof kSendBuffer);
}

Connection::~Connection() {
  if (shaken_) SSL_shutdown(session_.get());
  ERR_clear_error();
  // Data that was sent but not read is read and discarded: closing with it would also destroy the reply in
  // transit.
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
    const Clock::time_point stop = stop_;
    const bool may_wait = events == POLLOUT || stop == Clock::time_point::max();
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(std::min(until, stop) - Clock::now());
    if (may_wait && left.count() < 0) return false;
    pollfd entry = {socket_, events, 0};
    const int ready = poll(&entry, 1, may_wait ? static_cast<int>(std::min(left, kStopCheck).count()) : 0);
    if (ready > 0) return true;
    if (!may_wait || (ready < 0 && errno != EINTR)) return false;
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

ssize_t Connection::take(std::size_t most) {
  char* const to = buffer_.data() + end_;
  ssize_t got = 0;
  if (session_ != nullptr) {
    ERR_clear_error();
    const int result =
        shaken_ ? SSL_read(session_.get(), to, static_cast<int>(most)) : SSL_accept(session_.get());
    if (result == 1 && !shaken_) {
      shaken_ = true;
      since_ = Clock::now();
      return take(most);
    }
    got = result;
    awaited_ = result > 0 ? POLLIN : awaited(result);
  } else {
    got = recv(socket_, to, most, 0);
    awaited_ = got > 0 || (got < 0 && (errno == EAGAIN || errno == EINTR)) ? POLLIN : 0;
  }
  if (got <= 0) return awaited_ != 0 ? 0 : -1;
  if (begin_ == end_) begun_ = Clock::now();
  end_ += static_cast<std::size_t>(got);
  return got;
}

Connection::Arrival Connection::receive() {
  if (begin_ > 0) {
    std::memmove(buffer_.data(), buffer_.data() + begin_, end_ - begin_);
    end_ -= begin_;
    begin_ = 0;
  }
  while (arrival() != Arrival::head) {
    if (end_ == buffer_.size()) buffer_.resize(std::min(2 * end_, kLongestRequest));
    const ssize_t got = take(buffer_.size() - end_);
    if (got < 0) return arrived_ = Arrival::closed;
    if (got == 0) break;
  }
  return arrived_;
}

// A head of the maximum length is not waited for any longer. No byte is examined twice: a client that sends
// byte by byte would otherwise cost the square of the length.
Connection::Arrival Connection::arrival() {
  const std::string_view here = received();
  const bool line = arrived_ == Arrival::line || here.find('\n', scanned_) != std::string_view::npos;
  const bool head = here.find("\r\n\r\n", scanned_) != std::string_view::npos || end_ >= kLongestRequest;
  scanned_ = here.size() - std::min<std::size_t>(here.size(), 3);
  if (head) return arrived_ = Arrival::head;
  if (line) return arrived_ = Arrival::line;
  return arrived_ = here.empty() ? Arrival::nothing : Arrival::begun;
}

Clock::time_point Connection::due() const {
  if (arrived_ == Arrival::nothing)
    return since_ + (requests_ == 0 ? line_time_ : Clock::duration(kIdleTime));
  return begun_ + (arrived_ == Arrival::begun ? line_time_ : Clock::duration(kRequestTime));
}

int Connection::begin_request() {
  left_ = kLongestRequest;
  until_ = std::min(begun_ + kRequestTime, Clock::now() + line_time_);
  may_wait_ = kWriteTime;
  return ++requests_;
}

void Connection::await_next() {
  since_ = begun_ = Clock::now();
  arrived_ = Arrival::nothing;
  scanned_ = 0;
}

bool Connection::fill(Clock::time_point until) {
  begin_ = end_ = 0;
  while (true) {
    const ssize_t got = take(buffer_.size());
    if (got != 0) return got > 0;
    if (!wait(awaited_, until)) return false;
  }
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
  const auto begin = Clock::now();
  const auto until = begin + std::min<Clock::duration>(kWriteTime, may_wait_);
  ssize_t sent = 0;
  while (true) {
    short events = POLLOUT;
    if (session_ != nullptr) {
      ERR_clear_error();
      sent = SSL_write(session_.get(), bytes, static_cast<int>(std::min(size, std::size_t{1} << 20)));
      if (sent <= 0) events = awaited(static_cast<int>(sent));
    } else {
      sent = send(socket_, bytes, size, MSG_NOSIGNAL);
      if (sent < 0 && errno != EAGAIN && errno != EINTR) return -1;
    }
    if (sent > 0 || size == 0) break;
    if (events == 0 || !wait(events, until)) return -1;
  }
  const std::chrono::duration<double> earned(static_cast<double>(sent) / answer_rate_);
  may_wait_ += std::chrono::duration_cast<Clock::duration>(earned) - (Clock::now() - begin);
  return sent;
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
