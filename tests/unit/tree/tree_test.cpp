// Branch and bound against an enumeration of all branches, which shares no code with it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "marble/examples.h"
#include "marble/solver.h"
#include "support/judges/brute_force.h"
#include "support/judges/independent_check.h"
#include "support/problems/random_problem.h"
#include "workbench.h"

namespace marble {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Rows z_j + 10 ≥ 0 and 10 − z_j ≥ 0 for all variables, before those there are.
void add_box(OwnedProblem& p) {
  const auto n = static_cast<Index>(p.g.size());
  Triplets entries;
  for (Index j = 0; j < n; ++j) {
    entries.add(2 * j, j, 1.0);
    entries.add(2 * j + 1, j, -1.0);
    for (Index k = p.C.columns > 0 ? p.C.column_pointers[j] : 0;
         k < (p.C.columns > 0 ? p.C.column_pointers[j + 1] : 0); ++k)
      entries.add(2 * n + p.C.row_indices[k], j, p.C.values[k]);
  }
  p.C = compress(2 * n + static_cast<Index>(p.d.size()), n, entries, "C").value();
  p.d.insert(p.d.begin(), static_cast<std::size_t>(2 * n), 10.0);
}

// Takes the curvature of every second variable away.
void flatten(OwnedProblem& p) {
  for (Index j = 0; j < p.Q.columns; ++j) {
    for (Index k = p.Q.column_pointers[j]; k < p.Q.column_pointers[j + 1]; ++k) {
      if (j % 2 == 0 || p.Q.row_indices[k] % 2 == 0) p.Q.values[k] = 0.0;
    }
  }
}

// The last row of a matrix becomes another one.
void repeat_row(SparseMatrix& m, std::vector<double>& offset, Index from, Index to) {
  Triplets entries;
  for (Index j = 0; j < m.columns; ++j) {
    for (Index k = m.column_pointers[j]; k < m.column_pointers[j + 1]; ++k) {
      if (m.row_indices[k] != to) entries.add(m.row_indices[k], j, m.values[k]);
      if (m.row_indices[k] == from) entries.add(to, j, m.values[k]);
    }
  }
  m = compress(m.rows, m.columns, entries, "m").value();
  offset[static_cast<std::size_t>(to)] = offset[static_cast<std::size_t>(from)];
}

// Strictly convex, flat in a box, flat, degenerate, and such that may have no feasible branch, or few.
OwnedProblem make(std::uint64_t seed, Index pairs) {
  testing::RandomSizes sizes;
  sizes.pairs = pairs;
  sizes.variables = 3 + static_cast<Index>(seed % 7) + pairs / 2;
  sizes.equalities = static_cast<Index>(seed % 3);
  sizes.inequalities = 2 + static_cast<Index>(seed % 5);
  sizes.density = 0.5;
  OwnedProblem p = testing::random_problem(sizes, seed);
  std::mt19937_64 engine(seed);
  const auto shift = [&engine](std::vector<double>& values, double size) {
    for (double& value : values) value -= size * static_cast<double>(engine() % 1000) / 1000.0;
  };
  switch (seed % 6) {
    case 1:
      flatten(p);
      add_box(p);
      break;
    case 2:
      shift(p.l, 1.0);
      shift(p.r, 1.0);
      break;
    case 3:
      if (pairs > 1) {
        repeat_row(p.L, p.l, 0, pairs - 1);
        repeat_row(p.R, p.r, 0, pairs - 1);
      }
      if (p.d.size() > 1) repeat_row(p.C, p.d, 0, static_cast<Index>(p.d.size()) - 1);
      break;
    case 4:
      shift(p.b, 3.0);
      shift(p.d, 2.0);
      shift(p.l, 2.0);
      add_box(p);
      break;
    case 5:
      flatten(p);
      break;
    default:
      break;
  }
  return p;
}

struct Verdicts {
  int optima = 0, infeasible = 0, unbounded = 0;
  int unproved = 0;  // optima that are right, but not proved
};

void expect_as_enumerated(const OwnedProblem& p, const std::string& name, Verdicts& seen) {
  const auto best = testing::brute_force(p.view());
  Options options;
  options.global = true;
  const Solution s = solve_in_process(p.view(), options).value();
  if (!best) {
    ++seen.infeasible;
    EXPECT_EQ(s.status, Status::infeasible) << name << " " << s.detail;
    EXPECT_TRUE(s.proved) << name << " " << s.detail;
    EXPECT_EQ(s.bound, kInfinity) << name;
    return;
  }
  if (best->objective == -kInfinity) {
    ++seen.unbounded;
    EXPECT_TRUE(s.status == Status::unbounded || !s.proved) << name << " " << s.detail;
    EXPECT_EQ(s.bound, -kInfinity) << name << " " << s.detail;
    return;
  }
  ++seen.optima;
  const double size = std::max(1.0, std::abs(best->objective));
  EXPECT_EQ(s.status, Status::solved) << name << " " << s.detail;
  EXPECT_NEAR(s.objective, best->objective, 2e-6 * size) << name << " " << s.detail;
  EXPECT_LE(s.bound, best->objective + 1e-7 * size) << name << " " << s.detail;
  EXPECT_EQ(s.proved, s.gap <= 1e-6) << name << " " << s.detail;
  EXPECT_EQ(s.open_nodes, 0) << name;
  seen.unproved += !s.proved;
  EXPECT_LE(testing::judge(p.view(), s).infeasibility(), 1e-6) << name;
  for (std::int64_t limit = 1; limit <= std::min<std::int64_t>(s.nodes + 1, 12); ++limit) {
    options.node_limit = static_cast<int>(limit);
    const Solution early = solve_in_process(p.view(), options).value();
    EXPECT_LE(early.bound, best->objective + 1e-7 * size) << name << " " << limit << " " << early.detail;
    EXPECT_LE(early.nodes, limit) << name;
    EXPECT_TRUE(early.proved || early.status == Status::iteration_limit || !s.proved)
        << name << " " << early.detail;
  }
}

TEST(Tree, FindsTheOptimumAndTheVerdictOfAnEnumerationOfAllBranches) {
  Verdicts seen;
  for (std::uint64_t seed = 1; seed <= 1900; ++seed)
    expect_as_enumerated(make(seed, 1 + static_cast<Index>(seed / 6 % 4)), "seed " + std::to_string(seed),
                         seen);
  EXPECT_GE(seen.optima, 1000);
  EXPECT_GE(seen.infeasible, 100);
  EXPECT_GE(seen.unbounded, 10);
  EXPECT_EQ(seen.unproved, 0);
}

TEST(Tree, FindsTheOptimumAmongThousandsOfBranches) {
  Verdicts seen;
  for (std::uint64_t seed = 1; seed <= 94; ++seed)
    expect_as_enumerated(make(seed, 5 + static_cast<Index>(seed / 6 % 3)), "seed " + std::to_string(seed),
                         seen);
  for (std::uint64_t seed = 1; seed <= 6; ++seed)
    expect_as_enumerated(make(seed, 12), "12 pairs, seed " + std::to_string(seed), seen);
  EXPECT_GE(seen.optima, 50);
  EXPECT_EQ(seen.unproved, 0);
}

}  // namespace
}  // namespace marble
