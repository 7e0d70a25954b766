// Whole solves, by problem family and size: set-up and solve, cold, with default options.
#include <benchmark/benchmark.h>

#include "marble/examples.h"
#include "marble/solver.h"

namespace {

using namespace marble;

void count_work(benchmark::State& state, const Solution& s) {
  state.counters["factorizations"] = s.factorizations;
  state.counters["objective"] = s.objective;
}

void solve_repeatedly(benchmark::State& state, const OwnedProblem& p, const Options& options = {}) {
  Solver solver = Solver::create(Problem::create(p.view()).value(), options).value();
  Solution s;
  for (auto _ : state) s = solver.solve().value();
  count_work(state, s);
}

// min z₁² + z₂² − 2 z₁ − 2 z₂ + 2, 0 ≤ z₁ ⊥ z₂ ≥ 0: nothing but the cost of a solve itself.
void BM_Tiny(benchmark::State& state) {
  OwnedProblem p;
  p.g = {-2.0, -2.0};
  p.Q = compress(2, 2, {{0, 1}, {0, 1}, {2.0, 2.0}}, "Q").value();
  p.L = compress(1, 2, {{0}, {0}, {1.0}}, "L").value();
  p.R = compress(1, 2, {{0}, {1}, {1.0}}, "R").value();
  p.l = p.r = {0.0};
  solve_repeatedly(state, p);
}
BENCHMARK(BM_Tiny)->Unit(benchmark::kMicrosecond);

void BM_Hopper(benchmark::State& state) {
  examples::HopperParameters parameters;
  parameters.steps = static_cast<int>(state.range(0));
  solve_repeatedly(state, examples::hopper(parameters));
}
BENCHMARK(BM_Hopper)->ArgName("steps")->Arg(10)->Arg(30)->Arg(60)->Unit(benchmark::kMillisecond);

void BM_Rocket(benchmark::State& state) { solve_repeatedly(state, examples::rocket()); }
BENCHMARK(BM_Rocket)->Unit(benchmark::kMillisecond);

void BM_Gates(benchmark::State& state) { solve_repeatedly(state, examples::gates()); }
BENCHMARK(BM_Gates)->Unit(benchmark::kMillisecond);

void BM_Qpec(benchmark::State& state) {
  examples::QpecParameters parameters;
  parameters.upper_variables = static_cast<Index>(state.range(0)) / 5;
  parameters.lower_variables = static_cast<Index>(state.range(0)) - parameters.upper_variables;
  solve_repeatedly(state, examples::qpec(parameters, 1));
}
BENCHMARK(BM_Qpec)->ArgName("variables")->Arg(50)->Arg(100)->Arg(200)->Unit(benchmark::kMillisecond);

void BM_HopperPathAlone(benchmark::State& state) {
  Options options;
  options.local_search_budget = 0;
  solve_repeatedly(state, examples::hopper(), options);
}
BENCHMARK(BM_HopperPathAlone)->Unit(benchmark::kMillisecond);

void BM_SetUp(benchmark::State& state) {
  examples::HopperParameters parameters;
  parameters.steps = static_cast<int>(state.range(0));
  const OwnedProblem p = examples::hopper(parameters);
  for (auto _ : state) benchmark::DoNotOptimize(Solver::create(Problem::create(p.view()).value()));
}
BENCHMARK(BM_SetUp)->ArgName("steps")->Arg(60)->Arg(480)->Unit(benchmark::kMillisecond);

void BM_WarmHopper(benchmark::State& state) {
  const OwnedProblem p = examples::hopper();
  Solver solver = Solver::create(Problem::create(p.view()).value()).value();
  const Solution first = solver.solve().value();
  Solution s;
  for (auto _ : state) s = solver.solve({.warm_start = &first}).value();
  count_work(state, s);
}
BENCHMARK(BM_WarmHopper)->Unit(benchmark::kMillisecond);

}  // namespace
