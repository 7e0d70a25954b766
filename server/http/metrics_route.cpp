#include "http/metrics_route.h"

#include <httplib.h>

#include "http/caller.h"
#include "http/reply.h"
#include "metrics/scrape.h"

namespace marble::server::http {

void add_metrics_route(httplib::Server& server, const ServiceParts& parts) {
  if (!parts.metrics.on()) return;
  server.Get("/metrics", [&parts](const httplib::Request& request, httplib::Response& response) {
    const auto caller = parts.access.require(credentials_of(request), Role::observe);
    if (!caller) return reply_error(response, caller.error());
    response.set_content(scrape(parts), kMetricsContentType.c_str());
  });
}

}  // namespace marble::server::http
