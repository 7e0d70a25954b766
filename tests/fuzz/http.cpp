// A request of the HTTP port as it comes over a socket, by our connection, cpp-httplib's parser and the real
// routes: an answer in HTTP, or none where nothing that could be answered came. Event streams are left out:
// they do not end.
#include <sys/socket.h>
#include <unistd.h>

#include <cstdint>
#include <string>

#include "../server/idle_parts.h"
#include "expect.h"
#include "http/job_routes.h"
#include "http/metrics_route.h"
#include "http/page_routes.h"
#include "http/requests/browser_guard.h"
#include "http/submission_routes.h"
#include "http/transport/connection.h"

namespace {

using namespace marble::server;

class Answering final : public httplib::Server {
 public:
  bool answer(http::Connection& connection) {
    bool closes = false;
    return process_request(connection, true, closes, [](httplib::Request& request) {
      request.ranges.clear();
      if (!request.has_header("Content-Length")) request.set_header("Content-Length", "0");
    });
  }
};

// What the routes answer from: a server that has no jobs but those that are sent here.
struct Parts : IdleParts {
  Parts() {
    config.http_wait_s = 0.0;
    server.set_payload_max_length(1 << 16);
    server.set_pre_routing_handler([](const httplib::Request& request, httplib::Response& response) {
      if (http::check_browser(request, true)) return httplib::Server::HandlerResponse::Unhandled;
      response.status = 403;
      return httplib::Server::HandlerResponse::Handled;
    });
    http::add_job_routes(router, all);
    http::add_submission_routes(router, all, places);
    http::add_metrics_route(router, all);
    http::add_page_routes(router);
  }

  Answering server;
  http::Places places{8, 1 << 20};
  http::Router router{server};
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static Parts parts;
  static const std::atomic<bool> stopping = false;
  int ends[2];
  FUZZ_EXPECT(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) == 0);
  const ssize_t sent =
      send(ends[0], data, std::min<std::size_t>(size, 64 << 10), MSG_NOSIGNAL | MSG_DONTWAIT);
  ::shutdown(ends[0], SHUT_WR);
  {
    http::Connection connection(ends[1], nullptr, std::chrono::seconds(2), stopping);
    using Arrival = http::Connection::Arrival;
    Arrival arrival = connection.receive();
    while (arrival != Arrival::head && arrival != Arrival::closed) arrival = connection.receive();
    if (arrival == Arrival::head && sent > 0) {
      connection.begin_request();
      parts.server.answer(connection);
    }
  }
  char answer[16];
  const ssize_t got = recv(ends[0], answer, sizeof answer, MSG_DONTWAIT);
  if (got > 0) {
    const std::string begin(answer, static_cast<std::size_t>(got));
    FUZZ_EXPECT(begin.starts_with("HTTP/1.1 "));
    FUZZ_EXPECT(!begin.starts_with("HTTP/1.1 5"));
  }
  close(ends[0]);
  return 0;
}
