// Reproduces the experiment of "Retrospective Approximation for Stochastic Constrained Problems Using
// Sequential Quadratic Programming" on BT6: how the error falls with the samples, and at what cost.
#pragma once

#include <stop_token>
#include <string>
#include <vector>

#include "base/gnuplot.h"
#include "marble/retrospective.h"
#include "output/text_table.h"

namespace marble::cli {

/// Results of one level over many seeds: medians, except for the quartiles.
struct LevelOfSeeds {
  std::int64_t samples = 0;
  double steps = 0.0, lcqps = 0.0;             ///< of this level and the earlier ones
  double gradients = 0.0;                      ///< of single samples, so far
  double kkt = 0.0, lower = 0.0, upper = 0.0;  ///< of the problem without noise, and its quartiles
  [[nodiscard]] double scaled() const;         ///< kkt · √samples
};

/// Runs seeds 0 … seeds − 1. Errors: cancelled; those of a solve.
[[nodiscard]] Expected<std::vector<LevelOfSeeds>> levels_of_seeds(int seeds, int levels,
                                                                  nonlinear::LevelTest test,
                                                                  const std::stop_token& stop);

[[nodiscard]] TextTable levels_table(const std::vector<LevelOfSeeds>& levels);
/// Returns one sentence: the range of kkt · √samples from level 3 on, and the cost.
[[nodiscard]] std::string levels_summary(const std::vector<LevelOfSeeds>& levels, int seeds);
/// Returns samples, kkt and its quartiles.
[[nodiscard]] std::string levels_csv(const std::vector<LevelOfSeeds>& levels);
/// Returns gnuplot's commands, data included: the error over the samples, with its quartiles and 2/√samples.
[[nodiscard]] std::string levels_picture(const std::vector<LevelOfSeeds>& levels, PictureFormat format);

}  // namespace marble::cli
