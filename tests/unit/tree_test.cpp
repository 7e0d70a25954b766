// Branch and bound against an enumeration of all branches, which shares no code with it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "marble/examples.h"
#include "marble/warm_solver.h"
#include "support/brute_force.h"
#include "support/independent_check.h"
#include "support/random_problem.h"
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

// The optimum; nothing where the verdict is that there is none.
std::optional<double> expect_verdict(const OwnedProblem& p, const Solution& s, const std::string& name,
                                     Verdicts& seen) {
  const auto best = testing::brute_force(p.view());
  if (!best) {
    ++seen.infeasible;
    EXPECT_EQ(s.status, Status::infeasible) << name << " " << s.detail;
    EXPECT_TRUE(s.proved) << name << " " << s.detail;
    EXPECT_EQ(s.bound, kInfinity) << name;
    return {};
  }
  if (best->objective == -kInfinity) {
    ++seen.unbounded;
    EXPECT_TRUE(s.status == Status::unbounded || !s.proved) << name << " " << s.detail;
    EXPECT_EQ(s.bound, -kInfinity) << name << " " << s.detail;
    return {};
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
  return best->objective;
}

void expect_as_enumerated(const OwnedProblem& p, const std::string& name, Verdicts& seen) {
  Options options;
  options.global_search = true;
  const Solution s = solve_in_process(p.view(), options).value();
  const std::optional<double> best = expect_verdict(p, s, name, seen);
  if (!best) return;
  const double size = std::max(1.0, std::abs(*best));
  for (std::int64_t limit = 1; limit <= std::min<std::int64_t>(s.nodes + 1, 12); ++limit) {
    options.node_limit = static_cast<int>(limit);
    const Solution early = solve_in_process(p.view(), options).value();
    EXPECT_LE(early.bound, *best + 1e-7 * size) << name << " " << limit << " " << early.detail;
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

void move(std::vector<double>& values, std::mt19937_64& engine) {
  std::uniform_real_distribution<double> by(-0.05, 0.05);
  for (double& value : values) value += by(engine);
}

bool goes_on(const Solution& s) { return s.detail.find("nodes of the last tree") != std::string::npos; }

std::vector<ShiftBlock> any_blocks(std::size_t size, std::mt19937_64& engine) {
  const auto below = [&](Index bound) {
    return static_cast<Index>(engine() % static_cast<unsigned>(bound + 1));
  };
  ShiftBlock block;
  block.first = below(static_cast<Index>(size));
  block.count = below(static_cast<Index>(size) - block.first);
  block.by = below(block.count);
  return {block};
}

// A shift is a hint: bounds and optima must be right whatever it says, and whatever has changed.
TEST(Tree, ThatGoesOnFromTheLastOneFindsTheOptimumAndTheVerdictOfAnEnumerationToo) {
  Verdicts seen;
  int warm = 0;
  for (std::uint64_t seed = 1; seed <= 150; ++seed) {
    OwnedProblem p = make(seed, 2 + static_cast<Index>(seed / 6 % 5));
    std::mt19937_64 engine(seed);
    Options options;
    options.global_search = true;
    WarmSolver session = WarmSolver::create(Problem::create(p.view()).value(), options).value();
    Restart restart;
    for (int tick = 0; tick < 5; ++tick) {
      const Solution s =
          session
              .solve({.g = p.g, .b = p.b, .d = p.d, .l = p.l, .r = p.r, .Q = p.Q.values, .L = p.L.values},
                     restart)
              .value();
      warm += goes_on(s);
      expect_verdict(p, s, "seed " + std::to_string(seed) + ", tick " + std::to_string(tick), seen);
      for (std::vector<double>* values : {&p.g, &p.b, &p.d, &p.l, &p.r}) move(*values, engine);
      if (tick == 2) {
        for (double& value : p.Q.values) value *= 1.1;
        move(p.L.values, engine);
      }
      restart.shift = {};
      if (seed % 2 == 0) restart.shift.inequalities = any_blocks(p.d.size(), engine);
      if (seed % 2 == 0) restart.shift.pairs = any_blocks(p.l.size(), engine);
    }
  }
  EXPECT_GE(seen.optima, 400);
  EXPECT_GE(seen.infeasible, 50);
  EXPECT_GE(warm, 100);
}

// What a controller does: the horizon moves one stage on, and the state is a new one.
TEST(Tree, OfARecedingHorizonIsTheSameKeptAndBegunAnew) {
  constexpr int kStages = 5;
  examples::HopperParameters parameters{.steps = kStages};
  Options options;
  options.global_search = true;
  const OwnedProblem first = examples::hopper(parameters);
  const Problem problem = Problem::create(first.view()).value();
  WarmSolver kept = WarmSolver::create(problem, options, first.initial_z).value();
  Solver anew = Solver::create(problem, options).value();
  const Restart next{.shift = Shift::by_stage(first.view(), kStages).value()};
  int warm = 0;
  std::optional<Solution> last;
  for (int tick = 0; tick < 20; ++tick) {
    const OwnedProblem p = examples::hopper(parameters);
    const ProblemUpdate numbers{.c0 = p.c0, .g = p.g, .b = p.b, .d = p.d, .l = p.l, .r = p.r};
    const Solution s = kept.solve(numbers, last ? next : Restart()).value();
    ASSERT_TRUE(anew.update(numbers).has_value());
    const Solution cold = anew.solve({.initial_z = p.initial_z}).value();
    const double size = std::max(1.0, std::abs(cold.objective));
    EXPECT_EQ(s.status, Status::solved) << tick << " " << s.detail;
    EXPECT_TRUE(s.proved) << tick << " " << s.detail;
    EXPECT_TRUE(cold.proved) << tick << " " << cold.detail;
    EXPECT_NEAR(s.objective, cold.objective, 2e-6 * size) << tick << " " << s.detail << " " << cold.detail;
    EXPECT_LE(s.bound, cold.objective + 1e-7 * size) << tick;
    EXPECT_LE(cold.bound, s.objective + 1e-7 * size) << tick;
    warm += goes_on(s);
    parameters = examples::advance(parameters, s.z);
    last = s;
  }
  EXPECT_GE(warm, 10);
}

// From z = 0 some of these have local answers near which no branch is solved exactly.
TEST(Tree, NeverAnswersWithMoreThanTheLocalAnswer) {
  examples::HopperParameters parameters{.steps = 3};
  for (int tick = 0; tick < 4; ++tick) {
    const OwnedProblem p = examples::hopper(parameters);
    Options options;
    const Solution local = solve_in_process(p.view(), options).value();
    options.global_search = true;
    const Solution s = solve_in_process(p.view(), options).value();
    EXPECT_EQ(s.status, Status::solved) << s.detail;
    EXPECT_LE(s.objective, local.objective + 1e-9) << tick << " " << s.detail;
    EXPECT_LE(s.bound, s.objective) << tick << " " << s.detail;
    EXPECT_GE(s.bound, 0.9 * s.objective) << tick << " no bound where much is flat: " << s.detail;
    parameters = examples::advance(parameters, s.z);
  }
}

TEST(Tree, KeepsNothingThatItsMemoryWouldNotHold) {
  const OwnedProblem p = examples::hopper({.steps = 5});
  const Problem problem = Problem::create(p.view()).value();
  Options options;
  const std::int64_t local = Solver::create(problem, options).value().memory_bytes();
  options.global_search = true;
  const std::int64_t most = local + 4'000'000;
  WarmSolver small = WarmSolver::create(problem, options, p.initial_z, {.most_bytes = most}).value();
  WarmSolver large = WarmSolver::create(problem, options, p.initial_z).value();
  EXPECT_GT(large.memory_bytes(), local + 1'000'000) << "what it may keep is counted";
  EXPECT_LE(Solver::create(problem, options, {.most_bytes = most}).value().memory_bytes(), most);
  for (WarmSolver* session : {&small, &large}) {
    const Solution before = session->solve().value();
    const Solution after = session->solve().value();
    EXPECT_EQ(after.proved, before.proved) << after.detail;
    EXPECT_NEAR(after.objective, before.objective, 1e-9) << after.detail;
  }
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
