// Measures whole solves, by problem family and size: set-up and solve, cold, with default options.
#include "marble/solver.h"

#include <benchmark/benchmark.h>

#include "problems.h"

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

// min z₁² + z₂² − 2 z₁ − 2 z₂ + 2, 0 ≤ z₁ ⊥ z₂ ≥ 0: measures the fixed cost of a solve.
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

void BM_Hopper(benchmark::State& state) { solve_repeatedly(state, micro::hopper(state.range(0))); }
BENCHMARK(BM_Hopper)->ArgName("steps")->Arg(10)->Arg(30)->Arg(60)->Unit(benchmark::kMillisecond);

void BM_Rocket(benchmark::State& state) { solve_repeatedly(state, micro::rocket(state.range(0))); }
BENCHMARK(BM_Rocket)->ArgName("steps")->Arg(20)->Arg(40)->Unit(benchmark::kMillisecond);

void BM_Gates(benchmark::State& state) { solve_repeatedly(state, micro::gates(state.range(0))); }
BENCHMARK(BM_Gates)->ArgName("steps")->Arg(30)->Unit(benchmark::kMillisecond);

void BM_Qpec(benchmark::State& state) { solve_repeatedly(state, micro::qpec(state.range(0))); }
BENCHMARK(BM_Qpec)->ArgName("variables")->Arg(50)->Arg(100)->Arg(200)->Unit(benchmark::kMillisecond);

void BM_HopperPathAlone(benchmark::State& state) {
  Options options;
  options.max_local_search_factorizations = 0;
  solve_repeatedly(state, micro::hopper(state.range(0)), options);
}
BENCHMARK(BM_HopperPathAlone)->ArgName("steps")->Arg(60)->Unit(benchmark::kMillisecond);

void BM_SetUp(benchmark::State& state) {
  const OwnedProblem p = micro::hopper(state.range(0));
  for (auto _ : state) benchmark::DoNotOptimize(Solver::create(Problem::create(p.view()).value()));
}
BENCHMARK(BM_SetUp)->ArgName("steps")->Arg(60)->Arg(480)->Unit(benchmark::kMillisecond);

void BM_WarmHopper(benchmark::State& state) {
  const OwnedProblem p = micro::hopper(state.range(0));
  Solver solver = Solver::create(Problem::create(p.view()).value()).value();
  const Solution first = solver.solve().value();
  Solution s;
  for (auto _ : state) s = solver.solve({.warm_start = &first}).value();
  count_work(state, s);
}
BENCHMARK(BM_WarmHopper)->ArgName("steps")->Arg(60)->Unit(benchmark::kMillisecond);

}  // namespace
