// httplib's server with its own management of connections: they wait for requests without a thread; bounded
// requests, certificates that can be renewed, a quick end.
#pragma once

#include <httplib.h>

#include <atomic>
#include <functional>
#include <memory>
#include <utility>

#include "http/pending_connections.h"
#include "http/task_queue.h"
#include "http/tls_session.h"

namespace marble::server::http {

class BoundedServer final : public httplib::Server {
 public:
  /// `tls` is null without TLS. At most `connections` are served at once, each by a thread, and as many wait
  /// for their request to arrive; its first line has `line_time`, and a client must read a reply at
  /// `answer_rate` or faster.
  BoundedServer(std::unique_ptr<TlsSessions> tls, int connections, Clock::duration line_time,
                double answer_rate);

  static constexpr std::size_t kOrdinaryBody = 1 << 16;  ///< bytes
  /// The maximum length of a request's body, and the minimum rate at which a body beyond the ordinary length
  /// must arrive.
  struct Bodies {
    std::function<std::size_t(const httplib::Request&)> longest;
    double bytes_per_s = 1.0;
  };
  void set_bodies(Bodies bodies) { bodies_ = std::move(bodies); }
  /// True if a request announces a body that is too long, which is then not read.
  [[nodiscard]] bool is_too_long(const httplib::Request& request) const;

  /// Returns the encodings that a client accepts: its Accept-Encoding, lines joined by commas, or empty.
  [[nodiscard]] static std::string accepted_encodings(const httplib::Request& request);
  /// Returns why the head of a request is invalid, or empty.
  [[nodiscard]] static std::string fault_of(const httplib::Request& request);

  /// Called after a port was bound, because many clients may connect at once: httplib's backlog of five
  /// overflows, and the sixth client waits a second until its kernel retries.
  void set_listen_backlog() { ::listen(svr_sock_, SOMAXCONN); }
  /// Returns when all requests that have arrived have their replies, or in about this time: no request is
  /// waited for any more, and clients have this long to read their replies. Call it before stop(), after
  /// which httplib sends no more of a reply.
  void finish(Clock::duration time);

 private:
  bool process_and_close_socket(socket_t socket) override;
  [[nodiscard]] TaskQueue& queue_for(std::string_view request);
  void serve(const PendingConnections::Pending& connection);

  const std::unique_ptr<TlsSessions> tls_;
  const Clock::duration line_time_;
  const double answer_rate_;  // bytes/s
  Bodies bodies_;
  std::atomic<Clock::time_point> stop_ = Clock::time_point::max();  // the end of all replies
  TaskQueue requests_;
  TaskQueue healthz_{1}, readyz_{1};  // a probe waits for no request and for no other probe
  PendingConnections pending_connections_;
};

}  // namespace marble::server::http
