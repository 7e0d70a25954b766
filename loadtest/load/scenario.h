// Describes the mix of requests: problems with their weights, priorities and limits.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "marble/call_controls.h"
#include "marble/error.h"
#include "marble/options.h"
#include "marble/problem.h"

namespace marble::load {

/// The server's method for a request.
enum class Mode {
  unary,     ///< Solver.Solve
  streamed,  ///< Solver.SolveStream, every iteration reported
  session,   ///< Solver.Session: updates of a problem that is set up before the measurement
  batch,     ///< Solver.SolveBatch
};
[[nodiscard]] const char* to_string(Mode mode);

/// One kind of request in the mix.
struct Entry {
  std::string name;
  std::string problem;         ///< a built-in example; empty if there is a file
  std::filesystem::path file;  ///< in any format the tools read
  int size = 0;                ///< of the example: steps, or of qpec variables; 0 is its default
  int variants = 1;            ///< of the example, with numbers varied by a few percent; used in turns
  double weight = 1.0;         ///< its part of all requests is weight / sum of the weights
  std::optional<Mode> mode;    ///< the run's if absent
  Priority priority = Priority::by_method;
  double deadline_s = 0.0;           ///< of a call or an update; 0: none
  bool cold = false;                 ///< sessions: discard the last solution before each solve
  double progress_interval_s = 0.0;  ///< streamed: least time between two rows
  Options options;
};

struct Scenario {
  std::vector<Entry> entries;
};

/// Returns a scenario of one problem: a built-in example by name, or a file by path.
[[nodiscard]] Entry single_entry(const std::string& problem);

/// Reads a scenario in TOML. Errors: not_found, or invalid_argument whose message names file, line, key and
/// rule. Relative paths start at the scenario's folder.
[[nodiscard]] Expected<Scenario> read_scenario(const std::filesystem::path& path);
[[nodiscard]] Expected<Scenario> parse_scenario(const std::string& text, const std::filesystem::path& path);

/// Returns the names of the built-in examples: hopper, rocket, gates, qpec, jr1.
[[nodiscard]] const std::vector<std::string>& example_names();

/// Returns the problems of an entry, one per variant; all have the same sizes. Errors: those of the file, or
/// an invalid size for the example.
[[nodiscard]] Expected<std::vector<OwnedProblem>> problems_of(const Entry& entry);

}  // namespace marble::load
