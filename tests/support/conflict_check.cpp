#include "support/conflict_check.h"

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <random>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "support/brute_force.h"

namespace marble::testing {
namespace {

// Rows of several matrices, stacked.
struct Rows {
  Triplets entries;
  std::vector<double> constants;

  void add(const SparseMatrixView& m, std::span<const double> offsets, Index row) {
    for (Index j = 0; j < m.columns && !m.values.empty(); ++j) {
      for (Index k = m.column_pointers[j]; k < m.column_pointers[j + 1]; ++k) {
        if (m.row_indices[k] == row) entries.add(static_cast<Index>(constants.size()), j, m.values[k]);
      }
    }
    constants.push_back(offsets[row]);
  }
  [[nodiscard]] SparseMatrix matrix(Index columns) const {
    return compress(static_cast<Index>(constants.size()), columns, entries, "rows").value();
  }
};

bool has_point(const ProblemView& p, const Conflict& parts, unsigned choice) {
  const auto n = static_cast<Index>(p.g.size());
  Rows equal, at_least;
  for (const Index row : parts.equalities) equal.add(p.A, p.b, row);
  for (const Index row : parts.inequalities) at_least.add(p.C, p.d, row);
  for (const Index row : parts.left_sides) at_least.add(p.L, p.l, row);
  for (const Index row : parts.right_sides) at_least.add(p.R, p.r, row);
  for (std::size_t k = 0; k < parts.complementarities.size(); ++k) {
    const Index pair = parts.complementarities[k];
    if ((choice >> k & 1U) != 0) {
      equal.add(p.R, p.r, pair);
    } else {
      equal.add(p.L, p.l, pair);
    }
  }
  OwnedProblem rows;
  rows.g.assign(p.g.size(), 0.0);
  Triplets distance;
  for (Index j = 0; j < n; ++j) distance.add(j, j, 1.0);
  rows.Q = compress(n, n, distance, "Q").value();
  rows.A = equal.matrix(n);
  rows.b = equal.constants;
  rows.C = at_least.matrix(n);
  rows.d = at_least.constants;
  return brute_force(rows.view()).has_value();
}

}  // namespace

bool have_point(const ProblemView& problem, const Conflict& parts) {
  const std::size_t pairs = parts.complementarities.size();
  if (pairs > 12) throw std::invalid_argument("more than 12 complementarities");
  for (unsigned choice = 0; choice < (1U << pairs); ++choice) {
    if (has_point(problem, parts, choice)) return true;
  }
  return false;
}

bool is_irreducible(const ProblemView& problem, const Conflict& parts) {
  for (std::vector<Index> Conflict::*const kind :
       {&Conflict::equalities, &Conflict::inequalities, &Conflict::left_sides, &Conflict::right_sides,
        &Conflict::complementarities}) {
    for (std::size_t k = 0; k < (parts.*kind).size(); ++k) {
      Conflict rest = parts;
      (rest.*kind).erase((rest.*kind).begin() + static_cast<std::ptrdiff_t>(k));
      if (!have_point(problem, rest)) return false;
    }
  }
  return true;
}

namespace {

// A row and its constant.
struct Row {
  Eigen::VectorXd a;
  double constant = 0.0;

  friend Row operator+(Row x, const Row& y) {
    x.a += y.a;
    x.constant += y.constant;
    return x;
  }
  friend Row operator*(double factor, Row x) {
    x.a *= factor;
    x.constant *= factor;
    return x;
  }
  friend Row operator+(Row x, double more) {
    x.constant += more;
    return x;
  }
};

class Planter {
 public:
  explicit Planter(std::uint64_t seed) : engine_(seed) {}

  OwnedProblem plant(Plant plant) {
    begin();
    const int count = between(1, 4);
    switch (plant) {
      case Plant::inequalities:
        return sum_up(inequalities_, between(1, 5), false);
      case Plant::equalities:
        return sum_up(equalities_, between(1, 4), true);
      case Plant::sides:
        return sides(between(1, 3));
      case Plant::subset_sum:
        return subset_sum(count, 0.0);
      case Plant::subset_band:
        return subset_sum(count, 0.2);
      case Plant::budgets:
        return budgets(count);
    }
    return {};
  }

 private:
  double uniform() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }
  int between(int low, int high) {
    return low + static_cast<int>(engine_() % static_cast<std::uint64_t>(high - low + 1));
  }
  Row random_row() {
    Row row{Eigen::VectorXd::Zero(variables_), 0.0};
    for (double& entry : row.a) entry = uniform() < 0.3 ? 2.0 * uniform() - 1.0 : 0.0;
    row.a[between(0, variables_ - 1)] += 1.0;
    return row;
  }
  // Returns a row with this value at the point that was drawn first.
  Row row_with(double value) {
    Row row = random_row();
    row.constant = value - row.a.dot(point_);
    return row;
  }
  double margin() { return 0.5 + uniform(); }
  double weight() { return 0.5 + uniform(); }

