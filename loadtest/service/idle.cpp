#include <cstdio>
#include <fstream>

#include "bench.h"
#include "marble/convert.h"
#include "marble/examples.h"

namespace marble::bench {
namespace {

constexpr int kSessions = 200;
constexpr int kSteps = 10;
constexpr int kSolves = 20;

double resident_kib(pid_t pid) {
  std::ifstream file("/proc/" + std::to_string(pid) + "/status");
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("VmRSS:")) return std::stod(line.substr(6));
  }
  return 0.0;
}

std::vector<double> solve_ms(v1::Solver::Stub& stub, const OwnedProblem& problem) {
  std::vector<double> result;
  v1::SolveRequest request;
  to_message(problem.view(), request.mutable_problem());
  for (int i = 0; i < kSolves; ++i) {
    grpc::ClientContext context;
    v1::SolveResponse response;
    const auto begin = Clock::now();
    must(stub.Solve(&context, request, &response), "solve");
    result.push_back(ms_since(begin));
    must(is_right(problem, response.solution()), "a wrong answer");
  }
  return result;
}

}  // namespace

void idle() {
  testing::ServerProcess server = start_server({"--workers", "2", "--client-sessions", "0"});
  examples::HopperParameters parameters;
  const OwnedProblem large = examples::hopper(parameters);
  parameters.steps = kSteps;
  const OwnedProblem small = examples::hopper(parameters);
  const auto channel = connect(server.address());
  const auto stub = v1::Solver::NewStub(connect(server.address()));
  const std::vector<double> alone_ms = solve_ms(*stub, large);  // also warms the server up

  const double before = resident_kib(server.pid());
  std::vector<double> open_ms;
  std::vector<std::unique_ptr<Session>> sessions;
  for (int i = 0; i < kSessions; ++i) {
    const auto begin = Clock::now();
    sessions.push_back(std::make_unique<Session>(channel, setup_of(small)));
    open_ms.push_back(ms_since(begin));
  }
  const double open = resident_kib(server.pid());
  for (const auto& session : sessions) must(is_right(small, session->solve({})), "a wrong answer");
  const double used = resident_kib(server.pid());
  const std::vector<double> beside_ms = solve_ms(*stub, large);

  std::printf("%d sessions of a hopper of %d steps: n = %zu, n_c = %zu\n", kSessions, kSteps, small.g.size(),
              small.l.size());
  std::printf("reported memory      %8.1f KiB a session\n",
              static_cast<double>(sessions.front()->ready().memory_bytes()) / 1024.0);
  std::printf("resident, opened %8.1f KiB a session\n", (open - before) / kSessions);
  std::printf("resident, used   %8.1f KiB a session, after one solve each\n", (used - before) / kSessions);
  std::printf("open and set up  %8.2f ms median, %.2f ms worst\n", median(open_ms), worst(open_ms));
  std::printf(
      "a solve of %d steps, round trip: %.2f ms median, %.2f ms p90 before; %.2f ms, %.2f ms beside them\n\n",
      60, median(alone_ms), quantile(alone_ms, 0.9), median(beside_ms), quantile(beside_ms, 0.9));
}

}  // namespace marble::bench
