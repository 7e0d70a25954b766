#include "http/metrics_route.h"

#include "http/requests/caller.h"
#include "http/requests/endpoint.h"
#include "service/scrape.h"

namespace marble::server::http {

void add_metrics_route(Router& router, const ServiceParts& parts) {
  if (!parts.metrics.on()) return;
  router.get("/metrics", [&parts](const httplib::Request& request, httplib::Response& response) {
    const auto caller = parts.access.require(credentials_of(request), Role::observe);
    if (!caller) return refuse(parts.log, request, caller.error(), response);
    response.set_content(scrape(parts), kMetricsContentType.c_str());
  });
}

}  // namespace marble::server::http
