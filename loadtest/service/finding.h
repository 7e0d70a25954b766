// Compares a measurement with a promise: a ratio, and its limit.
#pragma once

#include <string>
#include <vector>

namespace marble::bench {

struct Finding {
  std::string name;    ///< "hopper, session: latency over local solve"
  double value = 0.0;  ///< usually a ratio
  double limit = 0.0;
  bool at_most = true;  ///< else the value should be at least the limit
  std::string detail;   ///< the underlying figures

  [[nodiscard]] bool holds() const { return at_most ? value <= limit : value >= limit; }
};

/// Prints the finding, and keeps it for write_findings().
void report(Finding finding);

/// Writes all findings so far as a JSON array, {name, value, limit, at_most, holds, detail} each. Returns
/// false if the file cannot be written.
[[nodiscard]] bool write_findings(const std::string& path);

}  // namespace marble::bench
