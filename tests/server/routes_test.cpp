// The routes are those of the description that is served, server/http/openapi.json.
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <regex>
#include <set>

#include "http/array_routes.h"
#include "http/event_hub.h"
#include "http/event_routes.h"
#include "http/fleet_routes.h"
#include "http/health_routes.h"
#include "http/job_routes.h"
#include "http/metrics_route.h"
#include "http/page_assets.h"
#include "http/page_routes.h"
#include "http/submission_routes.h"
#include "server/idle_parts.h"

namespace marble::server::http {
namespace {

std::set<std::string> described() {
  std::set<std::string> routes;
  for (const PageAsset& asset : page_assets()) {
    if (asset.name != "openapi.json") continue;
    const auto description = nlohmann::json::parse(asset.bytes);
    for (const auto& [path, operations] : description.at("paths").items()) {
      for (const auto& [method, operation] : operations.items()) {
        std::string name = method == "get" ? "GET, HEAD" : method;
        std::transform(name.begin(), name.end(), name.begin(),
                       [](unsigned char c) { return std::toupper(c); });
        routes.insert(name + " " + path);
      }
    }
  }
  return routes;
}

TEST(Routes, AreThoseOfTheDescription) {
  IdleParts parts;
  httplib::Server server;
  Router router(server);
  Semaphore semaphore(1, 1);
  EventHub hub(parts.all, semaphore);
  add_health_routes(router, parts.all, {});
  add_job_routes(router, parts.all, semaphore);
  add_submission_routes(router, parts.all, semaphore);
  add_array_routes(router, parts.all, semaphore);
  add_event_routes(router, parts.all, hub);
  add_fleet_routes(router, parts.all);
  add_metrics_route(router, parts.all);
  add_page_routes(router);
  add_recent_routes(router, parts.all, begin_history(parts.all));
  std::set<std::string> routes;
  for (std::string route : router.routes()) {
    route = std::regex_replace(route, std::regex(R"(\(\[\^/\]\+\))"), "{job_id}");
    route = std::regex_replace(route, std::regex(R"(\\)"), "");
    const bool page = route == "GET, HEAD /" || route.starts_with("GET, HEAD /assets/");
    if (!page) routes.insert(route);
  }
  EXPECT_EQ(routes, described());
}

}  // namespace
}  // namespace marble::server::http
