// Parses the latency objective of a server.
#pragma once

#include <string>

#include "marble/error.h"

namespace marble::load {

/// A latency that must not be exceeded: "p99=50ms".
struct Objective {
  double part = 0.99;  ///< in (0, 1]
  double most_s = 0.0;
  std::string text;

  [[nodiscard]] std::string quantile() const { return text.substr(0, text.find('=')); }  ///< "p99"
};
[[nodiscard]] Expected<Objective> parse_objective(const std::string& text);

}  // namespace marble::load
