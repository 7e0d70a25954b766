// The problems of MacMPEC that change a convex QP's data so that its solution comes to a given point: z = (x,
// multipliers, changes) in one order or another, with the QP's KKT conditions.
#include <array>
#include <cmath>

#include "macmpec/problems.h"

namespace marble::examples::macmpec_sources {

// min 0.01 x₁² + x₂² s.t. 10 x₁ + x₂ ≥ 10 + w₁, x₁ ≥ 2 + w₂, x₂ ≥ 50 w₃, with (x₁ − 2)² + x₂² as the upper
// level. z = (x, w, multipliers); MacMPEC's bound 10¹⁰ of w₁ is omitted.
OwnedProblem sl1() {
  Model model("sl1", 8);
  model.add_square(2.0, {{0, 1.0}}, -2.0);
  model.add_square(2.0, {{1, 1.0}});
  model.equal_zero({{0, 0.02}, {5, -10.0}, {6, -1.0}});
  model.equal_zero({{1, 2.0}, {5, -1.0}, {7, -1.0}});
  model.at_least_zero({{2, 1.0}}, -10.0);
  between(model, 3, 0.01, 10.0);
  between(model, 4, 0.0, 1.0);
  model.complementary({{0, 10.0}, {1, 1.0}, {2, -1.0}}, -10.0, {{5, 1.0}}, 0.0);
  model.complementary({{0, 1.0}, {3, -1.0}}, -2.0, {{6, 1.0}}, 0.0);
  model.complementary({{1, 1.0}, {4, -50.0}}, 0.0, {{7, 1.0}}, 0.0);
  return model.problem();
}

// min ½ xᵀHx + (g + u w)ᵀx s.t. A x + b − v w ≥ 0, x ≥ 0. z = (x, λ, μ, w). In MacMPEC's model, row i of
// the gradient has the sum of A's column i times λ_i in place of Aᵀλ.
OwnedProblem hs044_i() {
  constexpr Index kX = 0, kLambda = 4, kMu = 10, kChange = 14;
  constexpr double kTarget[] = {0.0, 3.0, 0.0, 4.0};
  constexpr double kG[] = {1.0, -1.0, -1.0, 0.0};
  constexpr double kH[4][4] = {{0, 0, -1, 1}, {0, 0, 1, -1}, {-1, 1, 0, 0}, {1, -1, 0, 0}};
  constexpr double kA[6][4] = {{-1, -2, 0, 0}, {-4, -1, 0, 0}, {-3, -4, 0, 0},
                               {0, 0, -2, -1}, {0, 0, -1, -2}, {0, 0, -1, -1}};
  constexpr double kB[] = {8.0, 12.0, 12.0, 8.0, 8.0, 5.0};
  constexpr double kU[] = {0.2, 1.2, 2.0, 0.1};
  constexpr double kV[] = {1.2, 0.2, 0.1, 2.0, 10.0, -0.2};
  constexpr double kLow[] = {0.01, -10.0, 0.1, -1.0, -1.0, 0.001};
  constexpr double kHigh[] = {10.0, -0.01, 1.0, -0.1, 1.0, 10.0};
  Model model("hs044_i", 20);
  for (Index i = 0; i < 4; ++i) {
    model.add_square(2.0, {{kX + i, 1.0}}, -kTarget[i]);
    Terms gradient = {{kMu + i, -1.0}, {kChange + i, kU[i]}};
    double column = 0.0;
    for (const auto& row : kA) column += row[i];
    gradient.push_back({kLambda + i, -column});
    for (Index j = 0; j < 4; ++j) gradient.push_back({kX + j, kH[i][j]});
    model.equal_zero(gradient, kG[i]);
  }
  for (Index j = 0; j < 6; ++j) {
    between(model, kChange + j, kLow[j], kHigh[j]);
    Terms row = {{kChange + j, -kV[j]}};
    for (Index i = 0; i < 4; ++i) row.push_back({kX + i, kA[j][i]});
    model.complementary({{kLambda + j, 1.0}}, 0.0, row, kB[j]);
  }
  for (Index i = 0; i < 4; ++i) complementary(model, kX + i, kMu + i);
  return model.problem();
}

// min ½ |x − y|² s.t. x_j − 2x_{j+1} + x_{j+2} ≥ w_j, for y_i = √tᵢ + 0.1 sin i; the target is the solution
// for w = 0: the regression line of the first points, and y itself at the others. z = (w, x, multipliers).
OwnedProblem liswet1(const char* name, Index n, Index line) {
  const Index points = n + 2;
  const auto w = [](Index j) { return j; };
  const auto x = [n](Index i) { return n + i; };
  const auto multiplier = [n, points](Index j) { return n + points + j; };
  const auto y = [points](Index i) { return std::sqrt(i / (points - 1.0)) + 0.1 * std::sin(i + 1.0); };
  double mean = 0.0, slope = 0.0, squares = 0.0;
  const double middle = (line - 1) / 2.0;
  for (Index i = 0; i < line; ++i) {
    mean += y(i) / line;
    slope += (i - middle) * y(i);
    squares += (i - middle) * (i - middle);
  }
  slope /= squares;

  Model model(name, n + points + n);
  constexpr std::array<double, 3> kDifference = {1.0, -2.0, 1.0};
  for (Index i = 0; i < points; ++i) {
    model.add_square(2.0, {{x(i), 1.0}}, -(i < line ? mean + slope * (i - middle) : y(i)));
    Terms gradient = {{x(i), 1.0}};
    for (Index k = 0; k < 3; ++k) {
      if (const Index j = i - k; j >= 0 && j < n)
        gradient.push_back({multiplier(j), -kDifference[static_cast<std::size_t>(k)]});
    }
    model.equal_zero(gradient, -y(i));
  }
  Terms sum;
  for (Index j = 0; j < n; ++j) sum.push_back({w(j), 1.0});
  model.at_least_zero(sum, -0.2);
  for (Index j = 0; j < n; ++j) {
    nonnegative(model, w(j));
    model.complementary({{multiplier(j), 1.0}}, 0.0,
                        {{w(j), -1.0}, {x(j), 1.0}, {x(j + 1), -2.0}, {x(j + 2), 1.0}}, 0.0);
  }
  return model.problem();
}

}  // namespace marble::examples::macmpec_sources
