#include "http/waiting.h"

#include <cstdlib>
#include <sstream>

namespace marble::server::http {

Expected<double> wait_of(const ServiceParts& parts, const httplib::Request& request) {
  if (!request.has_param("wait")) return 0.0;
  const std::string text = request.get_param_value("wait");
  const double most = parts.config.http_wait_s;
  char* end = nullptr;
  const double wait_s = std::strtod(text.c_str(), &end);
  if (!text.empty() && *end == '\0' && wait_s >= 0.0 && wait_s <= most) return wait_s;
  std::ostringstream rule;
  rule << "must be a number in [0, " << most << "], of seconds";
  return unexpected(invalid("wait", text, rule.str()));
}

}  // namespace marble::server::http
