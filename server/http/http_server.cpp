#include "http/http_server.h"

#include <httplib.h>

#include "http/health_routes.h"
#include "http/metrics_route.h"
#include "http/reply.h"
#include "http/task_queue.h"

namespace marble::server {
namespace {

constexpr std::time_t kIdleConnection_s = 5;   // it holds a thread
constexpr std::size_t kLongestBody = 1 << 16;  // bytes; nothing that is asked here is longer

// A second server on the port must fail, not share it: httplib's default allows it.
void set_socket_options(int socket) {
  const int yes = 1;
  setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
}

}  // namespace

HttpServer::HttpServer(const ServiceParts& parts)
    : parts_(parts), server_(std::make_unique<httplib::Server>()) {
  server_->new_task_queue = [most = parts.config.http_connections] {
    return new http::TaskQueue(static_cast<std::size_t>(most));  // httplib deletes it
  };
  server_->set_socket_options(set_socket_options);
  server_->set_tcp_nodelay(true);
  server_->set_keep_alive_timeout(kIdleConnection_s);
  server_->set_payload_max_length(kLongestBody);
  server_->set_exception_handler(
      [](const httplib::Request&, httplib::Response& response, const std::exception_ptr&) {
        http::reply_error(response, {ErrorCode::internal, "", -1, "", "the request failed in the server"});
      });
  server_->set_error_handler([](const httplib::Request& request, httplib::Response& response) {
    if (!response.body.empty()) return;
    http::reply_error(response, {ErrorCode::not_found, "path", -1, request.path, "is nothing that is here"});
  });
  http::add_health_routes(*server_, parts);
  http::add_metrics_route(*server_, parts);
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
  address_ = "http://" + address.substr(0, colon + 1) + std::to_string(port);
  return true;
}

Expected<std::unique_ptr<HttpServer>> HttpServer::start(const ServiceParts& parts) {
  const std::string& address = parts.config.http == "auto" ? kDefaultHttpAddress : parts.config.http;
  std::unique_ptr<HttpServer> server(new HttpServer(parts));
  if (!server->bind(address)) {
    return unexpected(Error{ErrorCode::unavailable, "http", -1, address,
                            "cannot listen: in use, or no address of this machine"});
  }
  server->thread_ = std::thread([http = server->server_.get()] { http->listen_after_bind(); });
  // Connections wait in the socket from bind() on; but a stop before this would not be heard.
  while (!server->server_->is_running()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  return server;
}

HttpServer::~HttpServer() {
  server_->stop();
  if (thread_.joinable()) thread_.join();
}

}  // namespace marble::server
