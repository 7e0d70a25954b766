// The families on which the solver's numbers are chosen, generated from seeds: none needs a file.
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace marble::suite {

/// What one instance came to. A chain of warm starts is one instance: sums.
struct Outcome {
  double objective = 0.0;  ///< NaN if it was not solved
  double factorizations = 0.0;
  double seconds = 0.0;  ///< of this process's processor time
};

struct Instance {
  std::string family;
  std::function<Outcome()> solve;
};

/// Odd seeds are the half on which numbers are chosen, even ones the half on which they are judged.
[[nodiscard]] std::vector<Instance> tuning_instances(int seeds, bool judging);

}  // namespace marble::suite
