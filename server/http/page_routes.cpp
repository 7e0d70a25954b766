#include "http/page_routes.h"

#include <array>
#include <utility>

#include "base/process.h"
#include "http/endpoint.h"
#include "http/event_hub.h"
#include "http/page_assets.h"
#include "http/reply.h"
#include "jobs/recent_json.h"

namespace marble::server::http {
namespace {

const char* type_of(std::string_view name) {
  constexpr std::array<std::pair<std::string_view, const char*>, 6> kTypes = {{
      {".html", "text/html; charset=utf-8"},
      {".js", "text/javascript; charset=utf-8"},
      {".css", "text/css; charset=utf-8"},
      {".svg", "image/svg+xml"},
      {".json", "application/json"},
      {".png", "image/png"},
  }};
  for (const auto& [ending, type] : kTypes) {
    if (name.ends_with(ending)) return type;
  }
  return "application/octet-stream";
}

// Browsers keep a copy and ask each time whether it is still valid: a new binary has a new page.
Router::Handler send(const PageAsset& asset) {
  return [&asset, etag = '"' + std::string(asset.hash) + '"', type = type_of(asset.name)](
             const httplib::Request& request, httplib::Response& response) {
    response.set_header("ETag", etag);
    response.set_header("Cache-Control", "no-cache");
    if (request.get_header_value("If-None-Match").find(etag) != std::string::npos) {
      response.status = 304;
    } else {
      response.set_content(asset.bytes.data(), asset.bytes.size(), type);
    }
  };
}

std::string literal(std::string_view name) {
  std::string pattern;
  for (const char c : name)
    pattern += std::isalnum(static_cast<unsigned char>(c)) != 0 ? std::string{c} : std::string{'\\', c};
  return pattern;
}

std::string path_of(std::string_view name) {
  if (name == "index.html") return "/";
  return (name == "openapi.json" ? "/api/" : "/assets/") + literal(name);
}

}  // namespace

void add_page_routes(Router& router) {
  for (const PageAsset& asset : page_assets()) router.get(path_of(asset.name), send(asset));
}

void add_recent_routes(Router& router, const ServiceParts& parts,
                       std::shared_ptr<const ServerHistory> history) {
  const auto report = [&](const char* path, std::function<std::string(const Identity&)> text) {
    router.get(path,
               endpoint(parts,
                        [text = std::move(text)](const httplib::Request& request, const Identity& caller,
                                                 httplib::Response& response) -> Expected<void> {
                          if (auto known = check_parameters(request, {}); !known) return known;
                          reply_text(response, text(caller));
                          return {};
                        }));
  };
  report("/api/history",
         [history = std::move(history)](const Identity&) { return history_json(history->points()); });
  report("/api/clients", [&parts](const Identity& caller) { return clients_for(parts, caller); });
}

// The objects that it reads outlive the timer, which may still use it after everything else has ended.
std::shared_ptr<const ServerHistory> begin_history(const ServiceParts& parts) {
  const auto look = [&scheduler = parts.scheduler, started = parts.started] {
    const Counters counters = scheduler.counters();
    const Latencies::Quantiles latencies = scheduler.latencies(Latencies::kNewestSeconds);
    return ServerHistory::Point{
        .time_s = std::chrono::duration<double>(Clock::now() - started).count(),
        .queued = static_cast<double>(counters.queued),
        .running = static_cast<double>(counters.running),
        .done = static_cast<double>(counters.answered + counters.updates),
        .busy_s = counters.busy_s,
        .cpu_s = process_usage().cpu_s,
        .median_s = latencies.median_s,
        .p99_s = latencies.p99_s,
    };
  };
  auto history = std::make_shared<ServerHistory>(look);
  parts.timer.add(history);
  return history;
}

}  // namespace marble::server::http
