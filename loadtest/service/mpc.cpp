#include <cstdio>

#include "bench.h"
#include "marble/convert.h"
#include "marble/examples.h"

namespace marble::bench {
namespace {

constexpr int kTicks = 50;

// Measurements of one way to solve the control steps.
struct Column {
  std::vector<double> factorizations, solve_ms, round_trip_ms, overhead_ms;
  int wrong = 0;

  void add(const v1::Solution& solution, double round_trip, bool right) {
    const double solve = 1e3 * solution.times().solve_s();
    factorizations.push_back(solution.factorizations());
    solve_ms.push_back(solve);
    round_trip_ms.push_back(round_trip);
    overhead_ms.push_back(round_trip - solve);
    wrong += right ? 0 : 1;
  }
  void print(const char* name) const {
    std::printf("%-14s %6.0f %6.0f %10.2f %10.2f %10.2f %10.2f %10.2f %10.2f %6d\n", name,
                median(factorizations), worst(factorizations), median(solve_ms), worst(solve_ms),
                median(round_trip_ms), worst(round_trip_ms), median(overhead_ms), worst(overhead_ms), wrong);
  }
};

}  // namespace

void mpc() {
  testing::ServerProcess server = start_server({"--workers", "1"});
  examples::HopperParameters parameters;
  OwnedProblem problem = examples::hopper(parameters);
  const auto channel = connect(server.address());
  Session session(channel, setup_of(problem));
  const auto stub = v1::Solver::NewStub(connect(server.address()));
  Solution plan = solution_of(session.solve({}));
  Column warm, cold;
  for (int tick = 0; tick < kTicks; ++tick) {
    parameters = examples::advance(parameters, plan.z);
    problem = examples::hopper(parameters);

    const v1::SessionUpdate update = next_tick(problem, parameters.steps);
    auto begin = Clock::now();
    const v1::Solution answer = session.solve(update);
    const double warm_ms = ms_since(begin);  // before the check, which takes time
    warm.add(answer, warm_ms, is_right(problem, answer));
    plan = solution_of(answer);

    v1::SolveRequest request;
    to_message(problem.view(), request.mutable_problem());
    grpc::ClientContext context;
    v1::SolveResponse response;
    begin = Clock::now();
    must(stub->Solve(&context, request, &response), "solve");
    const double cold_ms = ms_since(begin);
    cold.add(response.solution(), cold_ms, is_right(problem, response.solution()));
  }
  std::printf(
      "hopper, %d steps: n = %zu, n_e = %zu, n_i = %zu, n_c = %zu; %d ticks, closed loop; set up in %.2f "
      "ms\n",
      parameters.steps, problem.g.size(), problem.b.size(), problem.d.size(), problem.l.size(), kTicks,
      1e3 * session.ready().setup_s());
  std::printf("%-14s %13s %21s %21s %21s %6s\n", "", "factorizations", "solve, ms", "round trip, ms",
              "beside the solve, ms", "wrong");
  std::printf("%-14s %6s %6s %10s %10s %10s %10s %10s %10s\n", "", "median", "worst", "median", "worst",
              "median", "worst", "median", "worst");
  warm.print("session, warm");
  cold.print("unary, cold");
  std::printf("(beside a unary solve: its set-up too)\n\n");
}

}  // namespace marble::bench
