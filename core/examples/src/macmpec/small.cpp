// The problems of MacMPEC that are one formula.
#include "macmpec/problems.h"

namespace marble::examples::macmpec_sources {

void nonnegative(Model& model, Index i) { model.at_least_zero({{i, 1.0}}); }

void between(Model& model, Index i, double low, double high) {
  model.at_least_zero({{i, 1.0}}, -low);
  model.at_least_zero({{i, -1.0}}, high);
}

void complementary(Model& model, Index i, Index j) { model.complementary({{i, 1.0}}, 0.0, {{j, 1.0}}, 0.0); }

// z₁ + (z₂ − 1)²
OwnedProblem kth2() {
  Model model("kth2", 2);
  model.add_linear(1.0, 0);
  model.add_square(2.0, {{1, 1.0}}, -1.0);
  complementary(model, 1, 0);
  return model.problem();
}

// ½(z₁ − 1)² + (z₂ − 1)²
OwnedProblem kth3() {
  Model model("kth3", 2);
  model.add_square(1.0, {{0, 1.0}}, -1.0);
  model.add_square(2.0, {{1, 1.0}}, -1.0);
  complementary(model, 1, 0);
  return model.problem();
}

// ½(z₁ − 1)² + ½(z₂ − 1)², from close to the origin, where neither side of the pair is preferred.
OwnedProblem scholtes3() {
  Model model("scholtes3", 2);
  for (const Index i : {0, 1}) model.add_square(1.0, {{i, 1.0}}, -1.0);
  complementary(model, 0, 1);
  OwnedProblem problem = model.problem();
  problem.initial_z = {1e-4, 1e-4};
  return problem;
}

OwnedProblem jr(const char* name, double a, double b) {
  Model model(name, 2);
  model.add_square(2.0, {{0, 1.0}}, -a);
  model.add_square(2.0, {{1, 1.0}}, -b);
  model.complementary({{1, 1.0}}, 0.0, {{0, -1.0}, {1, 1.0}}, 0.0);
  return model.problem();
}

// 0 ≤ y_i − x_i ⊥ y_i ≥ 0 for the first half of the y; the others complement themselves and are zero.
OwnedProblem qpec(const char* name, double sign, Index x) {
  Model model(name, 3 * x);
  for (Index i = 0; i < 3 * x; ++i) model.add_square(2.0, {{i, 1.0}}, i < x ? sign : 2.0 * sign);
  for (Index i = 0; i < x; ++i) model.complementary({{i, -1.0}, {x + i, 1.0}}, 0.0, {{x + i, 1.0}}, 0.0);
  for (Index i = 2 * x; i < 3 * x; ++i) complementary(model, i, i);
  OwnedProblem problem = model.problem();
  problem.initial_z.assign(problem.g.size(), 1.0);
  return problem;
}

// ½(x₁ + x₂ + y₁ − 15)² + ½(x₁ + x₂ + y₂ − 15)², 0 ≤ x ≤ 10, 0 ≤ y ⊥ N x + M y − (36, 25) ≥ 0.
OwnedProblem flp2() {
  Model model("flp2", 4);
  for (const Index y : {2, 3}) model.add_square(1.0, {{0, 1.0}, {1, 1.0}, {y, 1.0}}, -15.0);
  for (const Index x : {0, 1}) between(model, x, 0.0, 10.0);
  model.complementary({{2, 1.0}}, 0.0, {{0, 8.0 / 3.0}, {1, 2.0}, {2, 2.0}, {3, 8.0 / 3.0}}, -36.0);
  model.complementary({{3, 1.0}}, 0.0, {{0, 2.0}, {1, 1.25}, {2, 1.25}, {3, 2.0}}, -25.0);
  return model.problem();
}

}  // namespace marble::examples::macmpec_sources
