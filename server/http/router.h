// The routes of the HTTP port, and the methods of each path.
#pragma once

#include <httplib.h>

#include <regex>
#include <string>
#include <vector>

namespace marble::server::http {

class Router {
 public:
  using Handler = httplib::Server::Handler;

  explicit Router(httplib::Server& server) : server_(server) {}

  /// `pattern` is a regular expression of the whole path; HEAD is added to GET.
  void get(const std::string& pattern, Handler handler);
  void post(const std::string& pattern, Handler handler);
  /// The handler reads the body itself, once it has identified the caller.
  void post_unread(const std::string& pattern, httplib::Server::HandlerWithContentReader handler);
  void del(const std::string& pattern, Handler handler);
  /// Returns the methods of a path, as in "GET, HEAD"; empty if there is no such path.
  [[nodiscard]] std::string methods_of(const std::string& path) const;
  /// Returns all of them, as in "GET, HEAD /api/jobs/([^/]+)".
  [[nodiscard]] std::vector<std::string> routes() const;

 private:
  void add(const std::string& pattern, const char* methods);

  struct Route {
    std::string text;
    std::regex pattern;
    const char* methods;
  };
  httplib::Server& server_;
  std::vector<Route> routes_;
};

}  // namespace marble::server::http
