#include "tuning_families.h"

#include <cmath>
#include <limits>

#include "hard_families.h"
#include "marble/examples.h"
#include "marble/solver.h"
#include "noise.h"
#include "quadratic_families.h"
#include "record.h"
#include "support/independent_check.h"
#include "support/other_units.h"
#include "support/random_problem.h"

namespace marble::suite {
namespace {

constexpr double kRunaway_s = 60.0;  // processor time; no solve here takes a tenth of it

// A proof counts as a solution too, with objective 0.
double answer(const OwnedProblem& problem, const Solution& s) {
  if (s.status == Status::infeasible || s.status == Status::unbounded) return 0.0;
  return is_solved(s.status) && testing::judge(problem.view(), s).infeasibility() < 1e-6
             ? s.objective
             : std::numeric_limits<double>::quiet_NaN();
}

Outcome cold(const OwnedProblem& problem) {
  Options options;
  options.time_limit_s = kRunaway_s;
  const double begin = processor_seconds();
  const Solution s = solve_in_process(problem.view(), options).value();
  const double seconds = processor_seconds() - begin;
  return {answer(problem, s), static_cast<double>(s.factorizations), seconds};
}

// Returns the remaining gap of a tree with a bounded number of nodes.
Outcome proof(const OwnedProblem& problem) {
  Options options;
  options.time_limit_s = kRunaway_s;
  options.global_search = true;
  options.node_limit = 200;
  const double begin = processor_seconds();
  const Solution s = solve_in_process(problem.view(), options).value();
  const double seconds = processor_seconds() - begin;
  const double open = std::isnan(answer(problem, s)) ? std::numeric_limits<double>::quiet_NaN() : s.gap;
  return {open, static_cast<double>(s.factorizations + s.nodes), seconds};
}

// Solves a problem in units of 10^-3 to 10^3 for each variable and row; returns the objective in the original
// units.
Outcome in_other_units(const OwnedProblem& problem, std::uint64_t seed) {
  const auto random = [noise = Noise(seed)]() mutable { return std::pow(10.0, 3.0 * noise.uniform()); };
  return cold(testing::convert(problem, {random, random}).problem);
}

// Solves ten problems in a row, each from the previous solution: `next` changes the last problem, with the
// same matrices, and the start derived from its solution.
Outcome chain(OwnedProblem p, const std::function<void(OwnedProblem&, Solution&)>& next) {
  Options options;
  options.time_limit_s = kRunaway_s;
  Solver solver = Solver::create(Problem::create(p.view()).value(), options).value();
  Solution last = solver.solve().value();
  Outcome sum;
  for (int tick = 0; tick < 10; ++tick) {
    next(p, last);
    static_cast<void>(
        solver.update({.c0 = p.c0, .g = p.g, .b = p.b, .d = p.d, .l = p.l, .r = p.r}).has_value());
    const double begin = processor_seconds();
    last = solver.solve({.warm_start = &last}).value();
    sum.seconds += processor_seconds() - begin;
    sum.objective += answer(p, last);
    sum.factorizations += last.factorizations;
  }
  return sum;
}

// Changes the vectors by `size`.
Outcome warm(const OwnedProblem& problem, double size, std::uint64_t seed) {
  return chain(problem, [noise = Noise(seed), size](OwnedProblem& p, Solution&) mutable {
    for (auto* vector : {&p.g, &p.b, &p.d, &p.l, &p.r}) noise.apply(*vector, size);
  });
}

// A hopper as in its planner: it executes the first step of its plan, and plans from there.
Outcome plan(const examples::HopperParameters& first) {
  return chain(examples::hopper(first), [parameters = first](OwnedProblem& p, Solution& last) mutable {
    parameters = examples::advance(parameters, last.z);
    p = examples::hopper(parameters);
    last = examples::shift_hopper(last);
  });
}

// min ½ z'Qz + g'z with a full indefinite Q in a box: descent along negative curvature.
OwnedProblem box(Index n, std::uint64_t seed) {
  Noise noise(seed);
  OwnedProblem p;
  Triplets Q, C;
  for (Index j = 0; j < n; ++j) {
    for (Index i = 0; i <= j; ++i) {
      const double value = noise.uniform();
      Q.add(i, j, value);
      if (i != j) Q.add(j, i, value);
    }
    C.add(2 * j, j, 1.0);
    C.add(2 * j + 1, j, -1.0);
    p.g.push_back(noise.uniform());
  }
  p.Q = compress(n, n, Q, "Q").value();
  p.C = compress(2 * n, n, C, "C").value();
  p.d.assign(2 * static_cast<std::size_t>(n), 1.0);
  return p;
}

// A feasible problem with contradictory rows added: v ≥ 1 and v ≤ 0.
OwnedProblem contradictory(std::uint64_t seed) {
  OwnedProblem p = testing::random_problem({}, seed);
  Noise noise(seed);
  Triplets entries;
  for (Index j = 0; j < p.C.columns; ++j) {
    for (Index k = p.C.column_pointers[j]; k < p.C.column_pointers[j + 1]; ++k)
      entries.add(p.C.row_indices[k], j, p.C.values[k]);
    const double value = noise.uniform();
    entries.add(p.C.rows, j, value);
    entries.add(p.C.rows + 1, j, -value);
  }
  p.C = compress(p.C.rows + 2, p.C.columns, entries, "C").value();
  p.d.insert(p.d.end(), {-1.0, 0.0});
  return p;
}

}  // namespace

std::vector<Instance> tuning_instances(int seeds, bool judging) {
  using namespace examples;
  std::vector<Instance> all;
  const auto add = [&all](const char* family, auto&& solve) { all.push_back({family, solve}); };
  for (int number = 0; number < seeds; ++number) {
    const auto seed = static_cast<std::uint64_t>(2 * number + (judging ? 2 : 1));
    const int kind = number % 3;
    HopperParameters hops;
    hops.steps = 20 + 10 * kind;
    GatesParameters flight;
    flight.steps = 20 + 5 * kind;
    RocketParameters landing;
    landing.steps = 30 + 10 * kind;
    QpecParameters sizes;
    sizes.upper_variables = 10 + 10 * kind;
    sizes.lower_variables = 60;
    sizes.degenerate_pairs = 4 * kind;
    const testing::RandomSizes small{.variables = 20, .equalities = 3, .inequalities = 8, .pairs = 8};
    const testing::RandomSizes indefinite{
        .variables = 20, .equalities = 3, .inequalities = 8, .pairs = 8, .density = 0.4, .indefinite = true};
    add("hopper", [=] { return cold(hopper(vary(hops, seed))); });
    add("gates", [=] { return cold(gates(vary(flight, seed))); });
    add("rocket", [=] { return cold(rocket(vary(landing, seed))); });
    add("qpec", [=] { return cold(qpec(sizes, seed)); });
    add("random", [=] { return cold(testing::random_problem(small, seed)); });
    add("indefinite", [=] { return cold(testing::random_problem(indefinite, seed)); });
    add("box", [=] { return cold(box(20, seed)); });
    add("contradictory", [=] { return cold(contradictory(seed)); });
    add("warm rocket", [=] { return warm(rocket(vary(landing, seed)), 1e-3, seed); });
    add("warm qpec", [=] { return warm(qpec(sizes, seed), kind == 0 ? 1e-3 : 3e-2, seed); });
    add("warm hopper", [=] { return plan(vary(hops, seed)); });
    HopperParameters few_hops = hops;
    few_hops.steps = 3 + kind;
    add("proof of a hopper", [=] { return proof(hopper(vary(few_hops, seed))); });
    add("proof of a rocket", [=] { return proof(rocket(vary(landing, seed))); });
    add("proof of a qpec", [=] { return proof(qpec({10, 20 + 10 * kind, 4, 2}, seed)); });
    add("hopper in other units", [=] { return in_other_units(hopper(vary(hops, seed)), seed); });
    add("qpec in other units", [=] { return in_other_units(qpec(sizes, seed), seed); });
    add("scattered QP", [=] { return cold(scattered_problem(100 + 50 * kind, Curvature(kind), seed)); });
    add("linear MPC", [=] { return cold(mpc_problem(20 + 20 * kind, seed)); });
  }
  for (const HardProblem& hard : hard_problems(seeds, judging)) {
    const bool random = !hard.proof.has_value() && hard.family != "cheap gates";
    if (random && hard.problem.L.rows <= 40)
      all.push_back({hard.family, [problem = hard.problem] { return cold(problem); }});
  }
  return all;
}

}  // namespace marble::suite
