// Provides performance profiles (Dolan and Moré, 2002): the share of problems that a solver solves within a
// factor of the best time.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "base/gnuplot.h"

namespace marble::cli {

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

}  // namespace marble::cli
