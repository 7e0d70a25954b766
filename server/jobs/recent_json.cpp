#include "jobs/recent_json.h"

#include <cmath>
#include <nlohmann/json.hpp>

namespace marble::server {
namespace {

using Json = nlohmann::json;

// To four digits, or to a thousandth, so that 640 points of eight columns fit into 64 KiB.
Json rounded(double value) {
  if (!std::isfinite(value)) return nullptr;
  const double size = std::max(1e-12, std::abs(value));
  const double digits = std::max(0.0, 3.0 - std::floor(std::log10(size)));
  const double scale = std::pow(10.0, size < 1.0 ? digits : 3.0);
  return std::round(value * scale) / scale;
}

Json json_of(const ClientShare& share) {
  return {{"running", share.running},
          {"queued", share.queued},
          {"done", share.use.done},
          {"busy_s", rounded(share.use.busy_s)}};
}

// Names may contain any bytes.
std::string text_of(const Json& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace); }

}  // namespace

std::string history_json(const std::vector<ServerHistory::Point>& points) {
  using Point = ServerHistory::Point;
  const auto column = [&](double Point::*part) {
    Json values = Json::array();
    for (const Point& point : points) values.push_back(rounded(point.*part));
    return values;
  };
  return text_of({{"time_s", column(&Point::time_s)},
                  {"queued", column(&Point::queued)},
                  {"running", column(&Point::running)},
                  {"done", column(&Point::done)},
                  {"busy_s", column(&Point::busy_s)},
                  {"cpu_s", column(&Point::cpu_s)},
                  {"p50_s", column(&Point::median_s)},
                  {"p99_s", column(&Point::p99_s)}});
}

std::string clients_json(const ClientShares& shares) {
  Json clients = Json::array();
  for (const ClientShare& share : shares.clients) {
    clients.push_back(json_of(share));
    clients.back()["client"] = share.client;
  }
  return text_of({{"seconds", rounded(shares.seconds)},
                  {"clients", std::move(clients)},
                  {"others", json_of(shares.others)}});
}

std::string clients_json(const ClientShares& shares, const std::string& only) {
  ClientShares own;
  own.seconds = shares.seconds;
  for (const ClientShare& share : shares.clients)
    if (share.client == only) own.clients.push_back(share);
  return clients_json(own);
}

}  // namespace marble::server
