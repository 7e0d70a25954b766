#include "net/connection_table.h"

#include <linux/sockios.h>
#include <linux/tcp.h>
#include <netinet/in.h>
#include <sys/epoll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "base/origin.h"

namespace marble::server {
namespace {

constexpr double kQuietBytesPerS = 16.0;  // pings and their replies, while no call is active
constexpr std::chrono::seconds kAllPeriod{1};
constexpr int kTcpClosed = 7;                   // the kernel's TCP_CLOSE: reset by the peer
constexpr std::chrono::seconds kIdleGrace{10};  // gRPC goes first: it closes idle connections gently

bool is_unix(const std::string& peer) { return peer.rfind("unix", 0) == 0; }

// Empty for a unix socket.
std::optional<std::int64_t> bytes_received(int socket) {
  tcp_info info = {};
  socklen_t length = sizeof info;
  if (getsockopt(socket, IPPROTO_TCP, TCP_INFO, &info, &length) != 0) return std::nullopt;
  return static_cast<std::int64_t>(info.tcpi_bytes_received);
}

}  // namespace

Connection::Connection(Descriptor socket, std::string peer, std::string host, Clock::time_point now)
    : socket_(std::move(socket)),
      peer_(std::move(peer)),
      host_(std::move(host)),
      opened_(now),
      last_call_(now.time_since_epoch().count()),
      looked_(now) {}

ConnectionTable::ConnectionTable(const ConnectionLimits& limits, const Log& log)
    : limits_(limits), log_(log), events_(epoll_create1(EPOLL_CLOEXEC)) {}

bool ConnectionTable::add(Descriptor copy, const std::string& peer, Clock::time_point now) {
  const int socket = copy.get();
  const std::string host = host_of(peer);
  bool taken = false;
  {
    const MutexLock lock(mutex_);
    ++usage_.accepted;
    const auto full = [&]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) -> std::optional<CloseReason> {
      const auto of_host = of_host_.find(host);
      if (of_host != of_host_.end() && of_host->second >= limits_.host) return CloseReason::host_connections;
      if (static_cast<int>(connections_.size()) >= limits_.all) return CloseReason::connections;
      return std::nullopt;
    };
    auto reason = full();
    if (reason) {
      Connection* const other = replaceable(*reason == CloseReason::host_connections ? host : "");
      if (other != nullptr) {
        close(*other, *reason);
        reason = full();
      }
    }
    if (reason) {
      count({peer, host, *reason, 0});
    } else {
      const std::shared_ptr<Connection> connection(new Connection(std::move(copy), peer, host, now));
      connections_[socket] = connection;
      ++of_host_[host];
      if (is_unix(peer)) {
        connection->known_ = true;  // authenticated by the permission to open the socket's file
      } else {
        by_peer_[peer] = connection;
        connection->unauthenticated_ = unauthenticated_.insert(unauthenticated_.end(), connection.get());
      }
      epoll_event event = {};
      event.events = EPOLLIN | EPOLLRDHUP | EPOLLET;
      event.data.fd = socket;
      epoll_ctl(events_.get(), EPOLL_CTL_ADD, socket, &event);
      taken = true;
    }
  }
  report();
  return taken;
}

// Of this host, or of all if it is empty. A connection whose callers are unknown goes first, else one
// without a call.
Connection* ConnectionTable::replaceable(const std::string& host) {
  const auto of_host = [&](const Connection& one) { return host.empty() || one.host_ == host; };
  const auto unauthenticated = std::find_if(unauthenticated_.begin(), unauthenticated_.end(),
                                            [&](const Connection* one) { return of_host(*one); });
  if (unauthenticated != unauthenticated_.end()) return *unauthenticated;
  Connection* longest = nullptr;
  for (const auto& [socket, connection] : connections_) {
    if (connection->calls_ == 0 && of_host(*connection) &&
        (longest == nullptr || connection->last_call_ < longest->last_call_))
      longest = connection.get();
  }
  return longest;
}

bool ConnectionTable::make_room() {
  bool made = false;
  {
    const MutexLock lock(mutex_);
    if (Connection* const other = replaceable(""); other != nullptr) {
      close(*other, CloseReason::descriptors);
      made = true;
    }
  }
  report();
  return made;
}

