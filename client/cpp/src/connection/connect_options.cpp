#include "marble/connect_options.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>

#include "connection/traceparent.h"
#include "marble/contract.h"

namespace marble {
namespace {

std::string environment(const char* name, const char* otherwise = "") {
  const char* value = std::getenv(name);
  return value != nullptr && *value != '\0' ? value : otherwise;
}

// Returns the program's name from glibc, shortened and restricted to the characters allowed in a name.
std::string process_name() {
  std::string name = std::string(program_invocation_short_name).substr(0, 40);
  std::replace_if(
      name.begin(), name.end(), [](char c) { return c <= ' ' || c > '~'; }, '_');
  return name + "-" + std::to_string(getpid());
}

}  // namespace

std::string default_server_address() { return environment("MARBLE_SERVER", contract::default_address); }

ConnectOptions ConnectOptions::from_environment() {
  ConnectOptions options;
  options.tls_ca = environment("MARBLE_TLS_CA");
  options.tls_certificate = environment("MARBLE_TLS_CERTIFICATE");
  options.tls_key = environment("MARBLE_TLS_KEY");
  options.token = environment("MARBLE_TOKEN");
  options.name = environment("MARBLE_CLIENT_NAME", process_name().c_str());
  options.traceparent = environment("TRACEPARENT");
  if (!client::check_traceparent(options.traceparent)) options.traceparent.clear();  // not a reason to fail
  return options;
}

}  // namespace marble
