// The HTTP port, for browsers, Prometheus and probes. One thread per request, within bounds.
#pragma once

#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "service/service_parts.h"

namespace marble::server {
namespace http {
class BoundedServer;
class EventHub;
class Semaphore;
class Router;
}  // namespace http

class HttpServer {
 public:
  /// Listens at `parts.config.http`; /readyz also connects to `listeners`. Errors: unavailable (in use, or
  /// no address of this machine).
  [[nodiscard]] static Expected<std::unique_ptr<HttpServer>> start(const ServiceParts& parts,
                                                                   const std::vector<int>& listeners);
  /// Ends the streams, completes the replies in progress, and stops.
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  /// "http://127.0.0.1:50080", or https, with the assigned port in place of 0.
  [[nodiscard]] const std::string& address() const { return address_; }

 private:
  HttpServer(const ServiceParts& parts, const std::string& address, const std::vector<int>& listeners);
  void set_handlers(bool on_loopback);
  [[nodiscard]] bool bind(const std::string& address);

  const ServiceParts& parts_;
  std::unique_ptr<http::Semaphore> semaphore_;
  std::unique_ptr<http::EventHub> events_;
  std::unique_ptr<http::BoundedServer> server_;
  std::unique_ptr<http::Router> router_;
  std::string address_;
  std::thread thread_;  // accepts connections
};

}  // namespace marble::server
