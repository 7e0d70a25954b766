#include "http/router.h"

#include <utility>

namespace marble::server::http {

void Router::get(const std::string& pattern, Handler handler) {
  add(pattern, "GET, HEAD");
  server_.Get(pattern, std::move(handler));
}

void Router::post(const std::string& pattern, Handler handler) {
  add(pattern, "POST");
  server_.Post(pattern, std::move(handler));
}

void Router::post_unread(const std::string& pattern, httplib::Server::HandlerWithContentReader handler) {
  add(pattern, "POST");
  server_.Post(pattern, std::move(handler));
}

void Router::del(const std::string& pattern, Handler handler) {
  add(pattern, "DELETE");
  server_.Delete(pattern, std::move(handler));
}

void Router::add(const std::string& pattern, const char* methods) {
  routes_.push_back({pattern, std::regex(pattern), methods});
}

std::vector<std::string> Router::routes() const {
  std::vector<std::string> names;
  for (const Route& route : routes_) names.push_back(std::string(route.methods) + " " + route.text);
  return names;
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