void ConnectionTable::turned_away(const std::string& peer) {
  {
    const MutexLock lock(mutex_);
    ++usage_.accepted;
    count({peer, host_of(peer), CloseReason::descriptors, 0});
  }
  report();
}

void ConnectionTable::watch(Clock::time_point now) {
  {
    const MutexLock lock(mutex_);
    std::array<epoll_event, 256> events = {};
    const auto most = static_cast<int>(events.size());
    for (int count = most; count == most;) {
      count = epoll_wait(events_.get(), events.data(), most, 0);
      for (int i = 0; i < count; ++i) {
        const epoll_event& event = events[static_cast<std::size_t>(i)];
        const auto found = connections_.find(event.data.fd);
        if (found == connections_.end()) continue;
        if ((event.events & (EPOLLHUP | EPOLLERR)) != 0) {
          forget(*found->second);
        } else {
          look(*found->second, now);
        }
      }
    }
    if (now - looked_at_all_ >= kAllPeriod) {
      looked_at_all_ = now;
      look_at_all(now);
    }
    look_at_unauthenticated();
  }
  report();
}

// Bytes that may be in memory without a call having taken them. Calls of unauthenticated clients take some
// too.
std::int64_t ConnectionTable::held(const Connection& connection) {
  const int calls = connection.known_ ? 0 : connection.calls_.load();
  return static_cast<std::int64_t>(connection.unexplained_) + Connection::kCallBytes * calls;
}

void ConnectionTable::look(Connection& connection, Clock::time_point now) {
  // In this order, all bytes that count as taken have been received.
  const std::int64_t explained = connection.explained_.exchange(0);
  const auto received = bytes_received(connection.socket_.get());
  if (!received) return;
  const double seconds = std::chrono::duration<double>(now - connection.looked_).count();
  const auto more = static_cast<double>(*received - connection.received_ - explained);
  connection.unexplained_ = std::max(0.0, connection.unexplained_ + more - kQuietBytesPerS * seconds);
  connection.received_ = *received;
  connection.looked_ = now;
  const std::int64_t calls = std::max<std::int64_t>(1, connection.calls_);
  // A message takes a little more on the wire.
  const std::int64_t share =
      connection.known_ ? calls * (limits_.message_bytes + limits_.message_bytes / 16) : 0;
  const bool pours = held(connection) > limits_.unauthenticated_bytes + share;
  if (pours) close(connection, CloseReason::flooding);
}

void ConnectionTable::look_at_all(Clock::time_point now) {
  std::vector<std::shared_ptr<Connection>> all;
  all.reserve(connections_.size());
  for (const auto& [socket, connection] : connections_) all.push_back(connection);
  for (const auto& connection : all) {
    const Clock::time_point last_call{Clock::duration(connection->last_call_)};
    const auto received = bytes_received(connection->socket_.get());
    if (received && *received == 0 && now - connection->opened_ > limits_.start) {
      close(*connection, CloseReason::silent);
    } else if (connection->calls_ == 0 && now - last_call > limits_.idle + kIdleGrace) {
      close(*connection, CloseReason::idle);
    } else {
      look(*connection, now);  // it may have more calls now than when the data arrived
    }
  }
}

void ConnectionTable::look_at_unauthenticated() {
  while (true) {
    std::int64_t all = 0;
    Connection* most = nullptr;
    for (Connection* const one : unauthenticated_) {
      all += held(*one);
      if (most == nullptr || held(*one) > held(*most)) most = one;
    }
    if (all <= limits_.all_unauthenticated_bytes) return;
    close(*most, CloseReason::flooding);
  }
}

void ConnectionTable::close(Connection& connection, CloseReason reason) {
  const int socket = connection.socket_.get();
  shutdown(socket, SHUT_RDWR);
  // gRPC does not read to the end if it is short of memory: only a reset then stops a flooding client.
  constexpr sockaddr kNobody = {.sa_family = AF_UNSPEC, .sa_data = {}};
  if (reason == CloseReason::flooding) static_cast<void>(connect(socket, &kNobody, sizeof kNobody));
  count({connection.peer_, connection.host_, reason, connection.received_});
  forget(connection);
}

