// Parses the server or servers that an address names.
#pragma once

#include <string>
#include <vector>

#include "marble/error.h"

namespace marble::client {

struct Target {
  std::string name;       ///< in gRPC's syntax
  std::string authority;  ///< the first host, if the name lacks it; else empty
  bool several = false;   ///< rotate over the servers
};

/// Parses host:port, unix:PATH, a comma-separated list of host:port, or dns:///host:port for every address of
/// the name. Names in a list are looked up now, because gRPC accepts only numeric addresses there. Errors,
/// field "address": invalid_argument; unavailable (unknown name).
[[nodiscard]] Expected<Target> target_of(const std::string& address);

/// Splits an address that has passed target_of(): a list of host:port into its items, anything else
/// unchanged.
[[nodiscard]] std::vector<std::string> each_address(const std::string& address);

}  // namespace marble::client
