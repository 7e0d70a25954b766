// Generates strictly convex QPs in which one row is another one plus e times noise, with an optimum known by
// construction.
#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "hard_families.h"
#include "model.h"
#include "noise.h"

namespace marble::suite {
namespace {

using examples::Model;
using examples::Terms;

enum class Kind { equalities, inequalities, one_of_each, pairs };

Eigen::VectorXd random_vector(Noise& noise, Index size) {
  return Eigen::VectorXd::NullaryExpr(size, [&] { return noise.uniform(); });
}

Terms terms_of(const Eigen::VectorXd& row) {
  Terms terms;
  for (Index j = 0; j < row.size(); ++j) terms.push_back({j, row[j]});
  return terms;
}

// The solution is z, with multipliers of the parallel rows that are 1/e and differ by about 1: the sum of
// their terms is again about 1. The zero sides of pairs have positive multipliers, so that z is also the
// optimum without complementarity.
HardProblem parallel_rows(const std::string& family, Kind kind, Index n, Index m, bool box,
                          std::uint64_t seed) {
  Noise noise(seed);
  const double e = std::pow(10.0, -2.0 - static_cast<double>(seed / 2 % 6));
  const Eigen::VectorXd z = random_vector(noise, n);
  Eigen::VectorXd gradient = -z;  // with Q = I
  Model model(family, n);
  for (Index j = 0; j < n; ++j) model.add_square(1.0, {{j, 1.0}});
  Eigen::VectorXd first;
  for (Index i = 0; i < m; ++i) {
    Eigen::VectorXd row = random_vector(noise, n);
    if (i == 1) row = e * row + (kind == Kind::equalities ? first : Eigen::VectorXd(-first));
    if (i == 0) first = row;
    const double multiplier = i < 2 ? 1.0 / e + (i == 0 ? 0.0 : noise.uniform()) : 1.5 + noise.uniform();
    const bool opposite = kind == Kind::equalities && i == 1;
    gradient += (opposite ? -multiplier : multiplier) * row;
    const double constant = -row.dot(z);
    if (kind == Kind::pairs) {
      const Eigen::VectorXd other = random_vector(noise, n);
      model.complementary(terms_of(row), constant, terms_of(other), 1.5 + noise.uniform() - other.dot(z));
    } else if (kind == Kind::equalities || (kind == Kind::one_of_each && i == 0)) {
      model.equal_zero(terms_of(row), constant);
    } else {
      model.at_least_zero(terms_of(row), constant);
    }
  }
  for (Index j = 0; box && j < n; ++j) model.within({{j, 1.0}}, 10.0);
  HardProblem result{family, model.problem(), {}};
  result.problem.g.assign(gradient.data(), gradient.data() + n);
  result.optimum = 0.5 * z.squaredNorm() + gradient.dot(z);
  return result;
}

}  // namespace

void add_parallel_rows(std::vector<HardProblem>& all, int seeds, bool judging) {
  struct Family {
    const char* name;
    Kind kind;
  };
  for (const auto& [name, kind] :
       {Family{"equalities", Kind::equalities}, Family{"inequalities", Kind::inequalities},
        Family{"one of each", Kind::one_of_each}, Family{"pairs", Kind::pairs}}) {
    for (const bool box : {false, true}) {
      const std::string family = "parallel " + std::string(name) + (box ? ", box" : "");
      for (int number = 0; number < seeds; ++number) {
        const auto seed = static_cast<std::uint64_t>(2 * number + (judging ? 2 : 1));
        for (const auto& [n, m] : {std::pair<Index, Index>{2, 2}, {3, 2}, {6, 3}, {20, 10}, {50, 40}})
          all.push_back(parallel_rows(family, kind, n, m, box, seed));
      }
    }
  }
}

}  // namespace marble::suite
