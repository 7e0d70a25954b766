// Compares contestants on problems: who solved what, how well and how fast.
#pragma once

#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "base/gnuplot.h"
#include "marble/problem_file.h"
#include "research/contestant.h"

namespace marble::cli {

// Provides performance profiles (Dolan and Moré, 2002): the share of problems that a solver solves within a
// factor of the best time.
class PerformanceProfile {
 public:
  /// Seconds by name, a number per problem in the same order for all; infinity for unsolved problems.
  using Times = std::vector<std::pair<std::string, std::vector<double>>>;
  explicit PerformanceProfile(const Times& times);

  struct Curve {
    std::string name;
    std::vector<double> factors;  ///< of its solved problems, ascending: time over the best time
    int fastest = 0;              ///< how often no one was faster
    /// Returns how many of the problems it solves within a factor.
    [[nodiscard]] int within(double factor) const;
  };
  [[nodiscard]] const std::vector<Curve>& curves() const { return curves_; }
  [[nodiscard]] int problems() const { return problems_; }

  /// Returns a line per solver: "NAME is the fastest on 27 of 39 problems (69 %), at worst 8.0 times slower
  /// than the fastest, and solves 39."
  [[nodiscard]] std::string sentences() const;
  /// Returns the factor and each solver's share: a row wherever one changes.
  [[nodiscard]] std::string csv() const;
  /// Returns gnuplot's commands, data included.
  [[nodiscard]] std::string picture(PictureFormat format, const std::string& title) const;

 private:
  std::vector<Curve> curves_;
  int problems_ = 0;
};

struct ComparisonSettings {
  int runs = 1;                                   ///< of each contestant on each problem, in turns
  double time_limit_s = 60.0;                     ///< of a run
  double tolerance = 1e-5;                        ///< up to which a point counts as feasible
  PairMeasure pairs = PairMeasure::smaller_side;  ///< the measure of feasibility
  double gap = 1e-3;  ///< up to which an objective counts as best: relative, or absolute below 1
};

/// The result of one contestant on one problem.
struct Entry {
  std::string problem, contestant;
  Attempt attempt;                   ///< of its first run
  std::optional<Measures> measures;  ///< of its z
  std::vector<double> seconds;       ///< of each run, ascending
  double reference = 0.0;            ///< best objective known: from the file, or of any feasible solution
  bool solved = false;               ///< feasible, and within the gap of the reference

  [[nodiscard]] double median_s() const { return seconds[seconds.size() / 2]; }
  [[nodiscard]] double excess() const;  ///< (objective − reference) / max(1, |reference|)
};

/// Results by problem, in the order of the contestants.
struct Comparison {
  std::vector<Entry> entries;
  bool interrupted = false;

  [[nodiscard]] PerformanceProfile profile() const;
};

/// Reads results recorded at another time: lines of CSV after a header that names the columns name, solver,
/// status, objective, equality, inequality, complementarity (the smaller side), iterations, ms. Errors:
/// not_found, or invalid_argument with the line.
[[nodiscard]] Expected<std::vector<Entry>> read_recorded(const std::string& path);

/// Runs the contestants one at a time. Recorded results of a problem are added to the measured ones. Errors:
/// internal if the files that peers read cannot be created.
[[nodiscard]] Expected<Comparison> compare(const std::vector<ProblemFile>& problems,
                                           const std::vector<Contestant>& contestants,
                                           const std::vector<Entry>& recorded,
                                           const ComparisonSettings& settings, const std::stop_token& stop);

}  // namespace marble::cli
