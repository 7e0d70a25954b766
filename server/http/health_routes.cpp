#include "http/health_routes.h"

#include <httplib.h>

namespace marble::server::http {

void add_health_routes(httplib::Server& server, const ServiceParts& parts) {
  constexpr const char* kText = "text/plain; charset=utf-8";
  server.Get("/healthz", [](const httplib::Request&, httplib::Response& response) {
    response.set_content("ok\n", kText);
  });
  server.Get("/readyz", [&scheduler = parts.scheduler](const httplib::Request&, httplib::Response& response) {
    const bool ready = !scheduler.is_closed();
    response.status = ready ? 200 : 503;
    response.set_content(ready ? "ready\n" : "draining\n", kText);
  });
}

}  // namespace marble::server::http
