// Problems on which the methods' formulas have closed forms.
#pragma once

#include "marble/problem.h"

namespace marble::testing {

/// min ½ q |(x, y) − (1, 2)|² over 0 ≤ x ⊥ y ≥ 0.
[[nodiscard]] inline OwnedProblem two_sides(double q) {
  OwnedProblem p;
  p.name = "two sides";
  p.g = {-q, -2.0 * q};
  p.c0 = 2.5 * q;
  p.Q = compress(2, 2, {{0, 1}, {0, 1}, {q, q}}, "Q").value();
  p.L = compress(1, 2, {{0}, {0}, {1.0}}, "L").value();
  p.R = compress(1, 2, {{0}, {1}, {1.0}}, "R").value();
  p.l = p.r = {0.0};
  return p;
}

/// min x over x ≥ 2.
[[nodiscard]] inline OwnedProblem above_two() {
  OwnedProblem p;
  p.g = {1.0};
  p.Q = compress(1, 1, {}, "Q").value();
  p.C = compress(1, 1, {{0}, {0}, {1.0}}, "C").value();
  p.d = {-2.0};
  return p;
}

/// min x² + y² over x + y = 1.
[[nodiscard]] inline OwnedProblem on_a_line() {
  OwnedProblem p;
  p.g = {0.0, 0.0};
  p.Q = compress(2, 2, {{0, 1}, {0, 1}, {2.0, 2.0}}, "Q").value();
  p.A = compress(1, 2, {{0, 0}, {0, 1}, {1.0, 1.0}}, "A").value();
  p.b = {-1.0};
  return p;
}

}  // namespace marble::testing
