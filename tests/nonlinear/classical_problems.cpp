// Smooth problems with known optima: W. Hock, K. Schittkowski, "Test Examples for Nonlinear Programming
// Codes" (hs), the lectures on nonlinear programming (murty) and P. Boggs, J. Tolle (bt6).
#include <cmath>

#include "formula.h"

namespace marble::testing {
namespace {

const double kRoot2 = std::sqrt(2.0);

// The two that differ in one term of a row.
Parts five_variables(const Jets& x, const Jet& second) {
  return {.objective =
              square(x[0] - 1) + square(x[0] - x[1]) + square(x[2] - 1) + pow(x[3] - 1, 4) + pow(x[4] - 1, 6),
          .equalities = {square(x[0]) * x[3] + sin(x[3] - x[4]) - 2 * kRoot2, second - 8 - kRoot2}};
}

Formula murty(const std::string& name, double a, double b) {
  return {.name = name, .optimum = 10.0, .start = {a, b}, .parts = [](const Jets& x) -> Parts {
            return {.objective = pow(x[0], 3) + square(x[1]),
                    .equalities = {10 - square(x[0]) - square(x[1])},
                    .inequalities = {x[0] - 1, x[1] - 1}};
          }};
}

}  // namespace

std::vector<Formula> classical_problems() {
  return {
      murty("murty", 2, 2),
      murty("murty_far", 3, 5),
      murty("murty_near", 1.5, 2.5),
      murty("murty_below", 1, 1),
      {.name = "bt6",
       .optimum = 0.277044924,
       .start = {2, 2, 2, 2, 2},
       .parts = [](const Jets& x) { return five_variables(x, x[1] + pow(x[2], 4) * square(x[1])); }},
      {.name = "hs77",
       .optimum = 0.24150513,
       .start = {2, 2, 2, 2, 2},
       .parts = [](const Jets& x) { return five_variables(x, x[1] + pow(x[2], 4) * square(x[3])); }},
      {.name = "hs6",
       .optimum = 0,
       .start = {-1.2, 1},
       .parts = [](const Jets& x) -> Parts {
         return {.objective = square(1 - x[0]), .equalities = {10 * (x[1] - square(x[0]))}};
       }},
      {.name = "hs7",
       .optimum = -1.7320508,
       .start = {2, 2},
       .parts = [](const Jets& x) -> Parts {
         return {.objective = log(1 + square(x[0])) - x[1],
                 .equalities = {square(1 + square(x[0])) + square(x[1]) - 4}};
       }},
      {.name = "hs28",
       .optimum = 0,
       .start = {-4, 1, 1},
       .parts = [](const Jets& x) -> Parts {
         return {.objective = square(x[0] + x[1]) + square(x[1] + x[2]),
                 .equalities = {x[0] + 2 * x[1] + 3 * x[2] - 1}};
       }},
      {.name = "hs35",
       .optimum = 1.0 / 9.0,
       .start = {0.5, 0.5, 0.5},
       .parts = [](const Jets& x) -> Parts {
         return {.objective = 9 - 8 * x[0] - 6 * x[1] - 4 * x[2] + 2 * square(x[0]) + 2 * square(x[1]) +
                              square(x[2]) + 2 * x[0] * x[1] + 2 * x[0] * x[2],
                 .inequalities = {3 - x[0] - x[1] - 2 * x[2]}};
       },
       .lower = {0, 0, 0}},
      {.name = "hs39",
       .optimum = -1,
       .start = {2, 2, 2, 2},
       .parts = [](const Jets& x) -> Parts {
         return {.objective = -x[0],
                 .equalities = {x[1] - pow(x[0], 3) - square(x[2]), square(x[0]) - x[1] - square(x[3])}};
       }},
      {.name = "hs40",
       .optimum = -0.25,
       .start = {0.8, 0.8, 0.8, 0.8},
       .parts = [](const Jets& x) -> Parts {
         return {.objective = -x[0] * x[1] * x[2] * x[3],
                 .equalities = {pow(x[0], 3) + square(x[1]) - 1, square(x[0]) * x[3] - x[2],
                                square(x[3]) - x[1]}};
       }},
      {.name = "hs43",
       .optimum = -44,
       .start = {0, 0, 0, 0},
       .parts = [](const Jets& x) -> Parts {
         const Jet a = square(x[0]), b = square(x[1]), c = square(x[2]), d = square(x[3]);
         return {.objective = a + b + 2 * c + d - 5 * x[0] - 5 * x[1] - 21 * x[2] + 7 * x[3],
                 .inequalities = {8 - a - b - c - d - x[0] + x[1] - x[2] + x[3],
                                  10 - a - 2 * b - c - 2 * d + x[0] + x[3],
                                  5 - 2 * a - b - c - 2 * x[0] + x[1] + x[3]}};
       }},
      {.name = "hs71",
       .optimum = 17.0140173,
       .start = {1, 5, 5, 1},
       .parts = [](const Jets& x) -> Parts {
         return {.objective = x[0] * x[3] * (x[0] + x[1] + x[2]) + x[2],
                 .equalities = {square(x[0]) + square(x[1]) + square(x[2]) + square(x[3]) - 40},
                 .inequalities = {x[0] * x[1] * x[2] * x[3] - 25}};
       },
       .lower = {1, 1, 1, 1},
       .upper = {5, 5, 5, 5}},
      {.name = "hs78",
       .optimum = -2.91970041,
       .start = {-2, 1.5, 2, -1, -1},
       .parts = [](const Jets& x) -> Parts {
         return {.objective = x[0] * x[1] * x[2] * x[3] * x[4],
                 .equalities = {square(x[0]) + square(x[1]) + square(x[2]) + square(x[3]) + square(x[4]) - 10,
                                x[1] * x[2] - 5 * x[3] * x[4], pow(x[0], 3) + pow(x[1], 3) + 1}};
       }},
      {.name = "hs79",
       .optimum = 0.0787768209,
       .start = {2, 2, 2, 2, 2},
       .parts = [](const Jets& x) -> Parts {
         return {.objective = square(x[0] - 1) + square(x[0] - x[1]) + square(x[1] - x[2]) +
                              pow(x[2] - x[3], 4) + pow(x[3] - x[4], 4),
                 .equalities = {x[0] + square(x[1]) + pow(x[2], 3) - 2 - 3 * kRoot2,
                                x[1] - square(x[2]) + x[3] + 2 - 2 * kRoot2, x[0] * x[4] - 2}};
       }},
      {.name = "hs100",
       .optimum = 680.6300573,
       .start = {1, 2, 0, 4, 0, 1, 1},
       .parts = [](const Jets& x) -> Parts {
         return {
             .objective = square(x[0] - 10) + 5 * square(x[1] - 12) + pow(x[2], 4) + 3 * square(x[3] - 11) +
                          10 * pow(x[4], 6) + 7 * square(x[5]) + pow(x[6], 4) - 4 * x[5] * x[6] - 10 * x[5] -
                          8 * x[6],
             .inequalities = {127 - 2 * square(x[0]) - 3 * pow(x[1], 4) - x[2] - 4 * square(x[3]) - 5 * x[4],
                              282 - 7 * x[0] - 3 * x[1] - 10 * square(x[2]) - x[3] + x[4],
                              196 - 23 * x[0] - square(x[1]) - 6 * square(x[5]) + 8 * x[6],
                              -4 * square(x[0]) - square(x[1]) + 3 * x[0] * x[1] - 2 * square(x[2]) -
                                  5 * x[5] + 11 * x[6]}};
       }},
  };
}

}  // namespace marble::testing
