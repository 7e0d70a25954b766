#include "http/requests/router.h"

#include <utility>

namespace marble::server::http {

void Router::get(const std::string& pattern, Handler handler) {
  routes_.push_back({std::regex(pattern), "GET, HEAD"});
  server_.Get(pattern, std::move(handler));
}

void Router::post(const std::string& pattern, Handler handler) {
  routes_.push_back({std::regex(pattern), "POST"});
  server_.Post(pattern, std::move(handler));
}

std::string Router::methods_of(const std::string& path) const {
  std::string methods;
  for (const Route& route : routes_) {
    if (std::regex_match(path, route.pattern))
      methods += (methods.empty() ? "" : ", ") + std::string(route.methods);
  }
  return methods;
}

}  // namespace marble::server::http
