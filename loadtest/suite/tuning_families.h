// Generates the families on which the solver's numbers are tuned, from seeds: none needs a file.
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace marble::suite {

/// The result of one instance. A chain of warm starts is one instance: sums.
struct Outcome {
  double objective = 0.0;  ///< NaN if it was not solved
  double factorizations = 0.0;
  double seconds = 0.0;  ///< processor time of this process
};

struct Instance {
  std::string family;
  std::function<Outcome()> solve;
};

/// Odd seeds are for tuning, even ones for judging.
[[nodiscard]] std::vector<Instance> tuning_instances(int seeds, bool judging);

}  // namespace marble::suite
