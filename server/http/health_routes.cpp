#include "http/health_routes.h"

#include "http/port_probe.h"
#include "store/submissions.h"

namespace marble::server::http {

constexpr std::chrono::seconds kPatience{1};  // less than probes have

void add_health_routes(Router& router, const ServiceParts& parts, const std::vector<int>& listeners) {
  constexpr const char* kText = "text/plain; charset=utf-8";
  router.get("/healthz", [](const httplib::Request&, httplib::Response& response) {
    response.set_content("ok\n", kText);
  });
  router.get("/readyz", [&parts, listeners](const httplib::Request&, httplib::Response& response) {
    const bool leaving = parts.scheduler.is_draining();
    const bool ready = !leaving && ports_answer(listeners, !parts.config.tls_certificate.empty(), kPatience);
    response.status = ready ? 200 : 503;
    // Without the store, no server is better off than another: sending calls to none of them would only stop
    // what works without it.
    const auto well = parts.submissions->health();
    const std::string reported =
        well ? "ready\n" : "ready, but no job can be submitted: " + well.error().bound + "\n";
    response.set_content(ready     ? reported
                         : leaving ? "draining\n"
                                   : "the gRPC port does not answer\n",
                         kText);
  });
}

}  // namespace marble::server::http
