#include "http/metrics_route.h"

#include "http/bounded_server.h"
#include "http/caller.h"
#include "http/endpoint.h"
#include "http/gzip.h"
#include "service/scrape.h"

namespace marble::server::http {

void add_metrics_route(Router& router, const ServiceParts& parts) {
  if (!parts.metrics.on()) return;
  router.get("/metrics", [&parts](const httplib::Request& request, httplib::Response& response) {
    const auto caller = parts.access.require(credentials_of(request), Role::observe);
    if (!caller) return refuse(parts.log, request, caller.error(), response);
    std::string body = scrape(parts);
    response.set_header("Vary", "Accept-Encoding");
    if (accepts_gzip(BoundedServer::accepted_encodings(request))) {
      if (std::string packed = gzip(body); !packed.empty()) {
        body = std::move(packed);
        response.set_header("Content-Encoding", "gzip");
      }
    }
    response.set_content(std::move(body), kMetricsContentType.c_str());
  });
}

}  // namespace marble::server::http
