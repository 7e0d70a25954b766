// The same problems in other units: of all variables, of each, of rows, of the cost.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <string>
#include <vector>

#include "families.h"
#include "noise.h"
#include "support/shared_problems.h"

namespace marble::suite {
namespace {

using Factors = std::function<double()>;

struct Units {
  std::string name;
  Factors variable = [] { return 1.0; };  // z_j = factor z′_j
  Factors row = [] { return 1.0; };       // every row, its constant with it
  double cost = 1.0;
};

void scale_rows(SparseMatrix& matrix, std::vector<double>& constants, const std::vector<double>& columns,
                const Factors& row) {
  std::vector<double> rows(constants.size());
  for (double& factor : rows) factor = row();
  for (std::size_t i = 0; i < rows.size(); ++i) constants[i] *= rows[i];
  for (Index j = 0; j < matrix.columns; ++j) {
    for (Index k = matrix.column_pointers[j]; k < matrix.column_pointers[j + 1]; ++k)
      matrix.values[k] *= rows[matrix.row_indices[k]] * columns[j];
  }
}

OwnedProblem in_units(OwnedProblem p, const Units& units) {
  std::vector<double> columns(p.g.size());
  for (double& factor : columns) factor = units.variable();
  for (Index j = 0; j < p.Q.columns; ++j) {
    for (Index k = p.Q.column_pointers[j]; k < p.Q.column_pointers[j + 1]; ++k)
      p.Q.values[k] *= units.cost * columns[j] * columns[p.Q.row_indices[k]];
    p.g[j] *= units.cost * columns[j];
  }
  p.c0 *= units.cost;
  scale_rows(p.A, p.b, columns, units.row);
  scale_rows(p.C, p.d, columns, units.row);
  scale_rows(p.L, p.l, columns, units.row);
  scale_rows(p.R, p.r, columns, units.row);
  return p;
}

}  // namespace

void units(const Settings& settings) {
  const auto power = [](double exponent) { return [=] { return std::pow(10.0, exponent); }; };
  std::vector<Units> all;
  for (int k = -8; k <= 8; ++k) all.push_back({"z = 1e" + std::to_string(k) + " z'", power(k)});
  for (const int k : {-8, 8}) {
    all.push_back({"rows x 1e" + std::to_string(k), power(0), power(k)});
    all.push_back({"cost x 1e" + std::to_string(k), power(0), power(0), std::pow(10.0, k)});
  }
  Noise noise(1);
  for (int seed = 1; seed <= settings.seeds; ++seed) {
    const auto random = [&noise] { return std::pow(10.0, 4.0 * noise.uniform()); };
    all.push_back({"variables x 1e+-4 ~" + std::to_string(seed), random});
    all.push_back({"rows x 1e+-4 ~" + std::to_string(seed), power(0), random});
  }
  const std::vector<std::filesystem::path> files = problem_files(settings.benchmarks / "macmpec");
  if (files.empty()) return;
  std::printf("%-24s %8s %8s %8s  %s\n", "units", "right", "median", "worst", "not right");
  for (const Units& units : all) {
    std::vector<double> factorizations;
    std::string wrong;
    std::size_t right = 0;
    for (const auto& file : files) {
      const auto [nominal, reference] = testing::read_shared(file);
      const Record record =
          solve_and_judge(file.stem(), in_units(nominal, units), {}, units.cost * reference);
      const double loss =
          (record.objective - record.reference) / std::max(units.cost, std::abs(record.reference));
      const bool is_right = record.feasible() && loss <= 1e-5;
      right += is_right ? 1 : 0;
      if (!is_right) wrong += " " + record.problem;
      factorizations.push_back(record.factorizations);
    }
    std::printf("%-24s %5zu/%zu %8.0f %8.0f %s\n", units.name.c_str(), right, files.size(),
                median(factorizations), *std::ranges::max_element(factorizations), wrong.c_str());
    std::fflush(stdout);
  }
}

}  // namespace marble::suite
