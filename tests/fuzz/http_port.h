// The HTTP port without a port: a request's bytes over a socket, by our connection, cpp-httplib's parser and
// the real routes. Event streams end after their first frame: their hub has stopped.
#pragma once

#include <sys/socket.h>
#include <unistd.h>

#include <string>
#include <string_view>

#include "expect.h"
#include "http/browser_guard.h"
#include "http/connection.h"
#include "http/event_hub.h"
#include "http/event_routes.h"
#include "http/health_routes.h"
#include "http/job_routes.h"
#include "http/metrics_route.h"
#include "http/page_routes.h"
#include "http/request_head.h"
#include "http/submission_routes.h"
#include "requests/work.h"

namespace marble::fuzz {

struct HttpPort : SmallParts {
  explicit HttpPort(std::int64_t queue_bytes = 0, std::int64_t result_bytes = 1000)
      : SmallParts(queue_bytes, result_bytes) {
    config.http_wait_s = 0.0;
    httplib_.set_payload_max_length(kLongestBody);
    // As the server's: nothing is reserved for a body that is declared too long.
    httplib_.set_pre_routing_handler([](const httplib::Request& request, httplib::Response& response) {
      const bool is_allowed = server::http::check_browser(request, true).has_value();
      const bool is_too_long = request.get_header_value<std::uint64_t>("Content-Length") > kLongestBody;
      if (is_allowed && !is_too_long) return httplib::Server::HandlerResponse::Unhandled;
      response.status = is_allowed ? 413 : 403;
      return httplib::Server::HandlerResponse::Handled;
    });
    server::http::add_job_routes(router_, all, semaphore_);
    server::http::add_submission_routes(router_, all, semaphore_);
    server::http::add_event_routes(router_, all, events_);
    server::http::add_health_routes(router_, all, {});
    server::http::add_metrics_route(router_, all);
    server::http::add_page_routes(router_);
    server::http::add_recent_routes(router_, all, server::http::begin_history(all));
    events_.stop();
  }

  /// The answer's bytes, or as many as a socket holds; empty where nothing came that could be answered.
  [[nodiscard]] std::string answer(std::string_view bytes) {
    static const std::atomic<server::Clock::time_point> stop = server::Clock::time_point::max();
    constexpr double kAnswerRate = 32768.0;
    int ends[2];
    FUZZ_EXPECT(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) == 0);
    const ssize_t sent = send(ends[0], bytes.data(), std::min<std::size_t>(bytes.size(), 64 << 10),
                              MSG_NOSIGNAL | MSG_DONTWAIT);
    ::shutdown(ends[0], SHUT_WR);
    {
      using server::http::Connection;
      Connection connection(ends[1], nullptr, std::chrono::seconds(2), kAnswerRate, stop);
      Connection::Arrival arrival = connection.receive();
      while (arrival != Connection::Arrival::head && arrival != Connection::Arrival::closed)
        arrival = connection.receive();
      if (arrival == Connection::Arrival::head && sent > 0) {
        // The server refuses a faulty head with 400, whatever httplib makes of it.
        const bool is_refused = !server::http::fault_of_head(connection.received()).empty();
        connection.begin_request();
        if (!is_refused) httplib_.answer(connection);
      }
    }
    std::string answer(128 << 10, '\0');
    std::size_t size = 0;
    for (ssize_t got = 1; got > 0 && size<answer.size(); size += got> 0 ? static_cast<std::size_t>(got) : 0)
      got = recv(ends[0], answer.data() + size, answer.size() - size, MSG_DONTWAIT);
    close(ends[0]);
    answer.resize(size);
    return answer;
  }

 private:
  static constexpr std::size_t kLongestBody = 1 << 16;

  class Answering final : public httplib::Server {
   public:
    bool answer(server::http::Connection& connection) {
      bool closes = false;
      return process_request(connection, true, closes, [](httplib::Request& request) {
        request.ranges.clear();
        if (!request.has_header("Content-Length")) request.set_header("Content-Length", "0");
      });
    }
  };
  Answering httplib_;
  server::http::Semaphore semaphore_{8, 1 << 20};
  server::http::EventHub events_{all, semaphore_};
  server::http::Router router_{httplib_};
};

}  // namespace marble::fuzz
