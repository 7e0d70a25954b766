// Solves nonlinear .nl files: settings as words name=value, the solve, the report.
#pragma once

#include <cstdio>
#include <span>
#include <string>
#include <string_view>

#include "arguments/server_arguments.h"
#include "marble/nonlinear.h"
#include "nl/nl_nonlinear.h"

namespace marble::cli {

/// A setting beside the options of each LCQP.
struct NonlinearWord {
  const char* name;
  const char* doc;
  const char* value;  ///< the default
};
[[nodiscard]] std::span<const NonlinearWord> nonlinear_words();
[[nodiscard]] bool is_nonlinear_word(std::string_view name);

/// Sets one of nonlinear_words(), or an option of each LCQP; time_limit_s applies to all of them together.
/// Errors: invalid_argument, with the name.
[[nodiscard]] Expected<void> set_nonlinear_text(nonlinear::Settings& settings, const std::string& name,
                                                const std::string& value);

// Solves the problem of a nonlinear .nl file, in process or on a server.

/// `server` is null, or names a server: null solves in this process. Errors name constraints as the file
/// does.
[[nodiscard]] Expected<nonlinear::Answer> solve_nonlinear(const formats::NlNonlinear& nl,
                                                          const nonlinear::Settings& settings,
                                                          const ServerArguments* server);

// Reports the solve of a nonlinear problem: rows as it runs, then a summary or a JSON line.

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
