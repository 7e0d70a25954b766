#include "closed_loop.h"

#include <atomic>
#include <thread>

#include "marble/convert.h"
#include "marble/solver.h"

namespace marble::bench {

double server_cpu_s(v1::Server::Stub& server) {
  grpc::ClientContext context;
  v1::GetInfoResponse response;
  must(server.GetInfo(&context, {}, &response), "GetInfo");
  return response.counters().cpu_s_total();
}

std::vector<double> ratios(const std::vector<double>& values, const std::vector<double>& to) {
  std::vector<double> result;
  for (std::size_t i = 0; i < values.size(); ++i) result.push_back(values[i] / to[i]);
  return result;
}

RemoteLoop::RemoteLoop(const std::string& address, const OwnedProblem& problem, int clients)
    : problem_(problem),
      clients_(clients),
      stub_(v1::Solver::NewStub(connect(address))),
      info_(v1::Server::NewStub(connect(address))) {
  to_message(problem.view(), request_.mutable_problem());
}

Block RemoteLoop::run(std::chrono::milliseconds time) {
  std::atomic<int> solves = 0;
  const double server_before = server_cpu_s(*info_), own_before = own_cpu_s();
  const auto begin = Clock::now();
  {
    std::vector<std::jthread> clients;
    clients.reserve(static_cast<std::size_t>(clients_));
    for (int i = 0; i < clients_; ++i) clients.emplace_back([&] { ask(begin + time, solves); });
  }
  const double seconds = 1e-3 * ms_since(begin);
  const double own = own_cpu_s() - own_before;
  return {seconds, solves, server_cpu_s(*info_) - server_before, own};
}

void RemoteLoop::ask(Clock::time_point end, std::atomic<int>& solves) {
  v1::SolveResponse response;
  while (Clock::now() < end) {
    grpc::ClientContext context;
    must(stub_->Solve(&context, request_, &response), "solve");
    ++solves;
  }
  must(is_right(problem_, response.solution()), "a wrong answer");
}

Block run_in_process(const OwnedProblem& problem, int threads, std::chrono::milliseconds time) {
  std::atomic<int> solves = 0;
  const double own_before = own_cpu_s();
  const auto begin = Clock::now();
  {
    std::vector<std::jthread> workers;
    workers.reserve(static_cast<std::size_t>(threads));
    for (int i = 0; i < threads; ++i) {
      workers.emplace_back([&] {
        while (Clock::now() < begin + time) {
          must(is_solved(solve_in_process(problem.view())->status), "a problem was not solved here");
          ++solves;
        }
      });
    }
  }
  const double seconds = 1e-3 * ms_since(begin);
  return {seconds, solves, 0.0, own_cpu_s() - own_before};
}

}  // namespace marble::bench
