// The problems of MacMPEC by where they come from. The sources are in table.cpp.
#pragma once

#include <string_view>

#include "model.h"

namespace marble::examples::macmpec_sources {

/// Adds z_i ≥ 0.
void nonnegative(Model& model, Index i);
/// Adds low ≤ z_i ≤ high.
void between(Model& model, Index i, double low, double high);
/// Adds 0 ≤ z_i ⊥ z_j ≥ 0.
void complementary(Model& model, Index i, Index j);

/// min f(z) of two variables, 0 ≤ z₁ ⊥ z₂ ≥ 0.
[[nodiscard]] OwnedProblem kth2();
[[nodiscard]] OwnedProblem kth3();
[[nodiscard]] OwnedProblem scholtes3();
/// min (z₁ − a)² + (z₂ − b)², 0 ≤ z₂ ⊥ z₂ − z₁ ≥ 0.
[[nodiscard]] OwnedProblem jr(const char* name, double a, double b);
/// Variables x and twice as many y, min |x + sign e|² + |y + 2 sign e|²; MacMPEC's have ten x.
[[nodiscard]] OwnedProblem qpec(const char* name, double sign, Index x);

[[nodiscard]] OwnedProblem gauvin();
/// One problem of two levels as bard1, bard1m and ex9_2_1 encode it; ex9_2_7 is the last once more.
[[nodiscard]] OwnedProblem bard1();
[[nodiscard]] OwnedProblem bard1m();
[[nodiscard]] OwnedProblem bard1_with_slacks(const char* name);
[[nodiscard]] OwnedProblem ex9_2_2();
[[nodiscard]] OwnedProblem ex9_2_4();
[[nodiscard]] OwnedProblem ex9_2_5();
[[nodiscard]] OwnedProblem ex9_2_6();
[[nodiscard]] OwnedProblem bard2();
[[nodiscard]] OwnedProblem bilevel2();
[[nodiscard]] OwnedProblem bilevel2m();
/// Starts at x, y = 0.
[[nodiscard]] OwnedProblem nash1(const char* name, double x1, double x2);

/// Convex QPs whose data are to be changed so that their solution comes to a given point.
[[nodiscard]] OwnedProblem sl1();
[[nodiscard]] OwnedProblem hs044_i();
/// Convex regression of n + 2 points; the first `line` of them have the same slope in its solution.
[[nodiscard]] OwnedProblem liswet1(const char* name, Index n, Index line);
/// `number` is 1, 2, 3, 4 or 6.
[[nodiscard]] OwnedProblem portfl(const char* name, int number);

[[nodiscard]] OwnedProblem flp2();
/// `number` is 1, 2, 3 or 4.
[[nodiscard]] OwnedProblem flp4(const char* name, int number);

}  // namespace marble::examples::macmpec_sources
