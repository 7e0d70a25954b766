// The routes of the HTTP port, and which methods each path takes.
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

  /// `pattern` is a regular expression of the whole path; HEAD comes with GET.
  void get(const std::string& pattern, Handler handler);
  void post(const std::string& pattern, Handler handler);
  /// What a path takes, as in "GET, HEAD"; empty if it is none that is here.
  [[nodiscard]] std::string methods_of(const std::string& path) const;

 private:
  struct Route {
    std::regex pattern;
    const char* methods;
  };
  httplib::Server& server_;
  std::vector<Route> routes_;
};

}  // namespace marble::server::http
