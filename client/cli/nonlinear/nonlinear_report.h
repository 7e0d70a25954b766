// What is told of a nonlinear problem that is solved: rows as it goes, then a summary or a JSON line.
#pragma once

#include <cstdio>
#include <string>

#include "marble/nonlinear.h"
#include "nl_functions/nl_nonlinear.h"

namespace marble::cli {

/// A row an iteration.
class NonlinearTable {
 public:
  /// `sign`: what the objective is multiplied by to be the file's.
  NonlinearTable(double sign, bool colours, std::FILE* to) : sign_(sign), colours_(colours), to_(to) {}
  void report(const nonlinear::Iteration& iteration);

 private:
  double sign_;
  bool colours_;
  std::FILE* to_;
  int rows_ = 0;
};

/// By the file's own variables and constraints, signs as AMPL has them.
struct NonlinearVectors {
  std::vector<double> x, duals, reduced_costs, lower_bound_duals, upper_bound_duals;
  [[nodiscard]] static NonlinearVectors of(const formats::NlNonlinear& nl, const nonlinear::Answer& answer);
};

/// Several lines: status, objective, violation, work, time.
[[nodiscard]] std::string summary(const formats::NlNonlinear& nl, const nonlinear::Answer& answer,
                                  double seconds);

/// One JSON object without a line break.
[[nodiscard]] std::string json_line(const std::string& file, const formats::NlNonlinear& nl,
                                    const nonlinear::Answer& answer, double seconds);

}  // namespace marble::cli
