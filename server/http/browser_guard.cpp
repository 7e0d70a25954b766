#include "http/browser_guard.h"

#include <algorithm>

namespace marble::server::http {
namespace {

Expected<void> refused(const char* header, const std::string& value, const char* rule) {
  return unexpected(failure(ErrorCode::permission_denied, header, value, rule));
}

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

}  // namespace

httplib::Headers safety_headers() {
  return {
      {"Content-Security-Policy",
       "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; "
       "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"},
      {"Cross-Origin-Resource-Policy", "same-origin"},
      {"Referrer-Policy", "no-referrer"},
      {"X-Content-Type-Options", "nosniff"},
      {"X-Frame-Options", "DENY"},
  };
}

bool is_loopback(const std::string& host) {
  const bool six = !host.empty() && host.front() == '[';
  const std::string name = lower(host.substr(0, six ? host.find(']') + 1 : host.find(':')));
  if (name == "localhost" || name == "[::1]") return true;
  const auto in_address = [](unsigned char c) { return std::isdigit(c) != 0 || c == '.'; };
  return name.rfind("127.", 0) == 0 && std::all_of(name.begin(), name.end(), in_address);
}

bool is_json(const httplib::Request& request) {
  const std::string type = request.get_header_value("Content-Type");
  return lower(type.substr(0, type.find_first_of("; \t"))) == "application/json";
}

Expected<void> check_browser(const httplib::Request& request, bool is_local) {
  const std::string host = request.get_header_value("Host");
  if (is_local && request.has_header("Host") && !is_loopback(host))
    return refused("Host", host, "must be localhost, 127.0.0.1 or [::1] on a port that asks for no token");
  const std::string site = request.get_header_value("Sec-Fetch-Site");
  if (request.path.rfind("/api/", 0) == 0 && (site == "cross-site" || site == "same-site"))
    return refused("Sec-Fetch-Site", site, "must be same-origin: no other site's page may ask");
  if (request.method == "POST" && request.get_header_value("Marble-Request") != "1" && !is_json(request))
    return refused("Marble-Request", request.get_header_value("Marble-Request"),
                   "must be 1, or Content-Type application/json: no other site's form can send them");
  return {};
}

}  // namespace marble::server::http
