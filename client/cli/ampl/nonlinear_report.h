// Reports the solve of a nonlinear problem: rows as it runs, then a summary or a JSON line.
#pragma once

#include <cstdio>
#include <string>

#include "marble/nonlinear.h"
#include "nl/nl_nonlinear.h"

namespace marble::cli {

/// Prints a row per iteration.
class NonlinearTable {
 public:
  /// `sign`: factor from the objective to the file's objective.
  NonlinearTable(double sign, bool colours, std::FILE* to) : sign_(sign), colours_(colours), to_(to) {}
  void report(const nonlinear::Iteration& iteration);

 private:
  double sign_;
  bool colours_;
  std::FILE* to_;
  int rows_ = 0;
};

/// Vectors for the file's own variables and constraints, with AMPL's signs.
struct NonlinearVectors {
  std::vector<double> x, duals, reduced_costs, lower_bound_duals, upper_bound_duals;
  [[nodiscard]] static NonlinearVectors of(const formats::NlNonlinear& nl, const nonlinear::Answer& answer);
};

/// Returns several lines: status, objective, violation, work, time.
[[nodiscard]] std::string summary(const formats::NlNonlinear& nl, const nonlinear::Answer& answer,
                                  double seconds);

/// Returns one JSON object without a line break.
[[nodiscard]] std::string json_line(const std::string& file, const formats::NlNonlinear& nl,
                                    const nonlinear::Answer& answer, double seconds);

}  // namespace marble::cli
