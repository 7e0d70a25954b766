// What is told of one solved file: a summary for people, a JSON line for programs.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "conflict/conflict_text.h"
#include "marble/client.h"
#include "marble/options.h"
#include "marble/problem_file.h"

namespace marble::cli {

/// An answer from here or from a server; the job is empty if from here.
using Answer = RemoteSolution;

/// What is known of the problem that was solved.
struct Subject {
  std::string name;
  std::string file = {};  ///< empty if it was none
  std::size_t variables = 0, equalities = 0, inequalities = 0, pairs = 0;
  std::optional<double> best_known_objective = {};
  bool maximize = false;                    ///< the file's objective is the negative of the problem's
  Options options = {};                     ///< that it was solved by, as far as they are known
  std::vector<ConflictLine> conflict = {};  ///< of an answer that has one, where the file is at hand

  /// An objective of the problem, or a bound of it, as the file has it.
  [[nodiscard]] double of_file(double objective) const { return maximize ? 0.0 - objective : objective; }
};
[[nodiscard]] Subject subject_of(const std::string& path, const ProblemFile& file, const Options& options);

/// Several lines: status, objective, the kind of answer, violations, work, times, what to try. Objective and
/// bound are the file's.
[[nodiscard]] std::string summary(const Subject& subject, const Answer& answer);

/// What `marble explain` prints: the conflict, or why there is none.
[[nodiscard]] std::string explanation(const Subject& subject, const Answer& answer);

/// One JSON object without a line break. Objective and bound are the file's; multipliers those of the
/// problem, which has the negative objective where "maximize" is true.
[[nodiscard]] std::string json_line(const Subject& subject, const Answer& answer);
/// The same for a file without an answer; `name` is empty if it is not known.
[[nodiscard]] std::string json_line(const std::string& file, const std::string& name, const Error& error);

}  // namespace marble::cli