  void begin() {
    const int pairs = between(4, 11);
    variables_ = pairs + between(4, 10);
    point_ = Eigen::VectorXd::Zero(variables_);
    for (double& entry : point_) entry = 2.0 * uniform() - 1.0;
    for (int i = between(0, 3); i > 0; --i) equalities_.push_back(row_with(0.0));
    for (int i = between(2, 8); i > 0; --i)
      inequalities_.push_back(row_with(uniform() < 0.5 ? 0.0 : uniform()));
    for (int i = 0; i < pairs; ++i) {
      const double kind = uniform();
      left_.push_back(row_with(kind < 0.4 ? uniform() : 0.0));
      right_.push_back(row_with(kind > 0.6 ? uniform() : 0.0));
    }
  }

  // Adds rows, and one that contradicts their weighted sum.
  OwnedProblem sum_up(std::vector<Row>& rows, int count, bool any_sign) {
    Row last{Eigen::VectorXd::Zero(variables_), -margin()};
    for (int i = 0; i < count; ++i) {
      const Row row = row_with(any_sign ? 0.0 : uniform());
      rows.push_back(row);
      last = last + (any_sign && uniform() < 0.5 ? weight() : -weight()) * row;
    }
    inequalities_.push_back(last);
    return finish();
  }
  OwnedProblem sides(int count) {
    Row last{Eigen::VectorXd::Zero(variables_), -margin()};
    for (int i = 0; i < count; ++i) {
      const auto pair = static_cast<std::size_t>(between(0, static_cast<int>(left_.size()) - 1));
      last = last + -weight() * (uniform() < 0.5 ? left_[pair] : right_[pair]);
    }
    inequalities_.push_back(last);
    return finish();
  }
  // Σ c e is an integer if each e is 0 or 1.
  OwnedProblem subset_sum(int count, double band) {
    Row sum{Eigen::VectorXd::Zero(variables_), 0.0};
    double reachable = 0.0;
    for (int i = 0; i < count; ++i) {
      const Row e = row_with(uniform() < 0.5 ? 0.0 : 1.0);
      left_.push_back(e);
      right_.push_back(-1.0 * e + 1.0);
      const double c = between(1, 3);
      if (uniform() < 0.5) reachable += c;
      sum = sum + c * e;
    }
    sum = sum + -(reachable + (reachable > 0.0 ? -0.5 : 0.5));
    if (band > 0.0) {
      inequalities_.push_back(sum + band);
      inequalities_.push_back(-1.0 * sum + band);
    } else {
      equalities_.push_back(sum);
    }
    return finish();
  }
  OwnedProblem budgets(int count) {
    Row left{Eigen::VectorXd::Zero(variables_), count / 2 + 0.5};
    Row right{Eigen::VectorXd::Zero(variables_), count - count / 2 - 0.5};
    for (int i = 0; i < count; ++i) {
      const Row e = row_with(uniform()), f = row_with(0.0);
      left_.push_back(e);
      right_.push_back(f);
      inequalities_.push_back(e + f + -1.0);
      left = left + -1.0 * e;
      right = right + -1.0 * f;
    }
    inequalities_.push_back(left);
    inequalities_.push_back(right);
    return finish();
  }

  void shuffle(std::vector<Row>& rows, std::vector<Row>* beside) {
    for (std::size_t i = rows.size(); i > 1; --i) {
      const auto j = static_cast<std::size_t>(between(0, static_cast<int>(i) - 1));
      std::swap(rows[i - 1], rows[j]);
      if (beside != nullptr) std::swap((*beside)[i - 1], (*beside)[j]);
    }
  }
  SparseMatrix matrix(const std::vector<Row>& rows, std::vector<double>& constants) {
    Triplets entries;
    for (const Row& row : rows) {
      for (Index j = 0; j < variables_; ++j) {
        if (row.a[j] != 0.0) entries.add(static_cast<Index>(constants.size()), j, row.a[j]);
      }
      constants.push_back(row.constant);
    }
    return compress(static_cast<Index>(rows.size()), variables_, entries, "rows").value();
  }
  OwnedProblem finish() {
    shuffle(equalities_, nullptr);
    shuffle(inequalities_, nullptr);
    shuffle(left_, &right_);
    OwnedProblem p;
    p.name = "planted";
    Triplets hessian;
    for (Index j = 0; j < variables_; ++j) hessian.add(j, j, 1.0 + uniform());
    p.Q = compress(variables_, variables_, hessian, "Q").value();
    for (Index j = 0; j < variables_; ++j) p.g.push_back(2.0 * uniform() - 1.0);
    p.A = matrix(equalities_, p.b);
    p.C = matrix(inequalities_, p.d);
    p.L = matrix(left_, p.l);
    p.R = matrix(right_, p.r);
    return p;
  }

  std::mt19937_64 engine_;
  Index variables_ = 0;
  Eigen::VectorXd point_;
  std::vector<Row> equalities_, inequalities_, left_, right_;
};

}  // namespace

OwnedProblem planted_conflict(Plant plant, std::uint64_t seed) {
  return Planter(8 * seed + static_cast<std::uint64_t>(plant)).plant(plant);
}

}  // namespace marble::testing
