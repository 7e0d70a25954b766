#include "http/fleet_routes.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "http/endpoint.h"
#include "http/event_hub.h"
#include "http/reply.h"
#include "service/server_list.h"

namespace marble::server::http {
namespace {

using Json = nlohmann::ordered_json;

Json number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Json json_of(const ListedServer& server) {
  return {{"name", server.name},
          {"address", server.address},
          {"page", server.page},
          {"version", server.version},
          {"state", server.is_lost ? "lost" : server.state},
          {"this", server.is_this},
          {"seen_s", number(server.seen_s)},
          {"uptime_s", number(server.uptime_s)},
          {"workers", server.workers},
          {"running", server.running},
          {"queued", server.queued},
          {"sessions", server.sessions},
          {"answered_last_minute", server.answered},
          {"solved_last_minute", server.solved},
          {"p50_last_minute_s", number(server.median_s)},
          {"p99_last_minute_s", number(server.p99_s)}};
}

}  // namespace

std::string servers_json(const ServiceParts& parts) {
  if (parts.roster == nullptr) return R"({"shared":false})";
  const ServerList list = parts.roster->servers();
  Json servers = Json::array();
  for (const ListedServer& server : list.servers) servers.push_back(json_of(server));
  const Json json = {{"shared", true},
                     {"waiting", list.waiting},
                     {"age_s", number(list.age_s)},
                     {"error", list.error ? list.error->bound : ""},
                     {"servers", std::move(servers)}};
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

void add_fleet_routes(Router& router, const ServiceParts& parts) {
  router.get("/api/servers", endpoint(parts,
                                      [&parts](const httplib::Request& request, const Identity& caller,
                                               httplib::Response& response) -> Expected<void> {
                                        if (auto known = check_parameters(request, {}); !known) return known;
                                        if (!sees_all(caller))
                                          return unexpected(failure(ErrorCode::permission_denied, "role",
                                                                    "must be observe or admin"));
                                        reply_text(response, servers_json(parts));
                                        return {};
                                      }));
}

}  // namespace marble::server::http
