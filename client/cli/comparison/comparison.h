// Problems by contestants: who solved what, how well and how fast.
#pragma once

#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "comparison/contestant.h"
#include "comparison/measures.h"
#include "comparison/performance_profile.h"
#include "marble/problem_file.h"

namespace marble::cli {

struct ComparisonSettings {
  int runs = 1;                                   ///< of each contestant on each problem, in turns
  double time_limit_s = 60.0;                     ///< of a run
  double tolerance = 1e-5;                        ///< up to which a point is feasible
  PairMeasure pairs = PairMeasure::smaller_side;  ///< by which it is
  double gap = 1e-3;  ///< up to which it is as good as the best: relative, or absolute below 1
};

/// What one contestant did on one problem.
struct Entry {
  std::string problem, contestant;
  Attempt attempt;                   ///< of its first run
  std::optional<Measures> measures;  ///< of its z
  std::vector<double> seconds;       ///< of each run, ascending
  double reference = 0.0;            ///< best objective known: of the file, or of any feasible answer
  bool solved = false;               ///< feasible, and within the gap of the reference

  [[nodiscard]] double median_s() const { return seconds[seconds.size() / 2]; }
  [[nodiscard]] double excess() const;  ///< (objective − reference) / max(1, |reference|)
};

/// Problem by problem, in the order of the contestants.
struct Comparison {
  std::vector<Entry> entries;
  bool interrupted = false;

  [[nodiscard]] PerformanceProfile profile() const;
};

/// What others reached at another time: lines of CSV after a header that names the columns name, solver,
/// status, objective, equality, inequality, complementarity (the smaller side), iterations, ms. Errors:
/// not_found, or invalid_argument with the line.
[[nodiscard]] Expected<std::vector<Entry>> read_recorded(const std::string& path);

/// Nobody runs beside another. What was recorded of a problem is put beside what is measured. Errors:
/// internal if there is no place for the files that peers read.
[[nodiscard]] Expected<Comparison> compare(const std::vector<ProblemFile>& problems,
                                           const std::vector<Contestant>& contestants,
                                           const std::vector<Entry>& recorded,
                                           const ComparisonSettings& settings, const std::stop_token& stop);

}  // namespace marble::cli
