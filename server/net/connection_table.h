// The connections of the gRPC port: their number, the bytes that each brings, and which ones are closed for
// it.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <list>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "base/clock.h"
#include "base/descriptor.h"
#include "log/log.h"
#include "mutex.h"

namespace marble::server {

/// Why the server closes or refuses a connection.
enum class CloseReason {
  connections,       ///< the limit on connections is reached
  host_connections,  ///< the limit per host is reached
  descriptors,       ///< the process has none left
  silent,            ///< no data arrived after it was opened
  idle,              ///< no call for a long time
  flooding,          ///< more bytes than its calls have taken
};
constexpr std::array<const char*, 6> kCloseReasons = {
    "connections", "host_connections", "descriptors", "silent", "idle", "flooding"};

struct ConnectionLimits {
  int all = 0, host = 0;
  std::int64_t unauthenticated_bytes = 0;      ///< per connection, before one of its callers is known
  std::int64_t all_unauthenticated_bytes = 0;  ///< limit on all such connections together
  std::int64_t message_bytes = 0;              ///< per call on any other connection
  Clock::duration start{}, idle{};
};

/// What calls report about their connection. Thread-safe.
class Connection {
 public:
  /// Bytes on the wire that a call and a message may take besides the message itself: headers, frames,
  /// acknowledgements of sent data. The rest is too small to abuse.
  static constexpr std::int64_t kCallBytes = 16 << 10, kMessageBytes = 1 << 10;

  /// `own`: a call to one of this server's services.
  void call_began(bool own) {
    ++calls_;
    own_calls_ += own ? 1 : 0;
  }
  void call_ended(bool own) {
    explained_ += kCallBytes;
    last_call_ = Clock::now().time_since_epoch().count();
    own_calls_ -= own ? 1 : 0;
    --calls_;
  }
  /// A message was taken, or one of no bytes was sent.
  void message(std::int64_t bytes) { explained_ += bytes + kMessageBytes; }

 private:
  friend class ConnectionTable;
  Connection(Descriptor socket, std::string peer, std::string host, Clock::time_point now);

  const Descriptor socket_;  // a copy of gRPC's: its shutdown ends the connection regardless of gRPC
  const std::string peer_, host_;
  const Clock::time_point opened_;
  std::atomic<int> calls_ = 0, own_calls_ = 0;        // open calls
  std::atomic<std::int64_t> explained_ = 0;           // bytes, since the last check
  std::atomic<Clock::rep> last_call_;                 // time when the last call ended
  std::atomic<bool> known_ = false;                   // one of its callers is authenticated
  std::list<Connection*>::iterator unauthenticated_;  // place in unauthenticated_ while unauthenticated

  // Used by the watching thread.
  Clock::time_point looked_;
  std::int64_t received_ = 0;
  double unexplained_ = 0.0;  // bytes that no call has taken yet
};

/// Thread-safe.
class ConnectionTable {
 public:
  ConnectionTable(const ConnectionLimits& limits, const Log& log);

  /// Adds a connection, if necessary in the place of the oldest one whose caller is unknown, or of the one
  /// that has been without a call for longest. False if there is no place: it is counted as closed.
  [[nodiscard]] bool add(Descriptor copy, const std::string& peer, Clock::time_point now)
      ABSL_LOCKS_EXCLUDED(mutex_);
  /// Called when the process has no descriptor left: closes a connection as add() does. False if there is
  /// none to close.
  bool make_room() ABSL_LOCKS_EXCLUDED(mutex_);
  /// Counts a connection that was refused because no descriptor was left.
  void turned_away(const std::string& peer) ABSL_LOCKS_EXCLUDED(mutex_);

  /// Removes connections that have ended, and closes those that bring too much, bring nothing or do nothing.
  /// The cost is that of the connections that have brought data since the last call, and once a second that
  /// of all.
  void watch(Clock::time_point now) ABSL_LOCKS_EXCLUDED(mutex_);

  // For the end, when no more connections are accepted.

  /// Leaves in their sockets what gRPC has not begun to read. Unix sockets do not support this in the kernel
  /// and are closed. Data that was written still arrives, in this function and the ones below.
  void hold() ABSL_LOCKS_EXCLUDED(mutex_);
  /// Returns how much gRPC has read from all connections.
  [[nodiscard]] std::int64_t taken_bytes() ABSL_LOCKS_EXCLUDED(mutex_);
  /// Closes those with open calls to this server's services.
  void cut_open() ABSL_LOCKS_EXCLUDED(mutex_);
  /// Closes all of them.
  void cut_all() ABSL_LOCKS_EXCLUDED(mutex_);
  /// True if everything that was written to them has arrived.
  [[nodiscard]] bool all_arrived() ABSL_LOCKS_EXCLUDED(mutex_);

  /// A caller on the connection of this peer, as gRPC names it, is authenticated.
  void known(const std::string& peer) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Null if it is gone, or a unix socket, about which nothing can be reported.
  [[nodiscard]] std::shared_ptr<Connection> find(const std::string& peer) ABSL_LOCKS_EXCLUDED(mutex_);

  struct Usage {
    std::int64_t open = 0, accepted = 0;
    std::array<std::int64_t, kCloseReasons.size()> closed = {};
  };
  [[nodiscard]] Usage usage() const ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] const ConnectionLimits& limits() const { return limits_; }

 private:
  struct Closed {
    std::string peer, host;
    CloseReason reason;
    std::int64_t received;
  };
  [[nodiscard]] Connection* replaceable(const std::string& host) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  [[nodiscard]] static std::int64_t held(const Connection& connection);
  void look(Connection& connection, Clock::time_point now) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void look_at_all(Clock::time_point now) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void look_at_unauthenticated() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void close(Connection& connection, CloseReason reason) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void forget(Connection& connection) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void count(Closed closed) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  /// Logs what was closed since the last time.
  void report() ABSL_LOCKS_EXCLUDED(mutex_);

  const ConnectionLimits limits_;
  const Log& log_;
  const Descriptor events_;  // epoll's, of all sockets: which have new data, which have ended
  mutable Mutex mutex_;
  std::unordered_map<int, std::shared_ptr<Connection>> connections_ ABSL_GUARDED_BY(mutex_);  // key: socket
  std::unordered_map<std::string, std::shared_ptr<Connection>> by_peer_ ABSL_GUARDED_BY(mutex_);
  std::unordered_map<std::string, int> of_host_ ABSL_GUARDED_BY(mutex_);
  std::list<Connection*> unauthenticated_ ABSL_GUARDED_BY(mutex_);  // oldest first
  std::vector<Closed> unreported_ ABSL_GUARDED_BY(mutex_);
  Usage usage_ ABSL_GUARDED_BY(mutex_);
  Clock::time_point looked_at_all_ ABSL_GUARDED_BY(mutex_) = {};
};

}  // namespace marble::server
