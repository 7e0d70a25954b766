#include "support/small_problems.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "support/problem_builder.h"

namespace marble::testing {
namespace {

using Builder = ProblemBuilder;
using Row = ProblemBuilder::Row;

// Two copies of: x² − 2x + y² over x ≥ 0 and y minimising (y − x)² s.t. ½ ≤ y ≤ 1½, with multipliers u and v.
SmallProblem ex9_2_6() {
  Builder b("ex9_2_6", {-2, 0, 0, 0, -2, 0, 0, 0});
  for (Index copy = 0; copy < 2; ++copy) {
    const auto first = static_cast<std::size_t>(4 * copy);
    const auto row = [first](double x, double y, double u, double v, double constant) {
      Row all(9, 0.0);
      const double terms[] = {x, y, u, v};
      std::copy(std::begin(terms), std::end(terms), all.begin() + static_cast<std::ptrdiff_t>(first));
      all[8] = constant;
      return all;
    };
    b.quadratic(4 * copy, 4 * copy, 2).quadratic(4 * copy + 1, 4 * copy + 1, 2);
    b.equal(row(-2, 2, -1, 1, 0)).at_least(row(1, 0, 0, 0, 0)).at_least(row(0, 1, 0, 0, 0));
    b.pair(row(0, 1, 0, 0, -0.5), row(0, 0, 1, 0, 0)).pair(row(0, -1, 0, 0, 1.5), row(0, 0, 0, 1, 0));
  }
  return b.optimum(-1.0);
}

// ½ (x₁ + x₂ + y₁ − 15)² + ½ (x₁ + x₂ + y₂ − 15)², 0 ≤ x ≤ 10, 0 ≤ y ⊥ Nx + My − (36, 25) ≥ 0.
SmallProblem flp2() {
  Builder b("flp2", {-30, -30, -15, -15});
  b.constant(225).quadratic(0, 0, 2).quadratic(0, 1, 2).quadratic(1, 1, 2);
  for (const Index y : {2, 3}) b.quadratic(0, y, 1).quadratic(1, y, 1).quadratic(y, y, 1);
  b.at_least({1, 0, 0, 0, 0}).at_least({-1, 0, 0, 0, 10});
  b.at_least({0, 1, 0, 0, 0}).at_least({0, -1, 0, 0, 10});
  b.pair({0, 0, 1, 0, 0}, {8.0 / 3.0, 2, 2, 8.0 / 3.0, -36});
  b.pair({0, 0, 0, 1, 0}, {2, 1.25, 1.25, 2, -25});
  return b.optimum(0.0);
}

// (y₁ − 2)² + y₂² over a design x and y minimising 0.01 y₁² + y₂² s.t. three constraints that depend on x: z
// = (y, x, multipliers).
SmallProblem sl1() {
  Builder b("sl1", {-4, 0, 0, 0, 0, 0, 0, 0});
  b.constant(4).quadratic(0, 0, 2).quadratic(1, 1, 2);
  b.equal({0.02, 0, 0, 0, 0, -10, -1, 0, 0}).equal({0, 2, 0, 0, 0, -1, 0, -1, 0});
  b.at_least({0, 0, 1, 0, 0, 0, 0, 0, -10});
  b.at_least({0, 0, 0, 1, 0, 0, 0, 0, -0.01}).at_least({0, 0, 0, -1, 0, 0, 0, 0, 10});
  b.at_least({0, 0, 0, 0, 1, 0, 0, 0, 0}).at_least({0, 0, 0, 0, -1, 0, 0, 0, 1});
  b.pair({10, 1, -1, 0, 0, 0, 0, 0, -10}, {0, 0, 0, 0, 0, 1, 0, 0, 0});
  b.pair({1, 0, 0, -1, 0, 0, 0, 0, -2}, {0, 0, 0, 0, 0, 0, 1, 0, 0});
  b.pair({0, 1, 0, 0, -50, 0, 0, 0, 0}, {0, 0, 0, 0, 0, 0, 0, 1, 0});
  return b.optimum(1e-4);
}

}  // namespace

SmallProblem public_example() {
  Builder b("public example", {0, 0, 0, 0});
  for (Index i = 0; i < 4; ++i) b.quadratic(i, i, 2.0);
  return b.equal({1, 0, 0, 0, -1})
      .at_least({0, 1, 0, 0, -1})
      .pair({0, 0, 1, 0, 1}, {0, 0, 0, 1, -1})
      .optimum(3.0);
}

std::vector<SmallProblem> small_problems() {
  std::vector<SmallProblem> all;
  all.push_back(public_example());

  // MacMPEC. (x − 1)² + y², 0 ≤ y ⊥ y − x ≥ 0.
  all.push_back(Builder("jr1", {-2, 0})
                    .quadratic(0, 0, 2)
                    .quadratic(1, 1, 2)
                    .constant(1)
                    .pair({0, 1, 0}, {-1, 1, 0})
                    .optimum(0.5));
  // (y − 1)² + x², 0 ≤ y ⊥ y − x ≥ 0.
  all.push_back(Builder("jr2", {0, -2})
                    .quadratic(0, 0, 2)
                    .quadratic(1, 1, 2)
                    .constant(1)
                    .pair({0, 1, 0}, {-1, 1, 0})
                    .optimum(0.5));
  // x + y, 0 ≤ x ⊥ y ≥ 0.
  all.push_back(Builder("kth1", {1, 1}).pair({1, 0, 0}, {0, 1, 0}).optimum(0.0));
  // x + (y − 1)², the same pair.
  all.push_back(
      Builder("kth2", {1, -2}).quadratic(1, 1, 2).constant(1).pair({1, 0, 0}, {0, 1, 0}).optimum(0.0));
  // ½(x − 1)² + (y − 1)²
  all.push_back(Builder("kth3", {-1, -2})
                    .quadratic(0, 0, 1)
                    .quadratic(1, 1, 2)
                    .constant(1.5)
                    .pair({1, 0, 0}, {0, 1, 0})
                    .optimum(0.5));
  // ½((x − 1)² + (y − 1)²)
  all.push_back(Builder("scholtes3", {-1, -1})
                    .quadratic(0, 0, 1)
                    .quadratic(1, 1, 1)
                    .constant(1)
                    .pair({1, 0, 0}, {0, 1, 0})
                    .optimum(0.5));
  // x² + (u − 10)², 0 ≤ x ≤ 15; 0 ≤ 4(x + 2u − 30) + λ ⊥ u ≥ 0; 0 ≤ 20 − x − u ⊥ λ ≥ 0.
  all.push_back(Builder("gauvin", {0, -20, 0})
                    .quadratic(0, 0, 2)
                    .quadratic(1, 1, 2)
                    .constant(100)
                    .at_least({1, 0, 0, 0})
                    .at_least({-1, 0, 0, 15})
                    .pair({4, 8, 1, -120}, {0, 1, 0, 0})
                    .pair({-1, -1, 0, 20}, {0, 0, 1, 0})
                    .optimum(20.0));
  // (x − 5)² + (2y + 1)² over y solving min (y − 1)² − 1.5xy with three constraints, by its KKT conditions.
  all.push_back(Builder("bard1", {-10, 4, 0, 0, 0})
                    .quadratic(0, 0, 2)
                    .quadratic(1, 1, 8)
                    .constant(26)
                    .equal({-1.5, 2, 1, -0.5, 1, -2})
                    .at_least({1, 0, 0, 0, 0, 0})
                    .at_least({0, 1, 0, 0, 0, 0})
                    .pair({3, -1, 0, 0, 0, -3}, {0, 0, 1, 0, 0, 0})
                    .pair({-1, 0.5, 0, 0, 0, 4}, {0, 0, 0, 1, 0, 0})
                    .pair({-1, -1, 0, 0, 0, 7}, {0, 0, 0, 0, 1, 0})
                    .optimum(17.0));

  // x² + (y − 10)² over y ≤ x ≤ 15 and y minimising (x + 2y − 30)² s.t. x + y ≤ 20, 0 ≤ y ≤ 20.
  all.push_back(Builder("ex9_2_2", {0, -20, 0, 0, 0})
                    .quadratic(0, 0, 2)
                    .quadratic(1, 1, 2)
                    .constant(100)
                    .equal({2, 4, 1, -1, 1, -60})
                    .at_least({1, -1, 0, 0, 0, 0})
                    .at_least({1, 0, 0, 0, 0, 0})
                    .at_least({-1, 0, 0, 0, 0, 15})
                    .pair({-1, -1, 0, 0, 0, 20}, {0, 0, 1, 0, 0, 0})
                    .pair({0, 1, 0, 0, 0, 0}, {0, 0, 0, 1, 0, 0})
                    .pair({0, -1, 0, 0, 0, 20}, {0, 0, 0, 0, 1, 0})
                    .optimum(100.0));
  // (x − 3)² + (y − 2)² over 0 ≤ x ≤ 8 and y minimising (y − 5)² in a triangle.
  all.push_back(Builder("ex9_2_5", {-6, -4, 0, 0, 0})
                    .quadratic(0, 0, 2)
                    .quadratic(1, 1, 2)
                    .constant(13)
                    .equal({0, 2, 1, -2, 2, -10})
                    .at_least({1, 0, 0, 0, 0, 0})
                    .at_least({-1, 0, 0, 0, 0, 8})
                    .pair({2, -1, 0, 0, 0, 1}, {0, 0, 1, 0, 0, 0})
                    .pair({-1, 2, 0, 0, 0, -2}, {0, 0, 0, 1, 0, 0})
                    .pair({-1, -2, 0, 0, 0, 14}, {0, 0, 0, 0, 1, 0})
                    .optimum(5.0));
  all.push_back(ex9_2_6());
  all.push_back(flp2());
  all.push_back(sl1());

  // Without pairs.
  all.push_back(Builder("unconstrained", {-2, 4}).quadratic(0, 0, 2).quadratic(1, 1, 2).optimum(-5.0));
  all.push_back(
      Builder("equality only", {0, 0}).quadratic(0, 0, 2).quadratic(1, 1, 2).equal({1, 1, -2}).optimum(2.0));
  all.push_back(Builder("inequality only", {-4, -4})
                    .quadratic(0, 0, 2)
                    .quadratic(1, 1, 2)
                    .at_least({-1, -1, 2})
                    .optimum(-6.0));
  all.push_back(Builder("linear program", {-1, -2})
                    .at_least({1, 0, 0})
                    .at_least({0, 1, 0})
                    .at_least({-1, -1, 1})
                    .optimum(-2.0));
  // Degenerate problems.
  all.push_back(Builder("biactive at the origin", {1, 1})
                    .quadratic(0, 0, 2)
                    .quadratic(1, 1, 2)
                    .pair({1, 0, 0}, {0, 1, 0})
                    .optimum(0.0));
  all.push_back(Builder("duplicate equality", {0, 0})
                    .quadratic(0, 0, 2)
                    .quadratic(1, 1, 2)
                    .equal({1, 1, -2})
                    .equal({2, 2, -4})
                    .optimum(2.0));
  all.push_back(Builder("duplicate inequality", {-4, -4})
                    .quadratic(0, 0, 2)
                    .quadratic(1, 1, 2)
                    .at_least({-1, -1, 2})
                    .at_least({-3, -3, 6})
                    .optimum(-6.0));
  all.push_back(
      Builder("zero row", {-2, 0}).quadratic(0, 0, 2).quadratic(1, 1, 2).at_least({0, 0, 1}).optimum(-1.0));
  all.push_back(Builder("both sides of a pair are forced", {-1, -1})
                    .quadratic(0, 0, 1)
                    .quadratic(1, 1, 1)
                    .equal({1, 0, 0})
                    .at_least({0, -1, 3})
                    .pair({1, 0, 0}, {0, 1, 0})
                    .optimum(-0.5));
  all.push_back(Builder("badly scaled", {-2e-3, 0})
                    .quadratic(0, 0, 2e-6)
                    .quadratic(1, 1, 2e6)
                    .constant(1)
                    .pair({0, 1e3, 0}, {-1e-3, 1e3, 0})
                    .optimum(0.5));
  all.push_back(Builder("duplicate pair", {-1, -2})
                    .quadratic(0, 0, 1)
                    .quadratic(1, 1, 2)
                    .constant(1.5)
                    .pair({1, 0, 0}, {0, 1, 0})
                    .pair({0, 3, 0}, {2, 0, 0})
                    .optimum(0.5));
  all.push_back(Builder("a pair's side without variables", {-2, -2})
                    .quadratic(0, 0, 2)
                    .quadratic(1, 1, 2)
                    .constant(2)
                    .pair({0, 0, 1}, {1, 0, 0})
                    .optimum(1.0));
  all.push_back(Builder("two chained pairs", {-2, -4, 0})
                    .quadratic(0, 0, 2)
                    .quadratic(1, 1, 2)
                    .quadratic(2, 2, 2)
                    .pair({1, 0, 0, 0}, {0, 1, 0, 0})
                    .pair({0, 1, 0, 0}, {0, 0, 1, 0})
                    .optimum(-4.0));
  return all;
}

OwnedProblem obstacle_problem(Index n) {
  OwnedProblem p;
  Triplets Q, C;
  const double inverse = n + 1.0;
  for (Index j = 0; j < n; ++j) {
    if (j > 0) Q.add(j - 1, j, -inverse), Q.add(j, j - 1, -inverse);
    Q.add(j, j, 2.0 * inverse);
    C.add(j, j, 1.0);
    const double x = (j + 1.0) / inverse;
    p.d.push_back(0.2 * (x - 0.4) * (x - 0.4) + 0.02 * std::sin(20.0 * x) + 0.03);  // u + d ≥ 0
    p.g.push_back(1.0 / inverse);
  }
  p.Q = compress(n, n, Q, "Q").value();
  p.C = compress(n, n, C, "C").value();
  return p;
}

}  // namespace marble::testing
