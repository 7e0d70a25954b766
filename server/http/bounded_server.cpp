#include "http/bounded_server.h"

#include <algorithm>
#include <string_view>
#include <utility>

#include "http/request_head.h"

namespace marble::server::http {
namespace {

constexpr int kMostRequests = 1000;  // requests per connection
constexpr int kLeastWaiting = 64;    // connections, even if few are served
// Headers that no client can send: the error of an invalid head, and a header that httplib must not see.
constexpr const char *kFault = "", *kAcceptEncoding = " Accept-Encoding";

// Turns off what httplib would do on its own: ranges of replies that are made anew each time, compression at
// the solver's cost, and waiting for the end of a body without a length. Returns whether no request may
// follow this one, because its body, if any, may not have been read.
bool prepare(httplib::Request& request) {
  request.ranges.clear();
  request.headers.erase("Range");
  std::string accepted;
  const std::size_t lines = request.get_header_value_count("Accept-Encoding");
  for (std::size_t k = 0; k < lines; ++k)
    accepted += (k == 0 ? "" : ",") + request.get_header_value("Accept-Encoding", k);
  request.headers.erase("Accept-Encoding");
  if (lines > 0) request.headers.emplace(kAcceptEncoding, std::move(accepted));
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

// True if a request is for this path, regardless of what follows it.
bool asks_for(std::string_view request, std::string_view path) {
  for (const std::string_view method : {"GET ", "HEAD "}) {
    if (request.substr(0, method.size()) != method) continue;
    const std::string_view rest = request.substr(method.size());
    return rest.substr(0, path.size()) == path && rest.size() > path.size() &&
           (rest[path.size()] == ' ' || rest[path.size()] == '?');
  }
  return false;
}

// Runs httplib's task for a new connection at once: it only adds the connection.
class AtOnce final : public httplib::TaskQueue {
 public:
  void enqueue(std::function<void()> task) override { task(); }
  void shutdown() override {}
};

}  // namespace

BoundedServer::BoundedServer(std::unique_ptr<TlsSessions> tls, int connections, Clock::duration line_time,
                             double answer_rate)
    : tls_(std::move(tls)),
      line_time_(line_time),
      answer_rate_(answer_rate),
      requests_(static_cast<std::size_t>(connections)),
      pending_connections_(static_cast<std::size_t>(std::max(connections, kLeastWaiting)),
                           [this](const PendingConnections::Pending& guest) {
                             queue_for(guest->received()).enqueue([this, guest] { serve(guest); });
                           }) {
  new_task_queue = [] { return new AtOnce; };  // httplib deletes it
}

void BoundedServer::finish(Clock::duration time) {
  stop_ = Clock::now() + time;
  pending_connections_.close();
  for (TaskQueue* queue : {&requests_, &healthz_, &readyz_}) queue->shutdown();
}

bool BoundedServer::process_and_close_socket(socket_t socket) {
  TlsSession session = tls_ == nullptr ? nullptr : tls_->begin(socket);
  const bool usable = tls_ == nullptr || session != nullptr;
  const auto connection =
      std::make_shared<Connection>(socket, std::move(session), line_time_, answer_rate_, stop_);
  if (usable) pending_connections_.enter(connection);
  return usable;
}

std::string BoundedServer::accepted_encodings(const httplib::Request& request) {
  return request.get_header_value(kAcceptEncoding);
}

std::string BoundedServer::fault_of(const httplib::Request& request) {
  const auto found = request.headers.find(kFault);
  return found == request.headers.end() ? "" : found->second;
}

bool BoundedServer::is_too_long(const httplib::Request& request) const {
  return request.get_header_value<std::uint64_t>("Content-Length") > bodies_.longest(request);
}

TaskQueue& BoundedServer::queue_for(std::string_view request) {
  if (asks_for(request, "/healthz")) return healthz_;
  if (asks_for(request, "/readyz")) return readyz_;
  return requests_;
}

void BoundedServer::serve(const PendingConnections::Pending& connection) {
  const std::string fault = fault_of_head(connection->received());
  const bool is_final = connection->begin_request() == kMostRequests;
  bool closes = false, is_last = true;  // unless it can be read
  std::size_t length = 0, left = 0;     // length of the body; bytes that may be read from there
  bool in_pieces = false;
  const auto set_up = [&](httplib::Request& request) {
    request.ssl = connection->session();
    is_last = prepare(request) || !fault.empty();
    request.headers.erase(kFault);
    if (!fault.empty()) {
      request.headers.erase("Expect");
      request.headers.erase("Connection");
      request.headers.emplace("Connection", "close");
      request.headers.emplace(kFault, fault);
      connection->end_request();  // its end is unknown
      return;
    }
    in_pieces = request.has_header("Transfer-Encoding");
    length = request.get_header_value<std::uint64_t>("Content-Length");
    if (is_too_long(request)) {
      connection->end_request();  // else httplib would wait for all of it before it replies
    } else if (length > kOrdinaryBody) {
      const std::chrono::duration<double> time(static_cast<double>(length) / bodies_.bytes_per_s);
      connection->expect_body(length, line_time_ + std::chrono::duration_cast<Clock::duration>(time));
    }
    left = connection->left();
  };
  const bool done = process_request(*connection, is_final, closes, set_up);
  if (in_pieces || left - connection->left() < length) connection->end_request();  // it may be unread
  if (!done || closes || is_last || is_final) return;
  connection->await_next();
  pending_connections_.enter(connection);
}

}  // namespace marble::server::http
