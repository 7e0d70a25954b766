// Measures the solver's linear system: analysis, factorization, and solves with the factors.
#include "kkt/kkt.h"

#include <benchmark/benchmark.h>

#include "model/scaling.h"
#include "problems.h"

namespace {

using namespace marble;

constexpr int kScalingPasses = 10;

ScaledProblem scaled(const OwnedProblem& problem) {
  return scale(Problem::create(problem.view()).value(), kScalingPasses);
}

// Weights as in the middle of a solve: every row has a weight, every pair an angle.
RowWeights weights_of(const ScaledProblem& problem) {
  RowWeights weights(problem);
  weights.rho = 1e6;
  weights.delta = 1e-6;
  weights.rows.inequality().setConstant(0.5);
  weights.rows.s().setConstant(2.0);
  weights.rows.t().setConstant(0.1);
  weights.cosine.setConstant(0.6);
  weights.sine.setConstant(0.8);
  return weights;
}

void label(benchmark::State& state, const Kkt& kkt, const ScaledProblem& problem) {
  state.SetLabel(std::string(kkt.name()) + ", n = " + std::to_string(problem.variables()));
}

void analyse(benchmark::State& state, const OwnedProblem& owned) {
  const ScaledProblem problem = scaled(owned);
  for (auto _ : state) benchmark::DoNotOptimize(make_kkt(problem));
  label(state, *make_kkt(problem), problem);
}

void factor(benchmark::State& state, const OwnedProblem& owned) {
  const ScaledProblem problem = scaled(owned);
  const auto kkt = make_kkt(problem);
  const RowWeights weights = weights_of(problem);
  for (auto _ : state) {
    if (!kkt->factor(weights)) state.SkipWithError("the factorization failed");
  }
  label(state, *kkt, problem);
}

void solve_with_factors(benchmark::State& state, const OwnedProblem& owned) {
  const ScaledProblem problem = scaled(owned);
  const auto kkt = make_kkt(problem);
  if (!kkt->factor(weights_of(problem))) state.SkipWithError("the factorization failed");
  const Vector f = Vector::Ones(problem.variables()), h = Vector::Ones(problem.equalities());
  Vector x = f, y = h;
  for (auto _ : state) {
    x = f;
    y = h;
    benchmark::DoNotOptimize(kkt->solve(x, y));
  }
  label(state, *kkt, problem);
}

void BM_AnalyseHopper(benchmark::State& state) { analyse(state, micro::hopper(state.range(0))); }
BENCHMARK(BM_AnalyseHopper)->ArgName("steps")->Arg(10)->Arg(60)->Unit(benchmark::kMicrosecond);
void BM_FactorHopper(benchmark::State& state) { factor(state, micro::hopper(state.range(0))); }
BENCHMARK(BM_FactorHopper)->ArgName("steps")->Arg(10)->Arg(60)->Unit(benchmark::kMicrosecond);
void BM_FactorQpec(benchmark::State& state) { factor(state, micro::qpec(state.range(0))); }
BENCHMARK(BM_FactorQpec)->ArgName("variables")->Arg(50)->Arg(200)->Unit(benchmark::kMicrosecond);
void BM_SolveWithFactorsHopper(benchmark::State& state) {
  solve_with_factors(state, micro::hopper(state.range(0)));
}
BENCHMARK(BM_SolveWithFactorsHopper)->ArgName("steps")->Arg(10)->Arg(60)->Unit(benchmark::kMicrosecond);
void BM_SolveWithFactorsQpec(benchmark::State& state) {
  solve_with_factors(state, micro::qpec(state.range(0)));
}
BENCHMARK(BM_SolveWithFactorsQpec)->ArgName("variables")->Arg(50)->Arg(200)->Unit(benchmark::kMicrosecond);

}  // namespace
