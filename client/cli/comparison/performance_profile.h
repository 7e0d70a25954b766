// Performance profiles (Dolan and Moré, 2002): the share of problems that somebody solves within a factor of
// the best time.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "base/gnuplot.h"

namespace marble::cli {

class PerformanceProfile {
 public:
  /// Seconds by name, a number a problem in the same order for all; infinity where it was not solved.
  using Times = std::vector<std::pair<std::string, std::vector<double>>>;
  explicit PerformanceProfile(const Times& times);

  struct Curve {
    std::string name;
    std::vector<double> factors;  ///< of what it solved, ascending: time over the best time
    int fastest = 0;              ///< how often nobody was faster
    /// How many of the problems it solves within a factor.
    [[nodiscard]] int within(double factor) const;
  };
  [[nodiscard]] const std::vector<Curve>& curves() const { return curves_; }
  [[nodiscard]] int problems() const { return problems_; }

  /// A line each: "NAME is the fastest on 27 of 39 problems (69 %), at worst 8.0 times slower than the
  /// fastest, and solves 39."
  [[nodiscard]] std::string sentences() const;
  /// factor, and the share by each: a row wherever one changes.
  [[nodiscard]] std::string csv() const;
  /// gnuplot's commands, data included.
  [[nodiscard]] std::string picture(PictureFormat format, const std::string& title) const;

 private:
  std::vector<Curve> curves_;
  int problems_ = 0;
};

}  // namespace marble::cli
