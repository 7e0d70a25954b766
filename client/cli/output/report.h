// Reports a solved file: a summary for people, a JSON line for programs.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "marble/client.h"
#include "marble/options.h"
#include "marble/problem_file.h"
#include "output/conflict_text.h"

namespace marble::cli {

/// A solution from this process or from a server; the job id is empty in process.
using Answer = RemoteSolution;

/// Information about the solved problem.
struct Subject {
  std::string name;
  std::string file = {};  ///< empty if there was no file
  std::size_t variables = 0, equalities = 0, inequalities = 0, pairs = 0;
  std::optional<double> best_known_objective = {};
  bool maximize = false;                    ///< the file's objective is the negative of the problem's
  Options options = {};                     ///< used for the solve, as far as known
  std::vector<ConflictLine> conflict = {};  ///< of a solution that has one, if the file is available

  /// Converts an objective of the problem, or a bound on it, to the file's objective.
  [[nodiscard]] double of_file(double objective) const { return maximize ? 0.0 - objective : objective; }
};
[[nodiscard]] Subject subject_of(const std::string& path, const ProblemFile& file, const Options& options);

/// Returns several lines: status, objective, the kind of solution, violations, work, times, advice. Objective
/// and bound are the file's.
[[nodiscard]] std::string summary(const Subject& subject, const Answer& answer);

/// Returns the output of `marble explain`: the conflict, or why there is none.
[[nodiscard]] std::string explanation(const Subject& subject, const Answer& answer);

/// Returns one JSON object without a line break. Objective and bound are the file's; multipliers are those of
/// the problem, which has the negative objective if "maximize" is true.
[[nodiscard]] std::string json_line(const Subject& subject, const Answer& answer);
/// The same for a file without a solution; `name` is empty if it is unknown.
[[nodiscard]] std::string json_line(const std::string& file, const std::string& name, const Error& error);

}  // namespace marble::cli
