// Measures the path of a request from bytes to a validated problem, and of its solution back.
#include <benchmark/benchmark.h>

#include "base/wire.h"
#include "marble/convert.h"
#include "marble/solver.h"
#include "marble/v1/service.pb.h"
#include "problems.h"

namespace {

using namespace marble;

v1::SolveRequest request_of(const OwnedProblem& problem) {
  v1::SolveRequest request;
  to_message(problem.view(), request.mutable_problem());
  to_message(Options{}, request.mutable_options());
  return request;
}

void count_bytes(benchmark::State& state, std::size_t bytes) {
  state.counters["bytes"] = static_cast<double>(bytes);
  state.SetBytesProcessed(state.iterations() * static_cast<std::int64_t>(bytes));
}

// The client's part.
void BM_EncodeRequest(benchmark::State& state) {
  const OwnedProblem problem = micro::hopper(state.range(0));
  std::size_t bytes = 0;
  for (auto _ : state) bytes = server::serialize(request_of(problem)).Length();
  count_bytes(state, bytes);
}
BENCHMARK(BM_EncodeRequest)
    ->ArgName("hopper_steps")
    ->Arg(1)
    ->Arg(10)
    ->Arg(60)
    ->Arg(480)
    ->Unit(benchmark::kMicrosecond);

// The server's part.
void BM_ParseAndValidate(benchmark::State& state) {
  const grpc::ByteBuffer bytes = server::serialize(request_of(micro::hopper(state.range(0))));
  for (auto _ : state) {
    grpc::ByteBuffer own = bytes;
    v1::SolveRequest request;
    if (!server::parse(&own, &request)) state.SkipWithError("does not parse");
    benchmark::DoNotOptimize(Problem::create(view_of(request.problem())));
  }
  count_bytes(state, bytes.Length());
}
BENCHMARK(BM_ParseAndValidate)
    ->ArgName("hopper_steps")
    ->Arg(1)
    ->Arg(10)
    ->Arg(60)
    ->Arg(480)
    ->Unit(benchmark::kMicrosecond);

void BM_ValidateAlone(benchmark::State& state) {
  const OwnedProblem problem = micro::hopper(state.range(0));
  for (auto _ : state) benchmark::DoNotOptimize(Problem::create(problem.view()));
}
BENCHMARK(BM_ValidateAlone)->ArgName("hopper_steps")->Arg(1)->Arg(60)->Unit(benchmark::kMicrosecond);

void BM_EncodeAnswer(benchmark::State& state) {
  const OwnedProblem problem = micro::hopper(state.range(0));
  const Solution solution = solve_in_process(problem.view(), {.max_local_search_factorizations = 0}).value();
  std::size_t bytes = 0;
  for (auto _ : state) {
    v1::SolveResponse response;
    to_message(solution, response.mutable_solution());
    bytes = server::serialize(response).Length();
  }
  count_bytes(state, bytes);
}
BENCHMARK(BM_EncodeAnswer)->ArgName("hopper_steps")->Arg(1)->Arg(60)->Unit(benchmark::kMicrosecond);

}  // namespace
