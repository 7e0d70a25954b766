// The server or servers that an address names.
#pragma once

#include <string>
#include <vector>

#include "marble/error.h"

namespace marble::client {

struct Target {
  std::string name;       ///< as gRPC wants it
  std::string authority;  ///< the first host, where the name has lost it; else empty
  bool several = false;   ///< take turns between them
};

/// host:port, unix:PATH, several host:port with commas between, or dns:///host:port for every address that
/// the name has. Names among several are looked up now, for gRPC takes only numbers there. Errors, field
/// "address": invalid_argument; unavailable (a name is not known).
[[nodiscard]] Expected<Target> target_of(const std::string& address);

/// Of an address that has passed target_of(): several host:port one by one, anything else as it is.
[[nodiscard]] std::vector<std::string> each_address(const std::string& address);

}  // namespace marble::client
