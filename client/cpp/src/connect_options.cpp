#include "marble/connect_options.h"

#include <cstdlib>

namespace marble {
namespace {

std::string environment(const char* name, const char* otherwise = "") {
  const char* value = std::getenv(name);
  return value != nullptr && *value != '\0' ? value : otherwise;
}

}  // namespace

std::string default_server_address() { return environment("MARBLE_SERVER", "127.0.0.1:50051"); }

ConnectOptions ConnectOptions::from_environment() {
  ConnectOptions options;
  options.tls_ca = environment("MARBLE_TLS_CA");
  options.tls_certificate = environment("MARBLE_TLS_CERTIFICATE");
  options.tls_key = environment("MARBLE_TLS_KEY");
  options.token = environment("MARBLE_TOKEN");
  return options;
}

}  // namespace marble
