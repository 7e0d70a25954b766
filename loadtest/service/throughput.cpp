// Measures two workers with four clients against two threads in process, in turns.
#include <cstdio>

#include "bench.h"
#include "closed_loop.h"
#include "marble/examples.h"

namespace marble::bench {
namespace {

constexpr int kCores = 2;  // workers, threads, and the cores that both sides may use
constexpr int kClients = 4;
constexpr int kRounds = 12;
constexpr std::chrono::milliseconds kBlock{1500};

}  // namespace

void throughput() {
  const testing::ServerProcess server = start_server({"--workers", std::to_string(kCores)});
  for (const int steps : {60, 10}) {
    examples::HopperParameters parameters;
    parameters.steps = steps;
    const OwnedProblem problem = examples::hopper(parameters);
    RemoteLoop loop(server.address(), problem, kClients);
    static_cast<void>(loop.run(kBlock));
    std::vector<double> remote, raw, local, server_cpu, own_cpu, local_cpu;
    for (int round = 0; round < kRounds; ++round) {
      const Block there = loop.run(kBlock);
      const Block here = run_in_process(problem, kCores, kBlock);
      raw.push_back(there.solves_per_s());
      remote.push_back(there.accounted_solves_per_s(kCores));
      local.push_back(here.solves_per_s());
      server_cpu.push_back(there.server_cpu_per_solve_s());
      own_cpu.push_back(there.own_cpu_per_solve_s());
      local_cpu.push_back(here.own_cpu_per_solve_s());
    }
    std::printf(
        "hopper, %d steps, %d rounds: %.1f solves/s there (%.1f with the load's CPU given back), %.1f here; "
        "CPU "
        "ms a solve: server %.3f, load %.3f, here %.3f\n",
        steps, kRounds, median(raw), median(remote), median(local), 1e3 * median(server_cpu),
        1e3 * median(own_cpu), 1e3 * median(local_cpu));
    const std::string name = "hopper of " + std::to_string(steps) + " steps, two workers, four clients: ";
    const std::string detail = "medians of " + std::to_string(kRounds) + " pairs of blocks in turns";
    report(
        {name + "solves a second over two threads here", median(ratios(remote, local)), 0.95, false, detail});
    report(
        {name + "server CPU a solve over here", median(ratios(server_cpu, local_cpu)), 1.05, true, detail});
  }
  std::printf("\n");
}

}  // namespace marble::bench
