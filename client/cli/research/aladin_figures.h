// Reproduces the example and the two figures of "ALADIN-β: A Distributed Optimization Algorithm for Solving
// MPCC Problems" with this solver's methods instead of their authors'.
#pragma once

#include <cstdint>
#include <stop_token>
#include <string>
#include <vector>

#include "base/gnuplot.h"
#include "marble/options.h"
#include "marble/problem.h"
#include "output/text_table.h"

namespace marble::cli {

/// Returns (18): min ½|s − e|² + ½|t − e|² over s, t ≥ 0, with sᵀt = 0 written as `pairs` complementary
/// pairs.
[[nodiscard]] OwnedProblem aladin_example(int pairs);

/// The start of a run.
enum class AladinStart {
  path,  ///< one pair, at (1, 1): figure 1
  near,  ///< ten pairs, every entry within 2 % of 1: figure 2
  far,   ///< ten pairs, anywhere in [0, 2]
};

/// The iterates of a method from one start, from iteration 0 on.
struct AladinRun {
  AladinStart start = AladinStart::path;
  Method method = Method::aladin_beta;
  std::uint64_t seed = 0;
  std::vector<double> s, t;             ///< of the first pair
  std::vector<double> error;            ///< distance to the nearest local minimum
  std::vector<double> complementarity;  ///< max |s·t| over the pairs
  int fell_back = -1;                   ///< the iteration after which another method took over; −1: none
  int factorizations = 0;

  /// Returns the first iteration from which on no value exceeds `most`; −1 if the last one does.
  [[nodiscard]] static int settled(const std::vector<double>& values, double most);
};

/// Runs figure 1, and seeds 0 … seeds − 1 of figure 2 and of far starts: 100 iterations each, as in the
/// paper, or fewer if a method cannot continue. Errors: cancelled.
[[nodiscard]] Expected<std::vector<AladinRun>> aladin_runs(int seeds, const std::stop_token& stop);

/// Returns a row per start and method: how many seeds reach 1e-10 and fall back, the slowest of those that
/// reach it, and the worst final value; factorizations are a mean.
[[nodiscard]] TextTable aladin_table(const std::vector<AladinRun>& runs);
/// Returns a line per iteration of every run.
[[nodiscard]] std::string aladin_csv(const std::vector<AladinRun>& runs);
/// Returns gnuplot's commands, data included: figure 1's path, then figure 2's errors and products of seed 0,
/// on one page.
[[nodiscard]] std::string aladin_picture(const std::vector<AladinRun>& runs, PictureFormat format);

}  // namespace marble::cli
