// Batches of numbers for one pattern: one by one, as a session and as a batch, on the same elements.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "families.h"
#include "marble/batch_solver.h"
#include "marble/examples.h"
#include "marble/lcs.h"
#include "marble/owned.h"
#include "marble/warm_solver.h"
#include "noise.h"
#include "support/independent_check.h"
#include "support/random_problem.h"
#include "unit/lcs_systems.h"

namespace marble::suite {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

struct Elements {
  OwnedProblem pattern;
  std::vector<OwnedProblem> problems;  // with its pattern
  bool matrices = false;               // they differ too

  void add(OwnedProblem problem) { problems.push_back(std::move(problem)); }
  [[nodiscard]] ProblemUpdate update(std::size_t i) const {
    const OwnedProblem& p = problems[i];
    ProblemUpdate update{.c0 = p.c0, .g = p.g, .b = p.b, .d = p.d, .l = p.l, .r = p.r};
    if (matrices)
      update.Q = p.Q.values, update.A = p.A.values, update.C = p.C.values, update.L = p.L.values,
      update.R = p.R.values;
    return update;
  }
};

// Owns what a BatchNumbers borrows.
struct Table {
  explicit Table(const Elements& elements) {
    for (std::size_t i = 0; i < elements.problems.size(); ++i) {
      const ProblemUpdate u = elements.update(i);
      const std::span<const double> parts[] = {{&*u.c0, 1}, u.g, u.b, u.d, u.l, u.r, u.Q, u.A, u.C, u.L, u.R};
      for (std::size_t k = 0; k < std::size(parts); ++k)
        values[k].insert(values[k].end(), parts[k].begin(), parts[k].end());
    }
    numbers = {elements.problems.size(),
               values[0],
               values[1],
               values[2],
               values[3],
               values[4],
               values[5],
               values[6],
               values[7],
               values[8],
               values[9],
               values[10]};
  }
  std::vector<double> values[11];
  BatchNumbers numbers;
};

// A cart-pole between soft walls from random states: in a third of the plans, the pole touches a wall.
Elements cart_poles(std::size_t count, std::uint64_t seed) {
  Noise noise(seed);
  const auto within = [&](double size) { return size * noise.uniform(); };
  const testing::OwnedSystem system = testing::cart_pole();
  auto planner = LcsPlanner::create(system.view(), testing::cart_pole_task(10)).value();
  Elements elements;
  elements.pattern = owned(planner.problem());
  for (std::size_t i = 0; i < count; ++i) {
    const std::vector<double> x0 = {within(0.4), within(0.3), within(1.0), within(1.0)};
    static_cast<void>(planner.begin({.x0 = x0, .shift = 0}).value());
    elements.add(owned(planner.problem()));
  }
  return elements;
}

Elements hoppers(std::size_t count, std::uint64_t seed) {
  examples::HopperParameters parameters;
  parameters.steps = 10;
  Elements elements;
  elements.pattern = examples::hopper(parameters);
  elements.matrices = true;
  for (std::size_t i = 0; i < count; ++i) elements.add(examples::hopper(vary(parameters, seed + i)));
  return elements;
}

Elements random_elements(const testing::RandomSizes& sizes, std::size_t count, std::uint64_t seed) {
  Noise noise(seed);
  const auto within = [&](double size) { return size * noise.uniform(); };
  Elements elements;
  elements.pattern = testing::random_problem(sizes, seed);
  for (std::size_t i = 0; i < count; ++i) {
    OwnedProblem p = elements.pattern;
    for (double& entry : p.g) entry += within(0.3);
    for (double& entry : p.d) entry += 0.1 + within(0.1);
    elements.add(std::move(p));
  }
  return elements;
}

struct Run {
  double seconds = 0.0, processor_s = 0.0, factorizations = 0.0;
  std::vector<double> objectives;  // infinity: not solved
  int wrong = 0;                   // by the independent check
};

void take(const Elements& elements, std::size_t i, Status status, std::span<const double> z, double objective,
          Run& run) {
  const bool solved = is_solved(status);
  run.objectives.push_back(solved ? objective : INFINITY);
  if (!solved) return;
  const testing::Verdict verdict =
      testing::judge_point(elements.problems[i].view(), std::vector<double>(z.begin(), z.end()));
  run.wrong += verdict.infeasibility() > 1e-6 ||
               std::abs(verdict.objective - objective) > 1e-6 * std::max(1.0, std::abs(objective));
}

// On a solver that is set up once, or by the whole: set-up and solve.
Run one_by_one(const Elements& elements, bool sets_up) {
  Run run;
  auto solver = Solver::create(Problem::create(elements.pattern.view()).value()).value();
  for (std::size_t i = 0; i < elements.problems.size(); ++i) {
    const auto begin = Clock::now();
    const double processor_begin = processor_seconds();
    Solution solution;
    if (sets_up) {
      solution = solve_in_process(elements.problems[i].view()).value();
    } else {
      static_cast<void>(solver.update(elements.update(i)));
      solution = solver.solve().value();
    }
    run.seconds += seconds_since(begin);
    run.processor_s += processor_seconds() - processor_begin;
    run.factorizations += solution.factorizations;
    take(elements, i, solution.status, solution.z, solution.objective, run);
  }
  return run;
}

Run session(const Elements& elements) {
  Run run;
  auto solver = WarmSolver::create(Problem::create(elements.pattern.view()).value()).value();
  for (std::size_t i = 0; i < elements.problems.size(); ++i) {
    const auto begin = Clock::now();
    const double processor_begin = processor_seconds();
    const Solution solution = solver.solve(elements.update(i)).value();
    run.seconds += seconds_since(begin);
    run.processor_s += processor_seconds() - processor_begin;
    run.factorizations += solution.factorizations;
    take(elements, i, solution.status, solution.z, solution.objective, run);
  }
  return run;
}

Run batch(const Elements& elements, const Table& table, int threads, BatchResult* start = nullptr) {
  auto solver = BatchSolver::create(Problem::create(elements.pattern.view()).value()).value();
  if (start != nullptr && start->count == 0)
    *start = solver.solve(table.numbers, {.threads = threads, .multipliers = true}).value();
  const auto begin = Clock::now();
  const double processor_begin = processor_seconds();
  const BatchResult result = solver.solve(table.numbers, {.threads = threads, .start = start}).value();
  Run run;
  run.seconds = seconds_since(begin);
  run.processor_s = processor_seconds() - processor_begin;
  const std::size_t n = elements.pattern.g.size();
  for (std::size_t i = 0; i < result.count; ++i) {
    run.factorizations += result.factorizations[i];
    take(elements, i, result.status[i], std::span(result.z).subspan(i * n, n), result.objective[i], run);
  }
  return run;
}

void print(const char* name, const char* how, const Run& run, const Run& reference) {
  const std::size_t count = run.objectives.size();
  int higher = 0, lower = 0, solved = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const double apart = run.objectives[i] - reference.objectives[i];
    const double noise = 1e-6 * std::max(1.0, std::abs(reference.objectives[i]));
    solved += std::isfinite(run.objectives[i]);
    higher += apart > noise;
    lower += apart < -noise;
  }
  const double each = static_cast<double>(count);
  std::printf("%-12s %-24s %8zu %8d %8.1f %10.1f %10.1f %10.0f %8d %8d %8d\n", name, how, count, solved,
              run.factorizations / each, 1e6 * run.seconds / each, 1e6 * run.processor_s / each,
              each / run.seconds, higher, lower, run.wrong);
  std::fflush(stdout);
}

