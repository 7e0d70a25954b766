#include "research/sampled_bt6.h"

#include <cmath>
#include <numbers>

namespace marble::cli {
namespace {

constexpr double kStart = 2.0;  // x₀, of every variable

}  // namespace

nonlinear::SampledProblem SampledBt6::sampled() {
  nonlinear::SampledProblem made;
  made.use_samples = [this](std::int64_t N) {
    for (; samples_ < N; ++samples_) sum_ += 2 * random_.uniform(static_cast<std::uint64_t>(samples_)) - 1;
    mean_ = sum_ / static_cast<double>(N);
  };
  made.problem.start.assign(5, kStart);
  made.problem.values = [this](std::span<const double> x) -> nonlinear::Values {
    double f = std::pow(x[0] - 1, 2) + std::pow(x[0] - x[1], 2) + std::pow(x[2] - 1, 2) +
               std::pow(x[3] - 1, 4) + std::pow(x[4] - 1, 6);
    for (const double entry : x) f += mean_ * std::pow(entry - kStart - 1, 2);
    evaluate_rows(x);
    return {.objective = f, .equalities = rows_};
  };
  made.problem.derivatives = [this](std::span<const double> x) -> nonlinear::Derivatives {
    differentiate(x);
    for (std::size_t j = 0; j < x.size(); ++j) gradient_[j] += 2 * mean_ * (x[j] - kStart - 1);
    return {.gradient = gradient_, .equalities = jacobian_.view()};
  };
  return made;
}

void SampledBt6::evaluate_rows(std::span<const double> x) {
  rows_[0] = x[0] * x[0] * x[3] + std::sin(x[3] - x[4]) - 2 * std::numbers::sqrt2;
  rows_[1] = x[1] + std::pow(x[2], 4) * x[1] * x[1] - 8 - std::numbers::sqrt2;
}

// Excludes the noise.
void SampledBt6::differentiate(std::span<const double> x) {
  gradient_[0] = 2 * (x[0] - 1) + 2 * (x[0] - x[1]);
  gradient_[1] = -2 * (x[0] - x[1]);
  gradient_[2] = 2 * (x[2] - 1);
  gradient_[3] = 4 * std::pow(x[3] - 1, 3);
  gradient_[4] = 6 * std::pow(x[4] - 1, 5);
  const double slope = std::cos(x[3] - x[4]), cube = std::pow(x[2], 3);
  jacobian_.values = {2 * x[0] * x[3], 1 + 2 * cube * x[2] * x[1], 4 * cube * x[1] * x[1],
                      x[0] * x[0] + slope, -slope};
}

// The two rows have no variable in common: each y is determined separately.
double SampledBt6::true_kkt(std::span<const double> x) {
  evaluate_rows(x);
  differentiate(x);
  double along[2] = {}, squared[2] = {}, sum = 0.0;
  for (std::size_t j = 0; j < x.size(); ++j) {
    const Index row = jacobian_.row_indices[j];
    along[row] += gradient_[j] * jacobian_.values[j];
    squared[row] += jacobian_.values[j] * jacobian_.values[j];
  }
  for (std::size_t j = 0; j < x.size(); ++j) {
    const Index row = jacobian_.row_indices[j];
    const double slope = gradient_[j] - along[row] / squared[row] * jacobian_.values[j];
    sum += slope * slope;
  }
  return std::sqrt(sum + rows_[0] * rows_[0] + rows_[1] * rows_[1]);
}

}  // namespace marble::cli