void ConnectionTable::forget(Connection& connection) {
  // gRPC's descriptor of the same socket may still be open, and its events would continue.
  epoll_ctl(events_.get(), EPOLL_CTL_DEL, connection.socket_.get(), nullptr);
  if (!connection.known_) unauthenticated_.erase(connection.unauthenticated_);
  if (const auto host = of_host_.find(connection.host_); --host->second == 0) of_host_.erase(host);
  // Its port may belong to another connection by now.
  if (const auto peer = by_peer_.find(connection.peer_);
      peer != by_peer_.end() && peer->second.get() == &connection)
    by_peer_.erase(peer);
  connections_.erase(connection.socket_.get());
}

void ConnectionTable::count(Closed closed) {
  ++usage_.closed[static_cast<std::size_t>(closed.reason)];
  unreported_.push_back(std::move(closed));
}

void ConnectionTable::report() {
  std::vector<Closed> closed;
  {
    const MutexLock lock(mutex_);
    closed.swap(unreported_);
  }
  for (const Closed& one : closed) {
    const auto line = log_.line({spdlog::level::warn, Component::access, "connection_closed"}, one.host);
    if (!line) continue;
    log_.write(*line, {{"peer", one.peer},
                       {"reason", std::string(kCloseReasons[static_cast<std::size_t>(one.reason)])},
                       {"received_bytes", one.received}});
  }
}

// gRPC reads when epoll reports data; below this number of bytes it reports none (socket(7)).
void ConnectionTable::hold() {
  const MutexLock lock(mutex_);
  const int never = std::numeric_limits<int>::max();
  for (const auto& [socket, connection] : connections_) {
    if (is_unix(connection->peer_)) {
      shutdown(socket, SHUT_RDWR);
    } else {
      setsockopt(socket, SOL_SOCKET, SO_RCVLOWAT, &never, sizeof never);
    }
  }
}

std::int64_t ConnectionTable::taken_bytes() {
  const MutexLock lock(mutex_);
  std::int64_t sum = 0;
  for (const auto& [socket, connection] : connections_) {
    int waiting = 0;
    ioctl(socket, SIOCINQ, &waiting);
    sum += bytes_received(socket).value_or(waiting) - waiting;
  }
  return sum;
}

void ConnectionTable::cut_open() {
  const MutexLock lock(mutex_);
  for (const auto& [socket, connection] : connections_) {
    if (connection->own_calls_ > 0) shutdown(socket, SHUT_RDWR);
  }
}

void ConnectionTable::cut_all() {
  const MutexLock lock(mutex_);
  for (const auto& [socket, connection] : connections_) shutdown(socket, SHUT_RDWR);
}

bool ConnectionTable::all_arrived() {
  const MutexLock lock(mutex_);
  return std::all_of(connections_.begin(), connections_.end(), [](const auto& one) {
    tcp_info info = {};
    socklen_t length = sizeof info;
    const bool tcp = getsockopt(one.first, IPPROTO_TCP, TCP_INFO, &info, &length) == 0;
    int on_their_way = 0;
    ioctl(one.first, SIOCOUTQ, &on_their_way);
    return !tcp || info.tcpi_state == kTcpClosed || on_their_way == 0;
  });
}

void ConnectionTable::known(const std::string& peer) {
  const MutexLock lock(mutex_);
  const auto found = by_peer_.find(peer);
  if (found == by_peer_.end() || found->second->known_) return;
  unauthenticated_.erase(found->second->unauthenticated_);
  found->second->known_ = true;
}

std::shared_ptr<Connection> ConnectionTable::find(const std::string& peer) {
  const MutexLock lock(mutex_);
  const auto found = by_peer_.find(peer);
  return found == by_peer_.end() ? nullptr : found->second;
}

ConnectionTable::Usage ConnectionTable::usage() const {
  const MutexLock lock(mutex_);
  Usage usage = usage_;
  usage.open = static_cast<std::int64_t>(connections_.size());
  return usage;
}

}  // namespace marble::server
