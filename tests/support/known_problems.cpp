#include <cmath>
#include <initializer_list>

#include "macmpec/problems.h"
#include "support/problem_builder.h"
#include "support/small_problems.h"

namespace marble::testing {
namespace {

using Builder = ProblemBuilder;

struct Term {
  Index variable;
  double factor;
};

ProblemBuilder::Row row(std::size_t variables, std::initializer_list<Term> terms, double constant = 0.0) {
  ProblemBuilder::Row all(variables + 1, 0.0);
  for (const Term& term : terms) all[static_cast<std::size_t>(term.variable)] = term.factor;
  all.back() = constant;
  return all;
}

// 2x₁ + 2x₂ − 3y₁ − 3y₂ − 60, x₁ + x₂ + y₁ − 2y₂ ≤ 40, 0 ≤ x ≤ 50, y minimising (y − x + 20)² s.t. −10 ≤ y ≤
// 20, x − 2y ≥ 10. Aiyoshi and Shimizu, 1984; another local optimum has 5.
SmallProblem aiyoshi_shimizu() {
  constexpr std::size_t n = 10;  // x, y, three multipliers each
  Builder b("aiyoshi and shimizu", {2, 2, -3, -3, 0, 0, 0, 0, 0, 0});
  b.constant(-60).at_least(row(n, {{0, -1}, {1, -1}, {2, -1}, {3, 2}}, 40));
  for (const Index k : {0, 1}) {
    b.at_least(row(n, {{k, 1}})).at_least(row(n, {{k, -1}}, 50));
    const Index first = 4 + 3 * k;
    b.equal(row(n, {{2 + k, 2}, {k, -2}, {first, -1}, {first + 1, 1}, {first + 2, 2}}, 40));
    b.pair(row(n, {{2 + k, 1}}, 10), row(n, {{first, 1}}));
    b.pair(row(n, {{2 + k, -1}}, 20), row(n, {{first + 1, 1}}));
    b.pair(row(n, {{k, 1}, {2 + k, -2}}, -10), row(n, {{first + 2, 1}}));
  }
  return b.optimum(0.0);
}

// x − 4y over x ≥ 0 and y minimising y in a quadrangle (Bard, 1998): at the far corner (4, 4).
SmallProblem linear_bilevel() {
  Builder b("linear bilevel", {1, -4, 0, 0, 0, 0, 0});
  b.equal({0, 0, -1, 1, 1, -2, -1, 1}).at_least(row(7, {{0, 1}}));
  b.pair(row(7, {{0, 1}, {1, 1}}, -3), row(7, {{2, 1}})).pair(row(7, {{0, 2}, {1, -1}}), row(7, {{3, 1}}));
  b.pair(row(7, {{0, -2}, {1, -1}}, 12), row(7, {{4, 1}}));
  b.pair(row(7, {{0, -3}, {1, 2}}, 4), row(7, {{5, 1}})).pair(row(7, {{1, 1}}), row(7, {{6, 1}}));
  return b.optimum(-12.0);
}

// ½Σ(zᵢ − 1)² over the unique solution (0, 0, 0, 0, 1) of an LCP whose matrix has 1 on and 2 above the
// diagonal (Murty, 1978: Lemke's method visits exponentially many bases).
SmallProblem murty() {
  constexpr std::size_t n = 5;
  Builder b("murty", ProblemBuilder::Row(n, -1.0));
  for (Index i = 0; i < 5; ++i) {
    ProblemBuilder::Row w = row(n, {{i, 1}}, -1);
    for (Index j = i + 1; j < 5; ++j) w[static_cast<std::size_t>(j)] = 2;
    b.quadratic(i, i, 1).pair(row(n, {{i, 1}}), w);
  }
  return b.constant(2.5).optimum(2.0);
}

// Σ(xᵢ − aᵢ)² with at most two nonzero entries of x ≥ 0: three of y ≤ 1 must be 1 (Burdakov, Kanzow and
// Schwartz, 2016). The optimum is the sum of squares of the three smallest a.
SmallProblem cardinality() {
  constexpr std::size_t n = 10;
  Builder b("cardinality", {-10, -8, -6, -4, -2, 0, 0, 0, 0, 0});
  for (Index i = 0; i < 5; ++i) {
    b.quadratic(i, i, 2).at_least(row(n, {{5 + i, -1}}, 1));
    b.pair(row(n, {{i, 1}}), row(n, {{5 + i, 1}}));
  }
  return b.at_least({0, 0, 0, 0, 0, 1, 1, 1, 1, 1, -3}).constant(55).optimum(14.0);
}

// Values 6, 5, 4, weights 5, 4, 3, capacity 7: 0 ≤ b ⊥ 1 − b ≥ 0 makes b binary.
SmallProblem knapsack() {
  Builder b("knapsack", {-6, -5, -4});
  for (Index i = 0; i < 3; ++i) b.pair(row(3, {{i, 1}}), row(3, {{i, -1}}, 1));
  return b.at_least({-5, -4, -3, 7}).optimum(-9.0);
}

// A string over an obstacle at 0, pushed by f: 0 ≤ u ⊥ −u″ − f ≥ 0; ½‖u − wanted‖² + ½‖f‖²/10.
SmallProblem string_over_an_obstacle() {
  constexpr Index kNodes = 6;
  constexpr std::size_t n = 2 * kNodes;
  const double wanted[] = {0.5, 1, 0.5, -0.5, -1, 0.5};
  ProblemBuilder::Row gradient(n, 0.0);
  for (std::size_t i = 0; i < kNodes; ++i) gradient[i] = -wanted[i];
  Builder b("string over an obstacle", gradient);
  double constant = 0.0;
  for (Index i = 0; i < kNodes; ++i) {
    b.quadratic(i, i, 1).quadratic(kNodes + i, kNodes + i, 0.1);
    constant += 0.5 * wanted[i] * wanted[i];
    ProblemBuilder::Row force = row(n, {{i, 2}, {kNodes + i, -1}});
    if (i > 0) force[static_cast<std::size_t>(i - 1)] = -1;
    if (i + 1 < kNodes) force[static_cast<std::size_t>(i + 1)] = -1;
    b.pair(row(n, {{i, 1}}), force);
  }
  return b.constant(constant).optimum(481.0 / 672.0);
}

// Maximizes x₁ + 2x₂ + y₁ + 2y₂ over the equilibria of the game A = (3 1; 1 2), B = (2 1; 1 3), scaled as by
// Lemke and Howson: 0 ≤ x ⊥ 1 − Ay ≥ 0, 0 ≤ y ⊥ 1 − Bᵀx ≥ 0. The mixed one, (0.4, 0.2; 0.2, 0.4).
SmallProblem game() {
  return Builder("game", {-1, -2, -1, -2})
      .pair({1, 0, 0, 0, 0}, {0, 0, -3, -1, 1})
      .pair({0, 1, 0, 0, 0}, {0, 0, -1, -2, 1})
      .pair({0, 0, 1, 0, 0}, {-2, -1, 0, 0, 1})
      .pair({0, 0, 0, 1, 0}, {-1, -3, 0, 0, 1})
      .optimum(-1.8);
}

// Adds single elements of mechanics and circuits; minima computed by hand, branch by branch.
void add_elements(std::vector<SmallProblem>& all) {
  // Coulomb: a force F moves a block, v = F − f, against friction f: 0 ≤ v ⊥ 2 − f ≥ 0. F² + (v − 6)².
  all.push_back(Builder("friction", {0, -12, 0})
                    .quadratic(0, 0, 2)
                    .quadratic(1, 1, 2)
                    .constant(36)
                    .equal({1, -1, -1, 0})
                    .pair({0, 1, 0, 0}, {0, 0, -1, 2})
                    .optimum(32.0));
  // Signorini: u pushes x₁ = u − f against x₂ = 1 + f. (x₁ − 3)² + (x₂ − 1)² + u²/10.
  all.push_back(Builder("contact", {0, 0, -6, -2})
                    .quadratic(0, 0, 0.2)
                    .quadratic(2, 2, 2)
                    .quadratic(3, 3, 2)
                    .constant(10)
                    .equal({-1, 1, 1, 0, 0})
                    .equal({0, -1, 0, 1, -1})
                    .pair({0, 0, -1, 1, 0}, {0, 1, 0, 0, 0})
                    .optimum(2.75));
  // An ideal diode behind 2 Ω: u = 2i − w, 0 ≤ i ⊥ w ≥ 0. ½(i − 1)² + ½u².
  all.push_back(Builder("diode", {0, -1, 0})
                    .quadratic(0, 0, 1)
                    .quadratic(1, 1, 1)
                    .constant(0.5)
                    .equal({-1, 2, -1, 0})
                    .pair({0, 1, 0, 0}, {0, 0, 1, 0})
                    .optimum(0.4));
  // Filippov: s = sgn(p − m), 0 ≤ p ⊥ 1 − s ≥ 0, 0 ≤ m ⊥ 1 + s ≥ 0. (p − m + 0.4)² + (s − 1)²; p = 0 and s =
  // 1 are biactive.
  all.push_back(Builder("relay", {0.8, -0.8, -2})
                    .quadratic(0, 0, 2)
                    .quadratic(0, 1, -2)
                    .quadratic(1, 1, 2)
                    .quadratic(2, 2, 2)
                    .constant(1.16)
                    .pair({1, 0, 0, 0}, {0, 0, -1, 1})
                    .pair({0, 1, 0, 0}, {0, 0, 1, 1})
                    .optimum(0.16));
  // ½(x − 1)² − 2|x|, x = p − m.
  all.push_back(Builder("absolute value", {-3, -1})
                    .quadratic(0, 0, 1)
                    .quadratic(0, 1, -1)
                    .quadratic(1, 1, 1)
                    .constant(0.5)
                    .pair({1, 0, 0}, {0, 1, 0})
                    .optimum(-4.0));
  // (x − 2.2)² over x in [0, 1] or [3, 4].
  all.push_back(Builder("gap", {-4.4, 0})
                    .quadratic(0, 0, 2)
                    .constant(4.84)
                    .at_least({1, -3, 0})
                    .at_least({-1, 3, 1})
                    .pair({0, 1, 0}, {0, -1, 1})
                    .optimum(0.64));
}

}  // namespace

std::vector<SmallProblem> known_problems() {
  std::vector<SmallProblem> all;
  for (const char* name :
       {"bard1m", "ex9_2_1", "ex9_2_4", "bard2", "bilevel2m", "bilevel2", "nash1a", "hs044_i"})
    all.push_back(of_macmpec(name));
  // qpec1 and qpec2 of MacMPEC with half of their variables.
  all.push_back({examples::macmpec_sources::qpec("half of qpec1", 1.0, 5), 40.0});
  all.push_back({examples::macmpec_sources::qpec("half of qpec2", -1.0, 5), 22.5});
  for (const SmallProblem& problem : {aiyoshi_shimizu(), linear_bilevel(), murty(), cardinality(), knapsack(),
                                      string_over_an_obstacle(), game()})
    all.push_back(problem);
  // ½x² + ½xy − 95x, 0 ≤ y ⊥ 2y + ½x − 100 ≥ 0, 0 ≤ x ≤ 200 (MacMPEC): −70²/1.5.
  all.push_back(Builder("stackelberg1", {-95, 0})
                    .quadratic(0, 0, 1)
                    .quadratic(0, 1, 0.5)
                    .at_least({1, 0, 0})
                    .at_least({-1, 0, 200})
                    .pair({0, 1, 0}, {0.5, 2, -100})
                    .optimum(-4900.0 / 1.5));
  // Von Stackelberg's duopoly: the leader's profit (12 − q₁ − q₂)q₁, the follower's best response 0 ≤ q₂ ⊥ q₁
  // + 2q₂ − 12 ≥ 0. q = (6, 3).
  all.push_back(Builder("duopoly", {-12, 0})
                    .quadratic(0, 0, 2)
                    .quadratic(0, 1, 1)
                    .at_least({1, 0, 0})
                    .pair({0, 1, 0}, {1, 2, -12})
                    .optimum(-18.0));
  // 2x − y, x ≥ 0, 0 ≤ y ⊥ y − x ≥ 0 (MacMPEC): M-stationary, not strongly stationary, at 0.
  all.push_back(Builder("ralph1", {2, -1}).at_least({1, 0, 0}).pair({0, 1, 0}, {-1, 1, 0}).optimum(0.0));
  // x² + y² − 4xy, 0 ≤ x ⊥ y ≥ 0 (MacMPEC): Q is indefinite, but convex on each branch.
  all.push_back(Builder("ralph2", {0, 0})
                    .quadratic(0, 0, 2)
                    .quadratic(0, 1, -4)
                    .quadratic(1, 1, 2)
                    .pair({1, 0, 0}, {0, 1, 0})
                    .optimum(0.0));
  // (ax − 1)² + (by − 1)², 0 ≤ cx ⊥ y ≥ 0 (MacMPEC).
  const auto scale = [&all](const char* name, double a, double b, double factor, double side) {
    all.push_back(Builder(name, {-2 * factor * a, -2 * factor * b})
                      .quadratic(0, 0, 2 * factor * a * a)
                      .quadratic(1, 1, 2 * factor * b * b)
                      .constant(2 * factor)
                      .pair({side, 0, 0}, {0, 1, 0})
                      .optimum(factor));
  };
  scale("scale1", 100, 1, 1, 1);
  scale("scale3", 1, 1, 1, 100);
  scale("scale5", 1, 1, 100, 1);
  add_elements(all);
  return all;
}

}  // namespace marble::testing
