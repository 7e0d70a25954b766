#include "http/page_routes.h"

#include <array>
#include <utility>

#include "http/page_assets.h"

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

// Browsers keep a copy and ask each time whether it still holds: a new binary has a new page.
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

}  // namespace marble::server::http