void compare(const char* name, const Elements& elements) {
  const Run reference = one_by_one(elements, false);
  print(name, "one by one, whole", one_by_one(elements, true), reference);
  print(name, "one by one, numbers", reference, reference);
  print(name, "session, in this order", session(elements), reference);
  const Table table(elements);
  print(name, "batch, 1 thread", batch(elements, table, 1), reference);
  print(name, "batch, 2 threads", batch(elements, table, 2), reference);
  BatchResult start;
  print(name, "again from its result", batch(elements, table, 2, &start), reference);
}

}  // namespace

void batches(const Settings& settings) {
  std::printf("%-12s %-24s %8s %8s %8s %10s %10s %10s %8s %8s %8s\n", "elements", "how", "count", "solved",
              "fact.", "us each", "us of CPU", "per s", "higher", "lower", "wrong");
  const auto seed = static_cast<std::uint64_t>(settings.judging ? 2000 : 1000);
  const auto wanted = [&](const char* name) { return settings.only.empty() || settings.only == name; };
  if (wanted("cart-pole")) compare("cart-pole", cart_poles(1000, seed));
  if (wanted("hopper")) compare("hopper", hoppers(200, seed));
  if (wanted("random")) {
    compare("random 4", random_elements({}, 1000, seed));
    compare(
        "random 30",
        random_elements({.variables = 40, .equalities = 8, .inequalities = 20, .pairs = 30, .density = 0.2},
                        200, seed));
  }
  if (wanted("tiny"))
    compare("tiny",
            random_elements({.variables = 2, .equalities = 0, .inequalities = 0, .pairs = 1, .density = 1.0},
                            10'000, seed));
}

}  // namespace marble::suite
