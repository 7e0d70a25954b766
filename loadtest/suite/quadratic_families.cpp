#include "quadratic_families.h"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "noise.h"

namespace marble::suite {
namespace {

SparseMatrix matrix(Index rows, Index columns, const Triplets& entries, const char* name) {
  return compress(rows, columns, entries, name).value();
}

// Four random entries per row.
Triplets scattered(Index rows, Index columns, Noise& noise) {
  Triplets entries;
  for (Index row = 0; row < rows; ++row) {
    for (int k = 0; k < 4; ++k) {
      const auto column = static_cast<Index>(0.5 * (noise.uniform() + 1.0) * columns);
      entries.add(row, std::min(column, columns - 1), noise.uniform());
    }
  }
  return entries;
}

std::vector<double> image(Index rows, const Triplets& entries, const std::vector<double>& z) {
  std::vector<double> value(static_cast<std::size_t>(rows));
  for (std::size_t k = 0; k < entries.values.size(); ++k)
    value[entries.rows[k]] += entries.values[k] * z[entries.columns[k]];
  return value;
}

}  // namespace

OwnedProblem scattered_problem(Index n, Curvature curvature, std::uint64_t seed) {
  Noise noise(seed);
  OwnedProblem p;
  Triplets Q;
  if (curvature != Curvature::diagonal) {
    const Triplets root = scattered(n / 2, n, noise);  // four entries per row
    for (std::size_t first = 0; first < root.values.size(); first += 4) {
      for (std::size_t i = first; i < first + 4; ++i) {
        for (std::size_t j = first; j < first + 4; ++j)
          Q.add(root.columns[i], root.columns[j], root.values[i] * root.values[j]);
      }
    }
  }
  for (Index j = 0; curvature != Curvature::singular && j < n; ++j) Q.add(j, j, 0.6 + 0.5 * noise.uniform());
  p.Q = matrix(n, n, Q, "Q");
  std::vector<double> point(static_cast<std::size_t>(n));
  for (double& entry : point) entry = noise.uniform();
  for (Index j = 0; j < n; ++j) p.g.push_back(noise.uniform());
  const Triplets A = scattered(n / 5, n, noise);
  p.A = matrix(n / 5, n, A, "A");
  p.b = image(n / 5, A, point);
  for (double& entry : p.b) entry = -entry;
  Triplets C = scattered(n, n, noise);
  p.d = image(n, C, point);
  for (double& entry : p.d) entry = std::max(0.0, noise.uniform()) - entry;
  for (Index j = 0; j < n; ++j) {
    C.add(n + 2 * j, j, 1.0);
    C.add(n + 2 * j + 1, j, -1.0);
    p.d.insert(p.d.end(), {2.0, 2.0});
  }
  p.C = matrix(3 * n, n, C, "C");
  return p;
}

OwnedProblem mpc_problem(Index steps, std::uint64_t seed) {
  constexpr double kStep_s = 0.1;
  Noise noise(seed);
  OwnedProblem p;
  Triplets Q, A, C;
  const Index n = 6 * steps;
  const auto at = [](Index step, Index which) { return 6 * step + which; };  // x y vx vy fx fy
  std::array<double, 4> state = {8.0 + 4.0 * noise.uniform(), 5.0 * noise.uniform(), noise.uniform(),
                                 noise.uniform()};
  for (Index step = 0; step < steps; ++step) {
    for (Index i = 0; i < 6; ++i) Q.add(at(step, i), at(step, i), i < 2 ? 1.0 : 0.1);
    for (Index i = 0; i < 4; ++i) {  // next state − its prediction = 0
      const Index row = 4 * step + i;
      A.add(row, at(step, i), 1.0);
      A.add(row, at(step, 4 + i % 2), i < 2 ? -0.5 * kStep_s * kStep_s : -kStep_s);
      if (step > 0) A.add(row, at(step - 1, i), -1.0);
      if (step > 0 && i < 2) A.add(row, at(step - 1, i + 2), -kStep_s);
      p.b.push_back(step > 0 ? 0.0 : -state[i] - (i < 2 ? kStep_s * state[i + 2] : 0.0));
    }
    for (Index i = 2; i < 6; ++i) {
      for (const double sign : {1.0, -1.0}) {
        C.add(static_cast<Index>(p.d.size()), at(step, i), sign);
        p.d.push_back(i < 4 ? 2.5 : 1.0 + 0.5 * (i - 4));
      }
    }
  }
  p.g.assign(static_cast<std::size_t>(n), 0.0);
  p.Q = matrix(n, n, Q, "Q");
  p.A = matrix(4 * steps, n, A, "A");
  p.C = matrix(8 * steps, n, C, "C");
  return p;
}

}  // namespace marble::suite
