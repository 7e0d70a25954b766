// httplib's server with connections of our own: they wait for their requests without a thread; bounded
// requests, certificates that can be renewed, a quick end.
#pragma once

#include <httplib.h>

#include <atomic>
#include <functional>
#include <memory>
#include <utility>

#include "http/transport/lobby.h"
#include "http/transport/task_queue.h"
#include "http/transport/tls_session.h"

namespace marble::server::http {

class BoundedServer final : public httplib::Server {
 public:
  /// `tls` is null in the clear. At most `connections` are served at once, each by a thread, and as many wait
  /// for their request to arrive; its first line has `line_time`, and an answer is taken at `answer_rate` at
  /// least.
  BoundedServer(std::unique_ptr<TlsSessions> tls, int connections, Clock::duration line_time,
                double answer_rate);

  static constexpr std::size_t kOrdinaryBody = 1 << 16;  ///< bytes
  /// How long the body of a request may be, and how fast one must come at least that is no ordinary one.
  struct Bodies {
    std::function<std::size_t(const httplib::Request&)> longest;
    double bytes_per_s = 1.0;
  };
  void set_bodies(Bodies bodies) { bodies_ = std::move(bodies); }
  /// Whether a request announces a body that is too long: it is not read.
  [[nodiscard]] bool is_too_long(const httplib::Request& request) const;

  /// What encodings of an answer a client accepts: its Accept-Encoding, lines joined by commas, or empty.
  [[nodiscard]] static std::string accepted_encodings(const httplib::Request& request);
  /// Why the head of a request is none, or empty.
  [[nodiscard]] static std::string fault_of(const httplib::Request& request);

  /// After a port was bound: many may come at once. httplib's five are soon more, and the sixth waits a
  /// second until its kernel asks again.
  void queue_at_the_door() { ::listen(svr_sock_, SOMAXCONN); }
  /// Returns when all requests that have arrived are answered, or in about this time: no request is waited
  /// for any more, and clients have so long to take their answers. Before stop(): httplib sends no more of an
  /// answer then.
  void finish(Clock::duration time);

 private:
  bool process_and_close_socket(socket_t socket) override;
  [[nodiscard]] TaskQueue& queue_for(std::string_view request);
  void serve(const Lobby::Guest& connection);

  const std::unique_ptr<TlsSessions> tls_;
  const Clock::duration line_time_;
  const double answer_rate_;  // bytes/s
  Bodies bodies_;
  std::atomic<Clock::time_point> stop_ = Clock::time_point::max();  // the end of all answers
  TaskQueue requests_;
  TaskQueue healthz_{1}, readyz_{1};  // a probe waits for no request and for no other probe
  Lobby lobby_;
};

}  // namespace marble::server::http
