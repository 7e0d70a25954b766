// Mathematical programs with equilibrium constraints as published, with their best known objectives: S.
// Leyffer's MacMPEC (kth, jr, ralph, scholtes, df1, bard, bilevel, gauvin, stackelberg, nash, desilva, gnash,
// hakonsen, design-cent, ex9.2.8), J. Outrata (outrata), F. Murphy, H. Sherali, A. Soyster (oligopoly), P.
// Clark, A. Westerberg (clark), Z. Gumus, C. Floudas (gumus), J. Bard (bard91).
#include <algorithm>
#include <cmath>

#include "formula.h"

namespace marble::testing {
namespace {

Parts outrata_rows(const Jets& v, const Jet& objective) {
  const Jet &x = v[0], &a = v[1], &b = v[2], &c = v[3], &d = v[4];
  return {.objective = objective,
          .G = {a, b, c, d},
          .H = {(1 + 0.2 * x) * a - (3 + 1.333 * x) - 0.333 * c + 2 * a * d,
                (1 + 0.1 * x) * b - x + c + 2 * b * d, 0.333 * a - b + 1 - 0.1 * x,
                9 + 0.1 * x - square(a) - square(b)}};
}

// Of the four objectives the first two terms, and what comes to them.
Formula outrata(const std::string& name, double optimum, const std::function<Jet(const Jets&)>& more) {
  return {.name = name,
          .optimum = optimum,
          .start = {0, 3, 4, 0, 0},
          .parts =
              [more](const Jets& v) {
                return outrata_rows(v, 0.5 * (square(v[1] - 3) + square(v[2] - 4)) + more(v));
              },
          .lower = {0, 0, 0, 0, 0},
          .upper = {10, kFree, kFree, kFree, kFree}};
}

// A leader and four followers on a market with price (5000 / Q)^(1/γ); what each makes is bounded by 150.
Formula oligopoly(const std::string& name, double gamma, double optimum) {
  const auto parts = [gamma](const Jets& q) -> Parts {
    constexpr double kCost[] = {10, 8, 6, 4, 2}, kBeta[] = {1.2, 1.1, 1.0, 0.9, 0.8}, kLimit = 150.0;
    Jet total;
    for (int i = 0; i < 5; ++i) total += q[i];
    const Jet price = std::pow(5000.0, 1.0 / gamma) * pow(total, -1.0 / gamma);
    const auto cost_scale = [&](int i) { return std::pow(5.0, -1.0 / kBeta[i]); };
    Parts made;
    made.objective = kCost[0] * q[0] +
                     kBeta[0] / (kBeta[0] + 1) * cost_scale(0) * pow(q[0], (kBeta[0] + 1) / kBeta[0]) -
                     q[0] * price;
    for (int i = 1; i < 5; ++i) {
      const Jet marginal =
          kCost[i] + cost_scale(i) * pow(q[i], 1.0 / kBeta[i]) - price + q[i] * price / (gamma * total);
      made.G.push_back(q[i] - 1e-3), made.H.push_back(marginal + q[4 + i]);
      made.G.push_back(q[4 + i]), made.H.push_back(kLimit - q[i]);
    }
    return made;
  };
  return {.name = name,
          .optimum = optimum,
          .start = {50, 40, 40, 40, 40, 0, 0, 0, 0},
          .parts = parts,
          .lower = {1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 0, 0, 0, 0},
          .upper = {150, 150, 150, 150, 150, kFree, kFree, kFree, kFree}};
}

// MacMPEC's version of that market: every firm makes between 0 and the limit, each bound with a multiplier of
// its own, and the followers' marginal costs are linear.
Formula gnash(const std::string& name, double gamma, double limit, double optimum) {
  const auto parts = [gamma, limit](const Jets& v) -> Parts {
    constexpr double kCost[] = {10, 8, 6, 4, 2}, kBeta[] = {1.2, 1.1, 1.0, 0.9, 0.8};
    Jet total;
    for (int i = 0; i < 5; ++i) total += v[i];
    const Jet price = std::pow(5000.0, 1.0 / gamma) * pow(total, -1.0 / gamma);
    const auto cost_scale = [&](int i) { return std::pow(5.0, -1.0 / kBeta[i]); };
    Parts made;
    made.objective = kCost[0] * v[0] +
                     kBeta[0] / (kBeta[0] + 1) * cost_scale(0) * pow(v[0], (kBeta[0] + 1) / kBeta[0]) -
                     v[0] * price;
    for (int i = 1; i < 5; ++i) {
      const Jet &at_zero = v[3 + 2 * i], &at_limit = v[4 + 2 * i];
      made.equalities.push_back(kCost[i] + cost_scale(i) * v[i] - price + v[i] * price / (gamma * total) -
                                at_zero + at_limit);
      made.G.push_back(v[i]), made.H.push_back(at_zero);
      made.G.push_back(limit - v[i]), made.H.push_back(at_limit);
    }
    return made;
  };
  Formula made{.name = name, .optimum = optimum, .start = std::vector<double>(13, 0.0), .parts = parts};
  made.start[0] = std::min(75.0, limit);
  made.lower.assign(13, 0.0), made.upper.assign(13, kFree);
  made.upper[0] = limit;
  return made;
}

std::vector<Formula> two_variables() {
  const auto made = [](const char* name, double optimum, std::vector<double> start, auto objective, auto G,
                       auto H) {
    return Formula{
        .name = name, .optimum = optimum, .start = std::move(start), .parts = [=](const Jets& z) -> Parts {
          return {.objective = objective(z), .G = {G(z)}, .H = {H(z)}};
        }};
  };
  const auto first = [](const Jets& z) { return z[0]; };
  const auto second = [](const Jets& z) { return z[1]; };
  const auto gap = [](const Jets& z) { return z[1] - z[0]; };
  return {
      made(
          "kth1", 0, {1, 1}, [](const Jets& z) { return z[0] + z[1]; }, first, second),
      made(
          "kth2", 0, {1, 1}, [](const Jets& z) { return z[0] + square(z[1] - 1); }, first, second),
      made(
          "kth3", 0.5, {1, 1}, [](const Jets& z) { return 0.5 * square(z[0] - 1) + square(z[1] - 1); }, first,
          second),
      made(
          "scholtes3", 0.5, {0.5, 0.5},
          [](const Jets& z) { return 0.5 * (square(z[0] - 1) + square(z[1] - 1)); }, first, second),
      made(
          "jr1", 0.5, {1, 1}, [](const Jets& z) { return square(z[0] - 1) + square(z[1]); }, second, gap),
      made(
          "jr2", 0.5, {1, 1}, [](const Jets& z) { return square(z[1] - 1) + square(z[0]); }, second, gap),
      made(
          "ralph2", 0, {1, 1}, [](const Jets& z) { return square(z[0]) + square(z[1]) - 4 * z[0] * z[1]; },
          first, second),
  };
}

std::vector<Formula> small_equilibria() {
  return {
      {.name = "scholtes1",
       .optimum = 2,
       .start = {1, 1, 1},
       .parts = [](const Jets& v) -> Parts {
         return {.objective = square(v[0] + 1) + square(v[1] - 2.5) + square(v[2] + 1),
                 .G = {v[0]},
                 .H = {v[1] - exp(v[0]) - exp(v[2])}};
       },
       .lower = {0, -kFree, 0}},
      {.name = "scholtes2",
       .optimum = 15,
       .start = {1, 1, 1},
       .parts = [](const Jets& v) -> Parts {
         return {.objective = square(v[0] + 1) + square(v[1]) + 10 * square(v[2] + 1),
                 .G = {v[0]},
                 .H = {v[1] - exp(v[0]) - exp(v[2])}};
       },
       .lower = {0, -kFree, 0}},
      {.name = "scholtes5",
       .optimum = 1,
       .start = {1, 1, 1},
       .parts = [](const Jets& v) -> Parts {
         return {.objective = square(v[0] - 1) + square(v[1] - 2) + square(v[2] + 1),
                 .G = {v[0], v[1]},
                 .H = {v[2], v[2]}};
       },
       .lower = {0, 0, 0}},
      {.name = "ex9.2.8",
       .optimum = 1.5,
       .start = {0, 0, 0, 0},
       .parts = [](const Jets& v) -> Parts {
         return {.objective = -4 * v[0] * v[1] + 3 * v[1] + 2 * v[0] + 1,
                 .equalities = {4 * v[0] - 1 - v[2] + v[3]},
                 .G = {v[1], 1 - v[1]},
                 .H = {v[2], v[3]}};
       },
       .lower = {0, 0, 0, 0},
       .upper = {1, kFree, kFree, kFree}},
      {.name = "bilevel3",
       .optimum = -12.67871,
       .start = std::vector<double>(12, 0.0),
       .parts = [](const Jets& v) -> Parts {
         const Jet &a = v[0], &b = v[1], &c = v[2], &d = v[3];
         return {.objective = -square(a) - 3 * b - 4 * c + square(d),
                 .equalities = {2 * c + 2 * v[4] - 3 * v[5] - v[6], 4 * v[5] - 5 - v[4] - v[7],
                                square(a) - 2 * a + square(b) - 2 * c + d + 3 - v[8],
                                b + 3 * c - 4 * d - 4 - v[9], c - v[10], d - v[11]},
                 .inequalities = {4 - square(a) - 2 * b},
                 .G = {v[8], v[9], v[10], v[11]},
                 .H = {v[4], v[5], v[6], v[7]}};
       },
       .lower = {0, 0, -kFree, -kFree, 0, 0, 0, 0, 0, 0, 0, 0}},
      {.name = "hakonsen",  // consumption, leisure, prices, taxes
       .optimum = -24.3668,
       .start = {1, 1, 1, 0, 0, 0, 0},
       .parts = [](const Jets& v) -> Parts {
         const Jet &a = v[0], &b = v[1], &leisure = v[2], &p = v[3], &q = v[4], &s = v[5], &t = v[6];
         return {.objective = -pow(a * b * leisure, 1.0 / 3.0),
                 .equalities = {a * p + b * q + leisure + 25 - 100},
                 .inequalities = {p * s * a + q * t * b - 25},
                 .G = {a, b, p, q},
                 .H = {1 - p, 1 - q, 3 * a * p * (1 + s) - 100, 3 * b * q * (1 + t) - 100}};
       },
       .lower = std::vector<double>(7, 0.0)},
      {.name = "design-cent-1",  // the largest disc: centre, radius, its three nearest points, multipliers
       .optimum = -1.86065,
       .start = {0, 0, 1, -1, 0, 0.2425356, 0.9701425, 0, -1, 0.5, 0.5153882, 0.5},
       .parts = [](const Jets& v) -> Parts {
         const auto inside = [&](int k) {
           return square(v[2]) - square(v[3 + 2 * k] - v[0]) - square(v[4 + 2 * k] - v[1]);
         };
         const auto pull = [&](int k, int j) { return 2 * (v[3 + 2 * k + j] - v[j]) * v[9 + k]; };
         return {.objective = -3.141592654 * square(v[2]),
                 .equalities = {1 + pull(0, 0), 2 * v[4] + pull(0, 1), -0.25 + pull(1, 0), -1 + pull(1, 1),
                                pull(2, 0), 1 + pull(2, 1)},
                 .inequalities = {v[3] + square(v[4]), 0.75 - 0.25 * v[5] - v[6], v[8] + 1},
                 .G = {v[9], v[10], v[11]},
                 .H = {inside(0), inside(1), inside(2)}};
       }},
  };
}

}  // namespace

std::vector<Formula> equilibrium_problems() {
  std::vector<Formula> all = two_variables();
  const std::vector<Formula> small = small_equilibria();
  all.insert(all.end(), small.begin(), small.end());
  const std::vector<Formula> more = {
      {.name = "ralph1",
       .optimum = 0,
       .start = {1, 1},
       .parts = [](const Jets& z) -> Parts {
         return {.objective = 2 * z[0] - z[1], .G = {z[1]}, .H = {z[1] - z[0]}};
       },
       .lower = {0, 0}},
      {.name = "scholtes4",
       .optimum = 0,
       .start = {0, 1, 0},
       .parts = [](const Jets& z) -> Parts {
         return {.objective = z[0] + z[1] - z[2],
                 .inequalities = {4 * z[0] - z[2], 4 * z[1] - z[2]},
                 .G = {z[0]},
                 .H = {z[1]}};
       }},
      {.name = "df1",
       .optimum = 0,
       .start = {0, 0},
       .parts = [](const Jets& v) -> Parts {
         return {.objective = square(v[0] - 1 - v[1]),
                 .inequalities = {2 - square(v[0]), 3 - square(v[0] - 1) - square(v[1] - 1)},
                 .G = {v[1]},
                 .H = {v[1] - square(v[0]) + 1}};
       },
       .lower = {-1, -kFree},
       .upper = {2, kFree}},
      {.name = "bard1",
       .optimum = 17,
       .start = {0, 0, 0, 0, 0},
       .parts = [](const Jets& v) -> Parts {
         const Jet &x = v[0], &y = v[1];
         return {.objective = square(x - 5) + square(2 * y + 1),
                 .equalities = {2 * (y - 1) - 1.5 * x + v[2] - 0.5 * v[3] + v[4]},
                 .G = {3 * x - y - 3, 0.5 * y + 4 - x, 7 - x - y},
                 .H = {v[2], v[3], v[4]}};
       },
       .lower = {0, 0, 0, 0, 0}},
      {.name = "bard3",
       .optimum = -12.67871,
       .start = {0, 0, 0, 0, 0, 0},
       .parts = [](const Jets& v) -> Parts {
         const Jet &a = v[0], &b = v[1], &c = v[2], &d = v[3];
         return {.objective = -square(a) - 3 * b - 4 * c + square(d),
                 .inequalities = {4 - square(a) - 2 * b},
                 .G = {square(a) - 2 * a + square(b) - 2 * c + d + 3, b + 3 * c - 4 * d - 4, c, d},
                 .H = {v[4], v[5], 2 * c + 2 * v[4] - 3 * v[5], -5 - v[4] + 4 * v[5]}};
       },
       .lower = {0, 0, 0, 0, 0, 0}},
      {.name = "bard91",
       .optimum = 2,
       .start = {3, 6, 1, 1},
       .parts = [](const Jets& v) -> Parts {
         return {.objective = v[0] + v[2],
                 .G = {v[1], v[2], v[3]},
                 .H = {2 - v[3], v[0] - v[3], v[1] + v[2] - v[0] - 4}};
       },
       .lower = {2, 0, 0, 0},
       .upper = {4, kFree, kFree, kFree}},
      {.name = "gauvin",
       .optimum = 20,
       .start = {7, 5, 0},
       .parts = [](const Jets& v) -> Parts {
         return {.objective = square(v[0]) + square(v[1] - 10),
                 .G = {v[1], v[2]},
                 .H = {4 * (v[0] + 2 * v[1] - 30) + v[2], 20 - v[0] - v[1]}};
       },
       .lower = {0, 0, 0},
       .upper = {15, kFree, kFree}},
      {.name = "stackelberg1",
       .optimum = -3266.6667,
       .start = {100, 25, 0},
       .parts = [](const Jets& v) -> Parts {
         return {.objective = 0.5 * square(v[0]) + 0.5 * v[0] * v[1] - 95 * v[0],
                 .equalities = {2 * v[1] + 0.5 * v[0] - 100 - v[2]},
                 .G = {v[1]},
                 .H = {v[2]}};
       },
       .lower = {0, 0, 0},
       .upper = {200, kFree, kFree}},
      {.name = "nash1",
       .optimum = 0,
       .start = {5, 5, 10, 10, 0, 0},
       .parts = [](const Jets& v) -> Parts {
         return {
             .objective = 0.5 * (square(v[0] - v[2]) + square(v[1] - v[3])),
             .equalities = {-34 + 2 * v[2] + 8.0 / 3.0 * v[3] + v[4], -24.25 + 1.25 * v[2] + 2 * v[3] + v[5]},
             .G = {15 - v[1] - v[2], 15 - v[0] - v[3]},
             .H = {v[4], v[5]}};
       },
       .lower = {0, 0, -kFree, -kFree, 0, 0},
       .upper = {10, 10, kFree, kFree, kFree, kFree}},
      {.name = "desilva",
       .optimum = -1,
       .start = {0, 0, 1, 1, 0, 0},
       .parts = [](const Jets& v) -> Parts {
         return {.objective = square(v[0]) - 2 * v[0] + square(v[1]) - 2 * v[1] + square(v[2]) + square(v[3]),
                 .equalities = {2 * (v[2] - v[0]) + 2 * (v[2] - 1) * v[4],
                                2 * (v[3] - v[1]) + 2 * (v[3] - 1) * v[5]},
                 .G = {0.25 - square(v[2] - 1), 0.25 - square(v[3] - 1)},
                 .H = {v[4], v[5]}};
       },
       .lower = {0, 0, -kFree, -kFree, 0, 0},
       .upper = {2, 2, kFree, kFree, kFree, kFree}},
      {.name = "clark",
       .optimum = 5,
       .start = {0, 0, 0, 0, 0},
       .parts = [](const Jets& v) -> Parts {
         return {.objective = square(v[0] - 3) + square(v[1] - 2),
                 .equalities = {2 * (v[1] - 5) + v[2] - 2 * v[3] + 2 * v[4]},
                 .G = {1 + 2 * v[0] - v[1], 2 * v[1] - v[0] - 2, 14 - v[0] - 2 * v[1]},
                 .H = {v[2], v[3], v[4]}};
       },
       .lower = {0, -kFree, 0, 0, 0},
       .upper = {8, kFree, kFree, kFree, kFree}},
      {.name = "gumus",
       .optimum = 2250,
       .start = {10, 4, 100, 0},
       .parts = [](const Jets& v) -> Parts {
         return {.objective = 16 * square(v[0]) + 9 * square(v[1]),
                 .equalities = {4 * pow(v[0] + v[1] - 20, 3) + v[2] - v[3]},
                 .inequalities = {4 * v[0] - v[1]},
                 .G = {50 - 4 * v[0] - v[1], v[1]},
                 .H = {v[2], v[3]}};
       },
       .lower = {0, 0, 0, 0},
       .upper = {12.5, 50, kFree, kFree}},
      {.name = "falk",
       .optimum = -2.25,
       .start = {0, 0, 1, 1, 0, 0, 0, 0},
       .parts = [](const Jets& v) -> Parts {
         const Jet &a = v[0], &b = v[1], &c = v[2], &d = v[3];
         return {.objective = square(a) - 3 * a + square(b) - 3 * b + square(c) + square(d),
                 .equalities = {2 * (c - a) - v[4] + v[5], 2 * (d - b) - v[6] + v[7]},
                 .G = {c - 0.5, 1.5 - c, d - 0.5, 1.5 - d},
                 .H = {v[4], v[5], v[6], v[7]}};
       },
       .lower = {0, 0, -kFree, -kFree, 0, 0, 0, 0}},
      gnash("gnash10", 1.0, 150, -230.823),
      gnash("gnash11", 1.1, 150, -129.912),
      gnash("gnash12", 1.3, 150, -36.9331),
      gnash("gnash13", 1.5, 150, -7.06178),
      gnash("gnash14", 1.7, 150, -0.179046),
      gnash("gnash15", 1.0, 50, -354.699),
      gnash("gnash16", 1.1, 40, -241.442),
      gnash("gnash17", 1.3, 30, -90.7491),
      gnash("gnash18", 1.5, 25, -25.6982),
      gnash("gnash19", 1.7, 20, -6.11671),
      outrata("outrata31", 3.2077, [](const Jets&) { return Jet(0); }),
      outrata("outrata32", 3.4494, [](const Jets& v) { return 0.5 * square(v[3] - 1); }),
      outrata("outrata33", 4.60425, [](const Jets& v) { return 5 * square(v[4]); }),
      outrata("outrata34", 6.59268,
              [](const Jets& v) { return 0.5 * (square(v[3] - 1) + square(v[4] - 1) + square(v[0])); }),
      oligopoly("oligopoly10", 1.0, -343.345),
      oligopoly("oligopoly11", 1.1, -203.155),
      oligopoly("oligopoly13", 1.3, -68.1357),
      oligopoly("oligopoly15", 1.5, -19.1541),
      oligopoly("oligopoly17", 1.7, -3.1612),
  };
  all.insert(all.end(), more.begin(), more.end());
  return all;
}

}  // namespace marble::testing
