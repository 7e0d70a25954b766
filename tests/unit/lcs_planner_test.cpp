// The LCQP of a planning problem, and control steps: what is sent, and which plan is returned.
#include <gtest/gtest.h>

#include <limits>
#include <stop_token>

#include "lcs_systems.h"
#include "marble/warm_solver.h"

namespace marble {
namespace {

using testing::cart_pole;
using testing::cart_pole_task;
using testing::numbers;
using testing::OwnedSystem;
using testing::random_system;
using testing::Rows;
using testing::Values;

using Dense = Eigen::MatrixXd;

Dense dense(const SparseMatrixView& m) {
  Dense made = Dense::Zero(m.rows, m.columns);
  for (Index j = 0; j < m.columns; ++j)
    for (Index k = m.column_pointers[j]; k < m.column_pointers[j + 1]; ++k)
      made(m.row_indices[k], j) = m.values[k];
  return made;
}

Eigen::Map<const Eigen::VectorXd> vector(std::span<const double> values) {
  return {values.data(), static_cast<Eigen::Index>(values.size())};
}

Values symmetric(std::mt19937& random, std::size_t size) {
  const Values root = numbers(random, size * size);
  const auto n = static_cast<Eigen::Index>(size);
  const Eigen::Map<const Rows> g(root.data(), n, n);
  const Rows product = g * g.transpose() + Rows::Identity(n, n);
  return {product.data(), product.data() + product.size()};
}

// A random planning problem with every part, and one step of it.
struct RandomPlan {
  explicit RandomPlan(unsigned seed) : random(seed) {
    nx = 1 + seed % 4, nu = 1 + seed % 3, nl = seed % 5, stages = 1 + seed % 6;
    system = random_system(seed, static_cast<Index>(nx), static_cast<Index>(nu), static_cast<Index>(nl),
                           seed % 2 == 0 ? static_cast<Index>(stages) : 0);
    task = {.stages = static_cast<Index>(stages),
            .Q = symmetric(random, nx),
            .R = symmetric(random, nu),
            .P = symmetric(random, nx)};
    if (seed % 3 > 0) task.R_change = symmetric(random, nu);
    if (seed % 4 > 0) task.regularization = 0.5;
    if (seed % 5 > 1) {
      task.u_lb = Values(nu, -2.0), task.u_ub = Values(nu, 1.5);
      task.max_u_change = Values(nu, 0.75);
      task.x_ub = Values(nx, 3.0), task.x_lb = Values(nx, -std::numeric_limits<double>::infinity());
      task.x_lb[0] = -4.0;
    }
    x0 = numbers(random, nx), last_u = numbers(random, nu);
    x_ref = numbers(random, (stages + 1) * nx), u_ref = numbers(random, stages * nu);
  }
  [[nodiscard]] LcsStep step() const { return {.x0 = x0, .x_ref = x_ref, .u_ref = u_ref, .last_u = last_u}; }

