#include "http/health_routes.h"

namespace marble::server::http {

void add_health_routes(Router& router, const ServiceParts& parts) {
  constexpr const char* kText = "text/plain; charset=utf-8";
  router.get("/healthz", [](const httplib::Request&, httplib::Response& response) {
    response.set_content("ok\n", kText);
  });
  router.get("/readyz", [&scheduler = parts.scheduler](const httplib::Request&, httplib::Response& response) {
    const bool ready = !scheduler.is_leaving();
    response.status = ready ? 200 : 503;
    response.set_content(ready ? "ready\n" : "draining\n", kText);
  });
}

}  // namespace marble::server::http
