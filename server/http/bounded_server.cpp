#include "http/bounded_server.h"

#include "http/connection.h"

namespace marble::server::http {
namespace {

constexpr std::chrono::seconds kIdleConnection{5};  // it holds a thread
constexpr int kMostRequests = 1000;                 // of one connection

// What httplib would do on its own: ranges of what is made anew each time, compression at the solver's cost,
// and waiting for the end of a body that has no length. Whether nothing may follow this request: its body, if
// it has one, is perhaps not read.
bool prepare(httplib::Request& request) {
  request.ranges.clear();
  request.headers.erase("Range");
  request.headers.erase("Accept-Encoding");
  const bool has_body = request.has_header("Content-Length") || request.has_header("Transfer-Encoding");
  if (!has_body && request.method != "GET" && request.method != "HEAD")
    request.set_header("Content-Length", "0");
  const bool last = has_body || (request.method != "GET" && request.method != "HEAD");
  if (last) {
    request.headers.erase("Connection");
    request.set_header("Connection", "close");
  }
  return last;
}

}  // namespace

bool BoundedServer::process_and_close_socket(socket_t socket) {
  Connection connection(socket, stopping_);
  if (tls_ != nullptr && !connection.shake_hands(tls_->begin(socket))) return false;
  bool last = false;
  for (int left = kMostRequests; left > 0 && !last && connection.wait_for_request(kIdleConnection); --left) {
    bool closes = false, is_last = true;  // unless it can be read
    const auto set_up = [&](httplib::Request& request) {
      request.ssl = connection.session();
      is_last = prepare(request);
      // Else httplib would wait for all of it before it answers 413.
      if (request.get_header_value<std::uint64_t>("Content-Length") > payload_max_length_)
        connection.end_request();
    };
    last = !process_request(connection, left == 1, closes, set_up) || closes || is_last;
  }
  return true;
}

}  // namespace marble::server::http