  std::mt19937 random;
  std::size_t nx, nu, nl, stages;
  OwnedSystem system;
  LcsTask task;
  Values x0, last_u, x_ref, u_ref;
};

double quadratic(const Values& W, std::size_t n, const double* v, const double* at) {
  double sum = 0.0;
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j) sum += (v[i] - at[i]) * W[i * n + j] * (v[j] - at[j]);
  return sum;
}

// As the comment of LcsTask has it, by loops.
double cost(const RandomPlan& p, const LcsTrajectory& t) {
  double sum = quadratic(p.task.P, p.nx, &t.x[p.stages * p.nx], &p.x_ref[p.stages * p.nx]);
  for (std::size_t k = 0; k < p.stages; ++k) {
    sum += quadratic(p.task.Q, p.nx, &t.x[k * p.nx], &p.x_ref[k * p.nx]);
    sum += quadratic(p.task.R, p.nu, &t.u[k * p.nu], &p.u_ref[k * p.nu]);
    if (!p.task.R_change.empty())
      sum +=
          quadratic(p.task.R_change, p.nu, &t.u[k * p.nu], k == 0 ? p.last_u.data() : &t.u[(k - 1) * p.nu]);
  }
  for (const double lam : t.lam) sum += p.task.regularization * lam * lam;
  return sum;
}

// A point that need not be feasible, as z and as a trajectory.
std::pair<Eigen::VectorXd, LcsTrajectory> random_point(RandomPlan& p) {
  LcsTrajectory t{p.x0, {}, {}};
  Values z;
  for (std::size_t k = 0; k < p.stages; ++k) {
    const Values u = numbers(p.random, p.nu), lam = numbers(p.random, p.nl), x = numbers(p.random, p.nx);
    for (const auto& [from, to] : {std::pair{&u, &t.u}, std::pair{&lam, &t.lam}, std::pair{&x, &t.x}}) {
      to->insert(to->end(), from->begin(), from->end());
      z.insert(z.end(), from->begin(), from->end());
    }
  }
  return {vector(z), t};
}

TEST(LcsAssembly, AgreesWithTheFormulasAtRandomPoints) {
  for (unsigned seed = 0; seed < 60; ++seed) {
    RandomPlan p(seed);
    auto planner = LcsPlanner::create(p.system.view(), p.task).value();
    ASSERT_TRUE(planner.begin(p.step()).has_value());
    const ProblemView view = planner.problem();
    const auto checked = Problem::create(view);
    ASSERT_TRUE(checked.has_value()) << checked.error().message();
    const auto [z, t] = random_point(p);
    const Dense Q = dense(view.Q).selfadjointView<Eigen::Upper>();
    const double objective = 0.5 * z.dot(Q * z) + vector(view.g).dot(z) + view.c0;
    EXPECT_NEAR(objective, cost(p, t), 1e-10 * (1.0 + std::abs(objective))) << seed;

    const auto part = [&](const Values& values, std::size_t rows, std::size_t columns, std::size_t k) {
      const std::size_t stage = values.size() > rows * columns ? k : 0;
      return Dense(Eigen::Map<const Rows>(values.data() + stage * rows * columns,
                                          static_cast<Eigen::Index>(rows),
                                          static_cast<Eigen::Index>(columns)));
    };
    Eigen::VectorXd dynamics(p.stages * p.nx), left(p.stages * p.nl), right(p.stages * p.nl);
    for (std::size_t k = 0; k < p.stages; ++k) {
      const auto x = vector(std::span(t.x).subspan(k * p.nx, p.nx)),
                 u = vector(std::span(t.u).subspan(k * p.nu, p.nu)),
                 lam = vector(std::span(t.lam).subspan(k * p.nl, p.nl)),
                 next = vector(std::span(t.x).subspan((k + 1) * p.nx, p.nx));
      const OwnedSystem& s = p.system;
      const auto row = static_cast<Eigen::Index>(k * p.nx), pair = static_cast<Eigen::Index>(k * p.nl);
      dynamics.segment(row, next.size()) = part(s.A, p.nx, p.nx, k) * x + part(s.B, p.nx, p.nu, k) * u +
                                           part(s.D, p.nx, p.nl, k) * lam + part(s.d, p.nx, 1, k) - next;
      left.segment(pair, lam.size()) = lam;
      right.segment(pair, lam.size()) = part(s.E, p.nl, p.nx, k) * x + part(s.F, p.nl, p.nl, k) * lam +
                                        part(s.H, p.nl, p.nu, k) * u + part(s.c, p.nl, 1, k);
    }
    const auto error = [](const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
      return a.size() == 0 ? 0.0 : (a - b).cwiseAbs().maxCoeff();
    };
    EXPECT_LT(error(dense(view.A) * z + vector(view.b), dynamics), 1e-12) << seed;
    if (p.nl > 0) {
      EXPECT_LT(error(dense(view.L) * z + vector(view.l), left), 1e-12) << seed;
      EXPECT_LT(error(dense(view.R) * z + vector(view.r), right), 1e-12) << seed;
    }
    if (p.task.u_lb.empty()) {
      EXPECT_TRUE(view.d.empty());
      continue;
    }
    const Eigen::VectorXd rows = dense(view.C) * z + vector(view.d);
    Values expected;
    for (std::size_t k = 0; k < p.stages; ++k) {
      for (std::size_t j = 0; j < p.nu; ++j) {
        const double u = t.u[k * p.nu + j], before = k == 0 ? p.last_u[j] : t.u[(k - 1) * p.nu + j];
        expected.insert(expected.end(), {u + 2.0, 1.5 - u, u - before + 0.75, before - u + 0.75});
      }
      for (std::size_t j = 0; j < p.nx; ++j) {
        const double x = t.x[(k + 1) * p.nx + j];
        if (j == 0) expected.push_back(x + 4.0);
        expected.push_back(3.0 - x);
      }
    }
    Values sorted(rows.data(), rows.data() + rows.size());
    ASSERT_EQ(sorted.size(), expected.size());
    std::ranges::sort(sorted);
    std::ranges::sort(expected);
    EXPECT_LT(error(vector(sorted), vector(expected)), 1e-12) << seed;
  }
}

bool are_equal(std::span<const double> a, std::span<const double> b) { return std::ranges::equal(a, b); }

TEST(LcsAssembly, WritesNewNumbersInPlaceAsIfBuiltAnew) {
  for (unsigned seed = 0; seed < 30; ++seed) {
    RandomPlan p(seed), other(seed + 30);
    other.system = random_system(seed + 77, p.system.states, p.system.inputs, p.system.pairs);
    auto planner = LcsPlanner::create(p.system.view(), p.task).value();
    const ProblemView before = planner.problem();
    const LcsView view = other.system.view();
    LcsStep step = p.step();
    step.lcs = &view;
    const LcsUpdate update = planner.begin(step).value();
    const ProblemView now = planner.problem();
    EXPECT_EQ(now.A.values.data(), before.A.values.data());
    auto fresh = LcsPlanner::create(view, p.task).value();
    ASSERT_TRUE(fresh.begin(p.step()).has_value());
    const ProblemView expected = fresh.problem();
    EXPECT_TRUE(are_equal(now.A.values, expected.A.values) && are_equal(now.R.values, expected.R.values));
    EXPECT_TRUE(are_equal(now.Q.values, expected.Q.values) && are_equal(now.g, expected.g));
    EXPECT_TRUE(are_equal(now.b, expected.b) && are_equal(now.r, expected.r) && are_equal(now.d, expected.d));
    EXPECT_EQ(now.c0, expected.c0);
    EXPECT_TRUE(are_equal(update.numbers.A, now.A.values) && are_equal(update.numbers.g, now.g));
  }
}

TEST(LcsAssembly, KeepsZerosInThePattern) {
  const auto planner = LcsPlanner::create(cart_pole().view(), cart_pole_task(5)).value();
  EXPECT_EQ(planner.problem().A.entries(), 5 * (4 * 1 + 4 * 2 + 4) + 4 * 16);
  EXPECT_EQ(planner.problem().R.entries(), 5 * (2 + 4) + 4 * 8);
  EXPECT_TRUE(Shift::by_stage(planner.problem(), 5).has_value());
}

struct Loop {
  Loop(const OwnedSystem& owned, const LcsTask& task, const Options& options = {})
      : system(owned),
        planner(LcsPlanner::create(system.view(), task, options).value()),
        solver(WarmSolver::create(Problem::create(planner.problem()).value(), options).value()) {}
  LcsPlan step(const LcsStep& numbers_of_step, const SolveControls& controls = {}) {
    return planner.step(solver, numbers_of_step, controls).value();
  }
  OwnedSystem system;
  LcsPlanner planner;
  WarmSolver solver;
};

TEST(LcsPlanner, StepsAreFeasibleAndNotAboveTheirStart) {
  LcsTask task = cart_pole_task(10);
  task.u_lb = {-30.0}, task.u_ub = {30.0}, task.max_u_change = {8.0}, task.R_change = {0.01};
  Loop loop(cart_pole(), task);
  Values x = {0.3, 0.3, 0.9, 0.5};
  Values last = {0.0};
  bool touches = false;
  for (int k = 0; k < 100; ++k) {
    const LcsPlan plan = loop.step({.x0 = x});
    ASSERT_TRUE(plan.feasible) << k << ": " << plan.detail;
    EXPECT_EQ(plan.status, Status::solved) << k << ": " << plan.detail;
    EXPECT_EQ(plan.origin, PlanOrigin::solve);
    EXPECT_LE(plan.objective, plan.start_objective + 1e-9 * (1.0 + plan.start_objective)) << k;
    EXPECT_LT(testing::residual(loop.system, plan), 1e-6) << k;
    EXPECT_EQ(Values(plan.x.begin(), plan.x.begin() + 4), x);
    EXPECT_LE(std::abs(plan.u[0] - last[0]), 8.0 + 1e-6) << k;  // the last input is that of the plan before
    last = {plan.u[0]};
    touches = touches || plan.lam[0] + plan.lam[1] > 0.0;
    const LCS lcs = LCS::create(loop.system.view()).value();
    const LcsTrajectory next = rollout(lcs, x, last).value();
    x.assign(next.x.begin() + 4, next.x.end());
  }
  EXPECT_TRUE(touches);
  EXPECT_LT(std::abs(x[1]), 0.2);
}

TEST(LcsPlanner, AgreesWithALoopThatIsBuiltAnewInEachStep) {
  Loop loop(cart_pole(), cart_pole_task(10));
  Values x = {0.2, 0.1, 0.4, -0.3};
  for (int k = 0; k < 10; ++k) {
    const LcsPlan plan = loop.step({.x0 = x});
    auto fresh = LcsPlanner::create(loop.system.view(), cart_pole_task(10)).value();
    ASSERT_TRUE(fresh.begin({.x0 = x}).has_value());
    const Solution solution = solve_in_process(fresh.problem()).value();
    EXPECT_NEAR(plan.objective, solution.objective, 1e-7 * (1.0 + solution.objective)) << k;
    x.assign(plan.x.begin() + 4, plan.x.begin() + 8);
  }
}

TEST(LcsPlanner, TakesOneFactorizationWhereTheBranchStays) {
  Loop loop(cart_pole(), cart_pole_task(10));
  Values x = {0.3, 0.3, 0.9, 0.5};
  int most = 0;
  for (int k = 0; k < 12; ++k) {
    const LcsUpdate update = loop.planner.begin({.x0 = x}).value();
    const Solution solution = loop.solver.solve(update.numbers, update.restart).value();
    if (k > 0) most = std::max(most, solution.factorizations);
    const LcsPlan plan = loop.planner.finish({.status = solution.status, .z = solution.z}).value();
    x.assign(plan.x.begin() + 4, plan.x.begin() + 8);
    x[2] += k % 2 == 0 ? 1e-3 : -1e-3;
  }
  EXPECT_EQ(most, 1);
}

// At rest, the dynamics' constants are rounding errors or zeros.
TEST(LcsPlanner, TakesNoMoreFactorizationsWhenOpenedWithRoundingErrors) {
  int factorizations[2] = {};
  for (const double noise : {0.0, 5e-15}) {
    OwnedSystem system = cart_pole();
    system.d = {noise, -2.0 * noise, 3.0 * noise, 0.5 * noise};
    Loop loop(system, cart_pole_task(10));
    Values x = {0.3, 0.3, 0.9, 0.5};
    for (int k = 0; k < 15; ++k) {
      const LcsUpdate update = loop.planner.begin({.x0 = x}).value();
      const Solution solution = loop.solver.solve(update.numbers, update.restart).value();
      const LcsPlan plan = loop.planner.finish({.status = solution.status, .z = solution.z}).value();
      factorizations[noise > 0.0] += solution.factorizations;
      x.assign(plan.x.begin() + 4, plan.x.begin() + 8);
    }
  }
  EXPECT_LE(factorizations[1], factorizations[0]);
}

TEST(LcsPlanner, ReturnsAFeasiblePlanWhenTheSolveIsStopped) {
  Loop loop(cart_pole(), cart_pole_task(10));
  const Values x = {0.3, 0.3, 0.9, 0.5};
  std::stop_source stopped;
  stopped.request_stop();
  const LcsPlan plan = loop.step({.x0 = x}, {.stop = stopped.get_token()});
  EXPECT_EQ(plan.status, Status::cancelled);
  EXPECT_TRUE(plan.feasible) << plan.detail;
  EXPECT_LE(plan.objective, plan.start_objective * (1.0 + 1e-12));
  EXPECT_LT(testing::residual(loop.system, plan), 1e-12);
}

// Numbers of a solution that is not feasible: its inputs are rolled out, or the start is returned, whichever
// is better.
TEST(LcsPlanner, RepairsASolutionThatIsNotFeasible) {
  Loop loop(cart_pole(), cart_pole_task(10));
  const Values x = {0.3, 0.3, 0.9, 0.5};
  const Solution best = [&] {
    const LcsUpdate update = loop.planner.begin({.x0 = x}).value();
    return loop.solver.solve(update.numbers, update.restart).value();
  }();
  Values z = best.z;
  for (std::size_t k = 0; k < 10; ++k) z[k * 7 + 3] += 0.1;  // a state
  const LcsPlan repaired = loop.planner.finish({.status = Status::numerical_failure, .z = z}).value();
  EXPECT_EQ(repaired.origin, PlanOrigin::solve_rollout);
  EXPECT_TRUE(repaired.feasible);
  EXPECT_NEAR(repaired.objective, best.objective, 1e-6 * best.objective);

  ASSERT_TRUE(loop.planner.begin({.x0 = x, .u = repaired.u}).has_value());
  for (std::size_t k = 0; k < 10; ++k) z[k * 7] = 50.0;  // an input
  const LcsPlan kept = loop.planner.finish({.status = Status::numerical_failure, .z = z}).value();
  EXPECT_EQ(kept.origin, PlanOrigin::start_rollout);
  EXPECT_EQ(kept.objective, kept.start_objective);
  EXPECT_EQ(kept.u, repaired.u);

  ASSERT_TRUE(loop.planner.begin({.x0 = x, .u = repaired.u}).has_value());
  const LcsPlan late = loop.planner.finish({.status = Status::time_limit}).value();
  EXPECT_EQ(late.origin, PlanOrigin::start_rollout);
  EXPECT_EQ(late.u, repaired.u);
}

TEST(LcsPlanner, LetsASolveThatWasCutOffGoOnOnce) {
  Loop loop(cart_pole(), cart_pole_task(10));
  const Values x = {0.3, 0.3, 0.9, 0.5};
  const auto starts_after = [&](Status status) {
    EXPECT_TRUE(loop.planner.finish({.status = status}).has_value());
    return !loop.planner.begin({.x0 = x}).value().restart.initial_z.empty();
  };
  EXPECT_FALSE(loop.planner.begin({.x0 = x}).value().restart.initial_z.empty());
  EXPECT_FALSE(starts_after(Status::time_limit));
  EXPECT_TRUE(starts_after(Status::time_limit));
  EXPECT_FALSE(starts_after(Status::cancelled));
  EXPECT_TRUE(starts_after(Status::solved));
  EXPECT_TRUE(starts_after(Status::numerical_failure));
}

TEST(LcsPlanner, KeepsABetterStartThanTheSolution) {
  Loop loop(cart_pole(), cart_pole_task(10));
  const Values x = {0.3, 0.3, 0.9, 0.5};
  const LcsPlan best = loop.step({.x0 = x});
  const LCS lcs = LCS::create(loop.system.view()).value();
  const LcsTrajectory worse = rollout(lcs, x, Values(10, 3.0)).value();
  Values z;
  for (std::size_t k = 0; k < 10; ++k) {
    z.push_back(worse.u[k]);
    z.insert(z.end(), &worse.lam[2 * k], &worse.lam[2 * k] + 2);
    z.insert(z.end(), &worse.x[4 * k + 4], &worse.x[4 * k + 4] + 4);
  }
  ASSERT_TRUE(loop.planner.begin({.x0 = x, .u = best.u}).has_value());
  const LcsPlan plan = loop.planner.finish({.status = Status::solved, .z = z}).value();
  EXPECT_EQ(plan.origin, PlanOrigin::start_rollout);
  EXPECT_EQ(plan.u, best.u);
}

TEST(LcsPlanner, RollsOutTheLastPlanShifted) {
  Loop loop(cart_pole(), cart_pole_task(6));
  const LcsPlan first = loop.step({.x0 = Values{0.1, 0.1, 0.0, 0.0}});
  ASSERT_TRUE(loop.planner.begin({.x0 = Values{0.1, 0.1, 0.0, 0.0}, .shift = 2}).has_value());
  const LcsPlan late = loop.planner.finish({.status = Status::time_limit}).value();
  EXPECT_EQ(late.u, (Values{first.u[2], first.u[3], first.u[4], first.u[5], first.u[5], first.u[5]}));
  ASSERT_TRUE(loop.planner.begin({.x0 = Values{0.1, 0.1, 0.0, 0.0}, .shift = 0}).has_value());
  EXPECT_EQ(loop.planner.finish({.status = Status::time_limit}).value().u, late.u);
}

TEST(LcsPlanner, ClipsTheStartToBoundsOfInputsAndOfTheirChange) {
  LcsTask task = cart_pole_task(4);
  task.u_lb = {-1.0}, task.u_ub = {1.0}, task.max_u_change = {0.75};
  Loop loop(cart_pole(), task);
  const Values x(4, 0.0), u = {5.0, 5.0, -5.0, -5.0}, last = {0.5};
  ASSERT_TRUE(loop.planner.begin({.x0 = x, .last_u = last, .u = u}).has_value());
  const LcsPlan plan = loop.planner.finish({.status = Status::time_limit}).value();
  EXPECT_EQ(plan.u, (Values{1.0, 1.0, 0.25, -0.5}));
  EXPECT_TRUE(plan.feasible);
}

TEST(LcsPlanner, ReportsAStartThatViolatesStateBounds) {
  LcsTask task = cart_pole_task(20);
  task.x_ub = {0.05, 1e20, 1e20, 1e20};
  Loop loop(cart_pole(), task);
  const Values x = {0.0, 0.0, 0.4, 0.0};
  const LcsPlan solved = loop.step({.x0 = x});
  EXPECT_EQ(solved.status, Status::solved);
  EXPECT_TRUE(solved.feasible);
  EXPECT_NE(solved.detail.find("start is not feasible"), std::string::npos) << solved.detail;
  EXPECT_NE(solved.detail.find("x_ub[0] is violated by"), std::string::npos) << solved.detail;
  EXPECT_EQ(solved.start_objective, std::numeric_limits<double>::infinity());
  ASSERT_TRUE(loop.planner.begin({.x0 = x, .u = Values(20, 0.0)}).has_value());
  const LcsPlan none = loop.planner.finish({.status = Status::time_limit}).value();
  EXPECT_FALSE(none.feasible);
  EXPECT_EQ(none.origin, PlanOrigin::start_rollout);
  EXPECT_GT(none.violations.inequality, 0.01);
}

TEST(LcsPlanner, SolvesWhereTheStartHasNoRollout) {
  OwnedSystem s;  // λ ⊥ u − 1/2 ≥ 0: no λ for the inputs 0 of the start
  s.states = s.inputs = s.pairs = 1;
  s.A = {1.0}, s.B = {1.0}, s.D = {0.0}, s.d = {0.0}, s.E = {0.0}, s.F = {0.0}, s.H = {1.0}, s.c = {-0.5};
  Loop loop(s, {.stages = 3, .Q = {1.0}, .R = {1.0}, .P = {1.0}, .regularization = 1.0});
  const LcsPlan plan = loop.step({.x0 = Values{0.0}});
  EXPECT_TRUE(plan.feasible) << plan.detail;
  EXPECT_EQ(plan.origin, PlanOrigin::solve);
  EXPECT_NEAR(plan.u[0], 0.5, 1e-6);
  EXPECT_NE(plan.detail.find("stages[0]"), std::string::npos) << plan.detail;
}

TEST(LcsPlanner, HasTheSameBitsInTwoParts) {
  Loop whole(cart_pole(), cart_pole_task(10)), parts(cart_pole(), cart_pole_task(10));
  Values x = {0.3, 0.3, 0.9, 0.5};
  for (int k = 0; k < 20; ++k) {
    const Values target = {0.01 * k, 0.0, 0.0, 0.0};
    OwnedSystem changed = cart_pole();
    changed.d[2] = 1e-3 * k;
    const LcsView view = changed.view();
    const LcsPlan expected = whole.step({.x0 = x, .lcs = &view, .x_ref = target});
    const LcsUpdate prepared = parts.planner.prepare({.lcs = &view, .x_ref = target}).value();
    EXPECT_FALSE(prepared.numbers.A.empty());
    ASSERT_TRUE(parts.solver.prepare(prepared.numbers, prepared.restart).has_value());
    const LcsUpdate update = parts.planner.begin({.x0 = x}).value();
    EXPECT_TRUE(update.numbers.A.empty() && update.numbers.R.empty() &&
                update.restart.shift.variables.empty());
    const Solution solution = parts.solver.solve(update.numbers, update.restart).value();
    const LcsPlan plan = parts.planner.finish({.status = solution.status, .z = solution.z}).value();
    EXPECT_EQ(plan.u, expected.u) << k;
    EXPECT_EQ(plan.objective, expected.objective) << k;
    x.assign(plan.x.begin() + 4, plan.x.begin() + 8);
  }
}

TEST(LcsPlanner, SendsAllNumbersAgainOnRequest) {
  Loop loop(cart_pole(), cart_pole_task(3));
  const Values x(4, 0.1);
  static_cast<void>(loop.step({.x0 = x}));
  EXPECT_TRUE(loop.planner.begin({.x0 = x}).value().numbers.A.empty());
  loop.planner.resend();
  const LcsUpdate update = loop.planner.begin({.x0 = x}).value();
  EXPECT_TRUE(are_equal(update.numbers.A, loop.planner.problem().A.values));
  EXPECT_TRUE(are_equal(update.numbers.g, loop.planner.problem().g));
}

TEST(LcsPlanner, RefusesBadStepsAndStaysAsItIs) {
  Loop loop(cart_pole(), cart_pole_task(3));
  const Values x(4, 0.1), bad = {0.0, 0.0, std::numeric_limits<double>::quiet_NaN(), 0.0};
  const auto refusal = [&](const LcsStep& step) { return loop.planner.begin(step).error().message(); };
  EXPECT_EQ(loop.planner.finish({}).error().code, ErrorCode::failed_precondition);
  const LcsPlan plan = loop.step({.x0 = x});
  EXPECT_EQ(refusal({.x0 = bad}), "x0[2] = nan: must be finite");
  EXPECT_EQ(loop.planner.begin({}).error().field, "x0");
  EXPECT_EQ(loop.planner.begin({.x0 = x, .last_u = x}).error().field, "last_u");
  EXPECT_EQ(refusal({.x0 = x, .u = x}), "u = 4: must have 3 entries (stages times inputs)");
  EXPECT_EQ(refusal({.x0 = x, .shift = 4}), "shift = 4: must be in [0, 3] (stages)");
  EXPECT_EQ(refusal({.x0 = x, .shift = -1}), "shift = -1: must be in [0, 3] (stages)");
  const OwnedSystem larger = random_system(1, 5, 1, 2), varying = random_system(1, 4, 1, 2, 2);
  OwnedSystem broken = cart_pole();
  broken.E[3] = std::numeric_limits<double>::infinity();
  LcsView view = larger.view();
  EXPECT_EQ(refusal({.x0 = x, .lcs = &view}), "lcs.states = 5: must be 4, as at the beginning");
  view = varying.view();
  EXPECT_EQ(refusal({.x0 = x, .lcs = &view}), "lcs.stages = 2: must be 3, or constant");
  view = broken.view();
  EXPECT_EQ(refusal({.x0 = x, .lcs = &view}), "lcs.E[3] = inf: must be finite");
  ASSERT_TRUE(loop.planner.begin({.x0 = x, .shift = 0}).has_value());
  EXPECT_EQ(loop.planner.finish({.status = Status::time_limit, .z = x}).error().field, "z");
  EXPECT_EQ(loop.planner.finish({.status = Status::time_limit}).value().u, plan.u);
}

TEST(LcsPlanner, IgnoresNumbersOfASolutionThatAreNotFinite) {
  Loop loop(cart_pole(), cart_pole_task(3));
  ASSERT_TRUE(loop.planner.begin({.x0 = Values(4, 0.1)}).has_value());
  const LcsPlan plan = loop.planner
                           .finish({.status = Status::numerical_failure,
                                    .z = Values(21, std::numeric_limits<double>::quiet_NaN())})
                           .value();
  EXPECT_EQ(plan.origin, PlanOrigin::start_rollout);
  EXPECT_TRUE(plan.feasible);
}

TEST(LcsPlanner, NamesOrigins) {
  EXPECT_STREQ(to_string(PlanOrigin::solve), "solve");
  EXPECT_STREQ(to_string(PlanOrigin::solve_rollout), "solve_rollout");
  EXPECT_STREQ(to_string(PlanOrigin::start_rollout), "start_rollout");
}

}  // namespace
}  // namespace marble
