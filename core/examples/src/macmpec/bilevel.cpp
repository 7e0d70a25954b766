// The problems of MacMPEC with a lower level, by its KKT conditions: l are its multipliers, s its slacks.
#include "macmpec/problems.h"

namespace marble::examples::macmpec_sources {
namespace {

// (x − 5)² + (2y + 1)², x, y ≥ 0, where y minimizes (y − 1)² − 1.5xy in a quadrangle of these sides, y ≥ 0
// the last.
struct Bard1 {
  explicit Bard1(const char* name, Index variables) : model(name, variables) {
    model.add_square(2.0, {{0, 1.0}}, -5.0);
    model.add_square(2.0, {{1, 2.0}}, 1.0);
  }
  struct Side {
    double x, y, constant;
  };
  static constexpr Side kSides[] = {{3.0, -1.0, -3.0}, {-1.0, 0.5, 4.0}, {-1.0, -1.0, 7.0}, {0.0, 1.0, 0.0}};
  static Terms terms(const Side& side) { return {{0, side.x}, {1, side.y}}; }

  // The gradient of the lower level, with the first `count` multipliers from `first` on.
  void stationary(Index first, Index count) {
    Terms gradient = {{0, -1.5}, {1, 2.0}};
    for (Index i = 0; i < count; ++i) gradient.push_back({first + i, -kSides[i].y});
    model.equal_zero(gradient, -2.0);
    for (const Index i : {0, 1}) nonnegative(model, i);
  }
  Model model;
};

// x² + (y − 10)², the objective of gauvin and ex9_2_2.
void add_distance_to_ten(Model& model) {
  model.add_square(2.0, {{0, 1.0}});
  model.add_square(2.0, {{1, 1.0}}, -10.0);
}

// The rows s_i = an inequality's left side, for slacks from `first` on.
struct Inequality {
  Terms terms;
  double constant;
};
void add_slacks(Model& model, Index first, const std::vector<Inequality>& inequalities) {
  for (Index slack = first; const Inequality& inequality : inequalities) {
    Terms row = {{slack++, 1.0}};
    for (const auto& [variable, factor] : inequality.terms) row.push_back({variable, -factor});
    model.equal_zero(row, -inequality.constant);
  }
}

}  // namespace

OwnedProblem bard1() {
  Bard1 bard("bard1", 5);
  bard.stationary(2, 3);
  for (Index i = 0; i < 3; ++i)
    bard.model.complementary(Bard1::terms(Bard1::kSides[i]), Bard1::kSides[i].constant, {{2 + i, 1.0}}, 0.0);
  return bard.model.problem();
}

// The gradient is a variable of its own, which complements nothing.
OwnedProblem bard1m() {
  Bard1 bard("bard1m", 6);
  bard.stationary(2, 4);
  nonnegative(bard.model, 5);
  for (Index i = 0; i < 3; ++i)
    bard.model.complementary(Bard1::terms(Bard1::kSides[i]), Bard1::kSides[i].constant, {{2 + i, 1.0}}, 0.0);
  return bard.model.problem();
}

OwnedProblem bard1_with_slacks(const char* name) {
  Bard1 bard(name, 10);
  std::vector<Inequality> sides;
  for (const Bard1::Side& side : Bard1::kSides) sides.push_back({Bard1::terms(side), side.constant});
  add_slacks(bard.model, 2, sides);
  bard.stationary(6, 4);
  for (Index i = 0; i < 4; ++i) complementary(bard.model, 2 + i, 6 + i);
  return bard.model.problem();
}

// 0 ≤ x ≤ 15, where y minimizes (x + 2y − 30)² over 0 ≤ y ≤ 20 − x.
OwnedProblem gauvin() {
  Model model("gauvin", 3);
  add_distance_to_ten(model);
  between(model, 0, 0.0, 15.0);
  model.complementary({{0, 4.0}, {1, 8.0}, {2, 1.0}}, -120.0, {{1, 1.0}}, 0.0);
  model.complementary({{0, -1.0}, {1, -1.0}}, 20.0, {{2, 1.0}}, 0.0);
  return model.problem();
}

// y ≤ x as well, and the lower level's derivative is (2, 4) instead of (4, 8). z = (x, y, s, l).
OwnedProblem ex9_2_2() {
  Model model("ex9_2_2", 8);
  add_distance_to_ten(model);
  add_slacks(model, 2, {{{{0, -1.0}, {1, -1.0}}, 20.0}, {{{1, 1.0}}, 0.0}, {{{1, -1.0}}, 20.0}});
  model.equal_zero({{0, 2.0}, {1, 4.0}, {5, 1.0}, {6, -1.0}, {7, 1.0}}, -60.0);
  model.at_least_zero({{0, 1.0}, {1, -1.0}});
  between(model, 0, 0.0, 15.0);
  nonnegative(model, 1);
  for (Index i = 0; i < 3; ++i) complementary(model, 5 + i, 2 + i);
  return model.problem();
}

// ½(y₁ − 2)² + ½(y₂ − 2)², x ≥ 0, where y ≥ 0 minimizes ½y₁² + y₂ with y₁ + y₂ = x. z = (x, y, s, l, μ).
OwnedProblem ex9_2_4() {
  Model model("ex9_2_4", 8);
  for (const Index y : {1, 2}) model.add_square(1.0, {{y, 1.0}}, -2.0);
  model.equal_zero({{0, -1.0}, {1, 1.0}, {2, 1.0}});
  add_slacks(model, 3, {{{{1, 1.0}}, 0.0}, {{{2, 1.0}}, 0.0}});
  model.equal_zero({{1, 1.0}, {5, -1.0}, {7, 1.0}});
  model.equal_zero({{6, -1.0}, {7, 1.0}}, 1.0);
  for (const Index i : {0, 1, 2}) nonnegative(model, i);
  for (const Index i : {3, 4}) complementary(model, i, 2 + i);
  return model.problem();
}

// (x − 3)² + (y − 2)², 0 ≤ x ≤ 8, where y minimizes (y − 5)² in a triangle. z = (x, y, s, l).
OwnedProblem ex9_2_5() {
  Model model("ex9_2_5", 8);
  model.add_square(2.0, {{0, 1.0}}, -3.0);
  model.add_square(2.0, {{1, 1.0}}, -2.0);
  add_slacks(model, 2,
             {{{{0, 2.0}, {1, -1.0}}, 1.0}, {{{0, -1.0}, {1, 2.0}}, 2.0}, {{{0, -1.0}, {1, -2.0}}, 14.0}});
  model.equal_zero({{1, 2.0}, {5, 1.0}, {6, -2.0}, {7, 2.0}}, -10.0);
  between(model, 0, 0.0, 8.0);
  for (Index i = 0; i < 3; ++i) complementary(model, 5 + i, 2 + i);
  return model.problem();
}

// |x|² − 2(x₁ + x₂) + |y|², x, y ≥ 0, where y minimizes |y − x|² over ½ ≤ y ≤ 1½. The collection's last two
// slacks and multipliers are in no other row. z = (x, y, s, l).
OwnedProblem ex9_2_6() {
  Model model("ex9_2_6", 16);
  for (Index i = 0; i < 4; ++i) model.add_square(2.0, {{i, 1.0}});
  for (const Index x : {0, 1}) model.add_linear(-2.0, x);
  add_slacks(model, 4, {{{{2, 1.0}}, -0.5}, {{{3, 1.0}}, -0.5}, {{{2, -1.0}}, 1.5}, {{{3, -1.0}}, 1.5}});
  for (const Index i : {0, 1}) model.equal_zero({{i, -2.0}, {2 + i, 2.0}, {10 + i, -1.0}, {12 + i, 1.0}});
  for (Index i = 0; i < 4; ++i) nonnegative(model, i);
  for (Index i = 4; i < 10; ++i) complementary(model, i, 6 + i);
  return model.problem();
}

namespace {

// A firm gives x, Σx ≤ 40, to two divisions; each makes y as near to its targets as x allows. The firm earns
// (200 − y₁ − y₃)(y₁ + y₃) + (160 − y₂ − y₄)(y₂ + y₄). z = (y, x, multipliers); variants differ in which
// bounds of y are the divisions' constraints, with multipliers.
enum class DivisionBounds { none, lower, both };

OwnedProblem firm(const char* name, DivisionBounds bounds) {
  const Index own = bounds == DivisionBounds::none ? 0 : bounds == DivisionBounds::lower ? 1 : 2;
  const Index of_division = 2 * (1 + own);  // multipliers: of two shares of x, then of each y's bounds
  Model model(name, 8 + 2 * of_division);
  for (const Index i : {0, 1}) {
    model.add_square(2.0, {{i, 1.0}, {2 + i, 1.0}});
    for (const Index y : {i, 2 + i}) model.add_linear(i == 0 ? -200.0 : -160.0, y);
  }
  constexpr double kTargets[] = {4.0, 13.0, 35.0, 2.0};
  constexpr double kMostY[] = {20.0, 20.0, 40.0, 40.0};
  constexpr double kMostX[] = {10.0, 5.0, 15.0, 20.0};
  constexpr double kShare[2][2] = {{0.4, 0.6}, {0.7, 0.3}};  // of y_i in x₁ and x₂, or in x₃ and x₄
  const auto multiplier = [&](Index i, Index k) { return 8 + i / 2 * of_division + k; };
  const auto of_bound = [&](Index i) { return multiplier(i, 2 + i % 2 * own); };

  // bard2 has the gradients of squares, the others of halves of them.
  const double weight = bounds == DivisionBounds::none ? 2.0 : 1.0;
  for (Index i = 0; i < 4; ++i) {
    const auto& share = kShare[i % 2];
    Terms gradient = {{i, weight}, {multiplier(i, 0), share[0]}, {multiplier(i, 1), share[1]}};
    if (own > 0) gradient.push_back({of_bound(i), -1.0});
    if (own > 1) gradient.push_back({of_bound(i) + 1, 1.0});
    model.equal_zero(gradient, -weight * kTargets[i]);
  }
  model.at_least_zero({{4, -1.0}, {5, -1.0}, {6, -1.0}, {7, -1.0}}, 40.0);
  for (Index i = 0; i < 4; ++i) {
    if (own == 0) nonnegative(model, i);
    if (own < 2) model.at_least_zero({{i, -1.0}}, kMostY[i]);
  }
  for (Index i = 0; i < 4; ++i) between(model, 4 + i, 0.0, kMostX[i]);
  for (const Index first : {0, 2}) {
    for (const Index k : {0, 1})
      model.complementary({{first, -kShare[0][k]}, {first + 1, -kShare[1][k]}, {4 + first + k, 1.0}}, 0.0,
                          {{multiplier(first, k), 1.0}}, 0.0);
    for (const Index i : {first, first + 1}) {
      if (own > 0) complementary(model, i, of_bound(i));
      if (own > 1) model.complementary({{i, -1.0}}, kMostY[i], {{of_bound(i) + 1, 1.0}}, 0.0);
    }
  }
  return model.problem();
}

}  // namespace

OwnedProblem bard2() { return firm("bard2", DivisionBounds::none); }
OwnedProblem bilevel2() { return firm("bilevel2", DivisionBounds::both); }
OwnedProblem bilevel2m() { return firm("bilevel2m", DivisionBounds::lower); }

// Half the squared distance of 0 ≤ x ≤ 10 to an equilibrium y of two players. z = (x, y, multipliers).
OwnedProblem nash1(const char* name, double x1, double x2) {
  Model model(name, 6);
  for (const Index i : {0, 1}) model.add_square(1.0, {{i, 1.0}, {2 + i, -1.0}});
  model.equal_zero({{2, 2.0}, {3, 8.0 / 3.0}, {4, 1.0}}, -34.0);
  model.equal_zero({{2, 1.25}, {3, 2.0}, {5, 1.0}}, -24.25);
  for (const Index x : {0, 1}) between(model, x, 0.0, 10.0);
  model.complementary({{1, -1.0}, {2, -1.0}}, 15.0, {{4, 1.0}}, 0.0);
  model.complementary({{0, -1.0}, {3, -1.0}}, 15.0, {{5, 1.0}}, 0.0);
  OwnedProblem problem = model.problem();
  problem.initial_z = {x1, x2, 0.0, 0.0, 0.0, 0.0};
  return problem;
}

}  // namespace marble::examples::macmpec_sources
