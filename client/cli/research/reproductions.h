// Declares what `marble reproduce` prints and draws beyond its tables of problems.
#pragma once

#include <cstdint>
#include <stop_token>
#include <string>
#include <vector>

#include "base/gnuplot.h"
#include "marble/composite/counter_random.h"
#include "marble/options.h"
#include "marble/problem.h"
#include "marble/problem_file.h"
#include "marble/research/conditioning.h"
#include "marble/retrospective.h"
#include "output/text_table.h"

namespace marble::cli {

// Reproduces the experiment of "Retrospective Approximation for Stochastic Constrained Problems Using
// Sequential Quadratic Programming" on BT6: how the error falls with the samples, and at what cost.

// Provides BT6 (P. Boggs, J. Tolle) with the noise of "Retrospective Approximation for Stochastic Constrained
// Problems Using Sequential Quadratic Programming": F = f + ξ‖x − x₀ − 1‖², ξ ~ U[−1, 1].

/// Five variables, two equalities. As Eξ = 0, the optimum is that of f, 0.277044924.
class SampledBt6 {
 public:
  explicit SampledBt6(std::uint64_t seed) : random_(seed) {}
  SampledBt6(const SampledBt6&) = delete;
  SampledBt6& operator=(const SampledBt6&) = delete;

  /// The result borrows this object.
  [[nodiscard]] nonlinear::SampledProblem sampled();
  /// Returns ‖(∇f + ∇cᵀy, c)‖₂ without the noise, with the y that minimizes it.
  [[nodiscard]] double true_kkt(std::span<const double> x);

 private:
  void evaluate_rows(std::span<const double> x);
  void differentiate(std::span<const double> x);

  CounterRandom random_;
  std::int64_t samples_ = 0;
  double sum_ = 0.0, mean_ = 0.0;  // of ξ over the samples
  double rows_[2] = {}, gradient_[5] = {};
  SparseMatrix jacobian_{2, 5, {0, 1, 2, 3, 4, 5}, {0, 1, 1, 0, 0}, std::vector<double>(5, 0.0)};
};

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

// Reproduces the example and the two figures of "ALADIN-β: A Distributed Optimization Algorithm for Solving
// MPCC Problems" with this solver's methods instead of their authors'.

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

// Reproduces the paper's section IV.A as a table: its softplus against the exponential, on the same path.

/// One problem's path with each retraction.
struct RetractionPair {
  std::string problem;
  PathConditions softplus, exponential;
};

/// Errors: those of the options; cancelled.
[[nodiscard]] Expected<std::vector<RetractionPair>> compare_retractions(
    const std::vector<ProblemFile>& problems, const Options& options, const std::stop_token& stop);

/// Returns a row per problem; then what both solved, and the median condition of ∇r by κ.
[[nodiscard]] std::string retraction_report(const std::vector<RetractionPair>& pairs);

}  // namespace marble::cli
