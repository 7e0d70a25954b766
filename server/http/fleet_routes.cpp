#include "http/fleet_routes.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "http/endpoint.h"
#include "http/event_hub.h"
#include "http/reply.h"
#include "service/server_list.h"

namespace marble::server::http {
namespace {

using OrderedJson = nlohmann::ordered_json;

OrderedJson number_or_null(double value) {
  return std::isfinite(value) ? OrderedJson(value) : OrderedJson(nullptr);
}

OrderedJson report_of(const ListedServer& server) {
  return {{"name", server.name},
          {"address", server.address},
          {"page", server.page},
          {"version", server.version},
          {"state", server.is_lost ? "lost" : server.state},
          {"this", server.is_this},
          {"seen_s", number_or_null(server.seen_s)},
          {"uptime_s", number_or_null(server.uptime_s)},
          {"workers", server.workers},
          {"running", server.running},
          {"queued", server.queued},
          {"sessions", server.sessions},
          {"answered_last_minute", server.answered},
          {"solved_last_minute", server.solved},
          {"p50_last_minute_s", number_or_null(server.median_s)},
          {"p99_last_minute_s", number_or_null(server.p99_s)}};
}

}  // namespace

std::string servers_json(const ServiceParts& parts) {
  if (parts.roster == nullptr) return R"({"shared":false})";
  const ServerList list = parts.roster->servers();
  OrderedJson servers = OrderedJson::array();
  for (const ListedServer& server : list.servers) servers.push_back(report_of(server));
  const OrderedJson json = {{"shared", true},
                            {"waiting", list.waiting},
                            {"age_s", number_or_null(list.age_s)},
                            {"error", list.error ? list.error->bound : ""},
                            {"servers", std::move(servers)}};
  return json.dump(-1, ' ', false, OrderedJson::error_handler_t::replace);
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
