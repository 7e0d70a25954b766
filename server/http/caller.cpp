#include "http/caller.h"

#include "base/random_id.h"
#include "http/tls_session.h"

namespace marble::server::http {

Credentials credentials_of(const httplib::Request& request) {
  Credentials given;
  const bool six = request.remote_addr.find(':') != std::string::npos;
  given.peer = (six ? "ipv6:[" + request.remote_addr + "]" : "ipv4:" + request.remote_addr) + ":" +
               std::to_string(request.remote_port);
  if (request.has_header("Authorization")) given.token = bearer_of(request.get_header_value("Authorization"));
  if (request.get_header_value_count("Authorization") > 1) given.token = "";  // which one applies is unclear
  given.certificate = certificate_name(request.ssl);
  if (request.has_header("Marble-Client")) given.name = request.get_header_value("Marble-Client");
  return given;
}

Origin origin_of(const httplib::Request& request) {
  Origin origin{credentials_of(request).peer};
  if (request.get_header_value_count("traceparent") == 1)
    origin.trace = parse_traceparent(request.get_header_value("traceparent"), random_id());
  return origin;
}

}  // namespace marble::server::http
