#include "http/http_server.h"

#include <httplib.h>

#include "http/array_routes.h"
#include "http/bounded_server.h"
#include "http/browser_guard.h"
#include "http/endpoint.h"
#include "http/event_routes.h"
#include "http/fleet_routes.h"
#include "http/health_routes.h"
#include "http/job_routes.h"
#include "http/metrics_route.h"
#include "http/page_routes.h"
#include "http/reply.h"
#include "http/semaphore.h"
#include "http/submission_routes.h"

namespace marble::server {
namespace {

constexpr std::chrono::seconds kAnswerTime{5};  // for clients to read the last replies, as on the gRPC port

// A second server on the port must fail, not share it: httplib's default allows sharing.
void set_socket_options(int socket) {
  const int yes = 1;
  setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
}

// Each occupies a thread: some are left for other requests.
int most_lasting(const Config& config) { return config.http_connections / 4 * 3; }

// Except for a problem, no request body is long.
std::size_t longest_body(const Config& config, const httplib::Request& request) {
  const bool submits = request.method == "POST" && request.path == http::kJobsPath;
  return submits ? static_cast<std::size_t>(config.http_body_bytes) : http::BoundedServer::kOrdinaryBody;
}

void report_too_long(const Config& config, const httplib::Request& request, httplib::Response& response) {
  http::reply_error(response,
                    invalid("body", request.get_header_value("Content-Length") + " bytes",
                            "must have at most " + std::to_string(longest_body(config, request)) + " bytes"));
  response.status = 413;
}

Clock::duration line_time_of(const Config& config) {
  return std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(config.http_line_s));
}

std::unique_ptr<http::TlsSessions> tls_of(const ServiceParts& parts, const std::string& address) {
  if (parts.config.tls_certificate.empty()) return nullptr;
  return std::make_unique<http::TlsSessions>(parts.config, parts.log, address);
}

// For requests that httplib refuses by itself.
void report_fault(const http::Router& router, const httplib::Request& request, httplib::Response& response) {
  const auto report = [&](ErrorCode code, const char* field, const std::string& value,
                          const std::string& bound) {
    const int status = response.status;
    http::reply_error(response, {code, field, -1, value, bound});
    response.status = status;
  };
  const std::string methods = response.status == 404 ? router.methods_of(request.path) : "";
  if (!methods.empty()) {
    response.status = 405;
    response.set_header("Allow", methods);
    report(ErrorCode::invalid_argument, "method", request.method, "must be one of " + methods);
  } else if (response.status == 404) {
    report(ErrorCode::not_found, "path", request.path, "is nothing that is here");
  } else if (response.status == 414) {
    report(ErrorCode::invalid_argument, "path", "",
           "must have at most " + std::to_string(CPPHTTPLIB_REQUEST_URI_MAX_LENGTH) + " bytes");
  } else {
    report(ErrorCode::invalid_argument, "", "", "the request is no HTTP, too long or too slow");
  }
}

}  // namespace

HttpServer::HttpServer(const ServiceParts& parts, const std::string& address,
                       const std::vector<int>& listeners)
    : parts_(parts),
      semaphore_(std::make_unique<http::Semaphore>(most_lasting(parts.config), parts.config.transport_bytes)),
      events_(std::make_unique<http::EventHub>(parts, *semaphore_)),
      server_(std::make_unique<http::BoundedServer>(tls_of(parts, address), parts.config.http_connections,
                                                    line_time_of(parts.config),
                                                    parts.config.http_answer_rate)),
      router_(std::make_unique<http::Router>(*server_)) {
  server_->set_socket_options(set_socket_options);
  server_->set_tcp_nodelay(true);
  server_->set_payload_max_length(
      std::max<std::size_t>(parts.config.http_body_bytes, http::BoundedServer::kOrdinaryBody));
  server_->set_bodies(
      {[&config = parts.config](const httplib::Request& request) { return longest_body(config, request); },
       parts.config.http_body_rate});
  server_->set_default_headers(http::safety_headers());
  set_handlers(http::is_loopback(address));
  http::add_health_routes(*router_, parts, listeners);
  http::add_job_routes(*router_, parts, *semaphore_);
  http::add_submission_routes(*router_, parts, *semaphore_);
  http::add_array_routes(*router_, parts, *semaphore_);
  http::add_event_routes(*router_, parts, *events_);
  http::add_fleet_routes(*router_, parts);
  http::add_metrics_route(*router_, parts);
  http::add_page_routes(*router_);
  http::add_recent_routes(*router_, parts, http::begin_history(parts));
}

void HttpServer::set_handlers(bool on_loopback) {
  using Handled = httplib::Server::HandlerResponse;
  server_->set_pre_routing_handler(
      [this, on_loopback](const httplib::Request& request, httplib::Response& response) {
        if (const std::string fault = http::BoundedServer::fault_of(request); !fault.empty()) {
          http::refuse(parts_.log, request, invalid("", fault), response);
          return Handled::Handled;
        }
        const bool is_local = on_loopback && !parts_.access.knows_callers();
        const auto allowed = http::check_browser(request, is_local);
        if (!allowed) http::refuse(parts_.log, request, allowed.error(), response);
        if (!allowed) return Handled::Handled;
        if (!server_->is_too_long(request)) return Handled::Unhandled;
        report_too_long(parts_.config, request, response);
        return Handled::Handled;
      });
  server_->set_post_routing_handler([](const httplib::Request&, httplib::Response& response) {
    if (!response.has_header("Cache-Control")) response.set_header("Cache-Control", "no-store");
  });
  server_->set_exception_handler(
      [](const httplib::Request&, httplib::Response& response, const std::exception_ptr&) {
        http::reply_error(response, failure(ErrorCode::internal, "the request failed in the server"));
      });
  server_->set_error_handler([this](const httplib::Request& request, httplib::Response& response) {
    if (response.body.empty()) report_fault(*router_, request, response);
  });
}

bool HttpServer::bind(const std::string& address) {
  const std::size_t colon = address.rfind(':');
  std::string host = address.substr(0, colon);
  if (host.size() > 1 && host.front() == '[') host = host.substr(1, host.size() - 2);
  int port = std::atoi(address.c_str() + colon + 1);  // checked when it was read
  if (port == 0) {
    port = server_->bind_to_any_port(host);
    if (port <= 0) return false;
  } else if (!server_->bind_to_port(host, port)) {
    return false;
  }
  server_->set_listen_backlog();
  address_ = (parts_.config.tls_certificate.empty() ? "http://" : "https://") + address.substr(0, colon + 1) +
             std::to_string(port);
  return true;
}

Expected<std::unique_ptr<HttpServer>> HttpServer::start(const ServiceParts& parts,
                                                        const std::vector<int>& listeners) {
  const std::string& address = parts.config.http == "auto" ? kDefaultHttpAddress : parts.config.http;
  std::unique_ptr<HttpServer> server(new HttpServer(parts, address, listeners));
  if (!server->bind(address)) {
    return unexpected(failure(ErrorCode::unavailable, "http", address,
                              "cannot listen: in use, or no address of this machine"));
  }
  server->thread_ = std::thread([http = server->server_.get()] { http->listen_after_bind(); });
  // Connections wait in the socket from bind() on, but a stop before this point would be lost.
  while (!server->server_->is_running()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  return server;
}

HttpServer::~HttpServer() {
  events_->stop();
  server_->finish(kAnswerTime);
  server_->stop();
  if (thread_.joinable()) thread_.join();
}

}  // namespace marble::server
