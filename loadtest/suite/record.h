// Records one solve of the suite, and prints the tables.
#pragma once

#include <string>
#include <vector>

#include "marble/solver.h"

namespace marble::suite {

struct Record {
  std::string problem;
  Status status = Status::numerical_failure;
  double objective = 0.0;
  double reference = 0.0;  ///< NaN if there is none
  double violation = 0.0;  ///< largest, by the independent check
  double stationarity = 0.0;
  int factorizations = 0;
  double milliseconds = 0.0;
  std::string origin;  ///< the engines that found the solution

  /// (objective − reference) / max(1, |reference|)
  [[nodiscard]] double gap() const;
  /// Returns true if it is solved, and the independent check agrees to 1e-9 of the data's size.
  [[nodiscard]] bool feasible() const { return is_solved(status) && violation <= 1e-9; }
};

/// Solves once and checks the solution with code that shares nothing with the solver.
[[nodiscard]] Record solve_and_judge(const std::string& name, const OwnedProblem& problem,
                                     const Options& options, double reference);

void print_header();
void print(const Record& record);
/// Prints: feasible, within the gap, median and largest factorizations, median ms.
void print_summary(const std::string& family, const std::vector<Record>& records, double gap);

[[nodiscard]] double median(std::vector<double> values);

/// Returns the processor time of this process so far: other load on the machine does not count.
[[nodiscard]] double processor_seconds();

}  // namespace marble::suite
