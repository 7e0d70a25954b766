// Random base problems with random scenarios, for tests of scenario solves.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "marble/composite/scenarios.h"
#include "random_vector.h"
#include "support/random_problem.h"

namespace marble::testing {

/// Every second variable is the plan. A scenario has other numbers wherever rows are not the plan's alone.
class RandomScenarios {
 public:
  explicit RandomScenarios(std::uint64_t seed, HessianForm form = HessianForm::full)
      : base(random_problem(
            {.variables = 10, .equalities = 4, .inequalities = 8, .pairs = 6, .density = 0.15}, seed)),
        seed_(seed) {
    if (form == HessianForm::upper_triangle) keep_upper();
    for (Index j = 0; j < 10; j += 2) first_stage.push_back(j);
  }

  [[nodiscard]] bool is_plan(Index j) const { return j % 2 == 0; }
  /// Whether a row has no entry but the plan's.
  [[nodiscard]] bool of_plan(const SparseMatrix& matrix, Index row) const {
    for (Index j = 0; j < matrix.columns; ++j)
      for (Index k = matrix.column_pointers[j]; k < matrix.column_pointers[j + 1]; ++k)
        if (matrix.row_indices[k] == row && !is_plan(j)) return false;
    return true;
  }
  [[nodiscard]] bool pair_of_plan(Index row) const { return of_plan(base.L, row) && of_plan(base.R, row); }

  [[nodiscard]] ScenarioNumbers scenario(std::int64_t number) const {
    ScenarioNumbers numbers;
    RandomVectors random(1000 * seed_ + static_cast<std::uint64_t>(number));
    const auto near = [&](const std::vector<double>& values) {
      std::vector<double> result = values;
      const Vector noise = random.next(static_cast<Eigen::Index>(values.size()));
      for (std::size_t i = 0; i < result.size(); ++i) result[i] += 0.1 * noise[static_cast<Eigen::Index>(i)];
      return result;
    };
    numbers.c0 = base.c0 + 0.1 * random.next(1)[0];
    numbers.g = near(base.g);
    numbers.Q = base.Q.values;
    for (double& value : numbers.Q) value *= 1.0 + 0.1 * static_cast<double>(number % 3);
    numbers.b = near(base.b);
    numbers.d = near(base.d);
    numbers.l = near(base.l);
    numbers.r = near(base.r);
    numbers.A = near(base.A.values);
    numbers.C = near(base.C.values);
    numbers.L = near(base.L.values);
    numbers.R = near(base.R.values);
    const auto restore = [&](const SparseMatrix& matrix, const std::vector<double>& offset,
                             std::vector<double>& values, std::vector<double>& offsets, bool pairs) {
      for (Index row = 0; row < matrix.rows; ++row) {
        if (!(pairs ? pair_of_plan(row) : of_plan(matrix, row))) continue;
        offsets[row] = offset[row];
        for (std::size_t k = 0; k < values.size(); ++k)
          if (matrix.row_indices[k] == row) values[k] = matrix.values[k];
      }
    };
    restore(base.A, base.b, numbers.A, numbers.b, false);
    restore(base.C, base.d, numbers.C, numbers.d, false);
    restore(base.L, base.l, numbers.L, numbers.l, true);
    restore(base.R, base.r, numbers.R, numbers.r, true);
    numbers.weight = 1.0 + static_cast<double>(number % 2);
    return numbers;
  }

  [[nodiscard]] ScenarioProblem problem() const {
    ScenarioProblem result;
    result.base = base.view();
    result.first_stage = first_stage;
    result.sample = [this](std::int64_t i) -> Expected<ScenarioNumbers> { return scenario(i); };
    return result;
  }

  OwnedProblem base;
  std::vector<Index> first_stage;

 private:
  void keep_upper() {
    Triplets upper;
    for (Index j = 0; j < base.Q.columns; ++j)
      for (Index k = base.Q.column_pointers[j]; k < base.Q.column_pointers[j + 1]; ++k)
        if (base.Q.row_indices[k] <= j) upper.add(base.Q.row_indices[k], j, base.Q.values[k]);
    base.Q = compress(base.Q.rows, base.Q.columns, upper, "Q").value();
    base.hessian_form = HessianForm::upper_triangle;
  }

  std::uint64_t seed_;
};

}  // namespace marble::testing
