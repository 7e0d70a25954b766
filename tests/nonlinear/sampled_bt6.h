// BT6 under the paper's noise, F = f + ξ‖x − x₀ − 1‖², ξ ~ U[−1, 1]: as Eξ = 0, its optimum is that of BT6.
#pragma once

#include <algorithm>
#include <cmath>

#include "formula.h"
#include "marble/composite/counter_random.h"
#include "marble/retrospective.h"

namespace marble::testing {

class SampledBt6 {
 public:
  explicit SampledBt6(std::uint64_t seed, bool with_hessian = false) : random_(seed) {
    const auto all = classical_problems();
    bt6_ = *std::find_if(all.begin(), all.end(), [](const Formula& one) { return one.name == "bt6"; });
    Formula noisy = bt6_;
    noisy.parts = [this](const Jets& x) {
      Parts parts = bt6_.parts(x);
      for (const Jet& entry : x) parts.objective += Jet(mean()) * square(entry - 3);
      return parts;
    };
    sampled_.problem = problem_of(noisy, with_hessian);
    sampled_.use_samples = [this](std::int64_t N) {
      asked.push_back(N);
      for (; drawn_ < N; ++drawn_) sum_ += noise(drawn_);
    };
  }
  SampledBt6(const SampledBt6&) = delete;
  SampledBt6& operator=(const SampledBt6&) = delete;

  [[nodiscard]] nonlinear::SampledProblem& sampled() { return sampled_; }
  [[nodiscard]] const Formula& formula() const { return bt6_; }
  [[nodiscard]] double noise(std::int64_t sample) const {
    return 2 * random_.uniform(static_cast<std::uint64_t>(sample)) - 1;
  }
  [[nodiscard]] double mean() const { return drawn_ > 0 ? sum_ / static_cast<double>(drawn_) : 0.0; }

  /// ‖(∇f + ∇cᵀy, c)‖₂ of BT6 itself, by the y that makes it least.
  [[nodiscard]] double true_kkt(std::span<const double> x) const {
    const Parts at = bt6_.parts(bt6_.variables(x));
    const Jet &f = at.objective, &a = at.equalities[0], &b = at.equalities[1];
    double aa = 0, ab = 0, bb = 0, fa = 0, fb = 0;
    for (std::size_t j = 0; j < x.size(); ++j) {
      aa += a.slope(j) * a.slope(j), ab += a.slope(j) * b.slope(j), bb += b.slope(j) * b.slope(j);
      fa += f.slope(j) * a.slope(j), fb += f.slope(j) * b.slope(j);
    }
    const double det = aa * bb - ab * ab, y = (fb * ab - fa * bb) / det, z = (fa * ab - fb * aa) / det;
    double sum = a.value() * a.value() + b.value() * b.value();
    for (std::size_t j = 0; j < x.size(); ++j) {
      const double slope = f.slope(j) + y * a.slope(j) + z * b.slope(j);
      sum += slope * slope;
    }
    return std::sqrt(sum);
  }

  std::vector<std::int64_t> asked;  // of use_samples, in turn

 private:
  CounterRandom random_;
  Formula bt6_;
  nonlinear::SampledProblem sampled_;
  std::int64_t drawn_ = 0;
  double sum_ = 0.0;
};

}  // namespace marble::testing
