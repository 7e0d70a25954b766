// Measures how far branch and bound proves the known problems, and the cost of a node; compares with other
// solvers, if requested; and measures how often the local solution is the global one.
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "families.h"
#include "marble/examples.h"
#include "marble/macmpec.h"
#include "marble/solver.h"
#include "peers.h"
#include "support/box_qp.h"

namespace marble::suite {
namespace {

constexpr double kSame = 1e-5;           // of the objective: counts as the same solution
constexpr double kSmallProblems_s = 20;  // of a proof, of the families

struct Named {
  std::string name;
  OwnedProblem problem;
  bool small = false;  // of a test set: no other solver is run
};

std::vector<Named> with_proofs() {
  std::vector<Named> problems;
  for (const examples::MacmpecProblem& each : examples::macmpec())
    problems.push_back({std::string(each.name), each.problem(), true});
  examples::HopperParameters hopper;
  hopper.steps = 10;
  problems.push_back({"hopper 10", examples::hopper(hopper)});
  problems.push_back({"rocket", examples::rocket()});
  problems.push_back({"gates", examples::gates()});
  problems.push_back({"qpec", examples::qpec({}, 0)});
  problems.push_back({"hopper 60", examples::hopper()});
  return problems;
}

// Prints the results of other solvers in the same time, a line each.
void ask_peers(const Settings& settings, const Named& named) {
  const std::string file =
      std::filesystem::temp_directory_path() / ("marble-global-" + std::to_string(getpid()));
  write_json(named.problem, file);
  const std::string command = settings.peers + " " + file + " " + std::to_string(settings.time_limit_s);
  {
    const std::unique_ptr<std::FILE, int (*)(std::FILE*)> said(popen(command.c_str(), "r"), pclose);
    char name[32], status[64];
    double seconds = 0.0, objective = 0.0, bound = 0.0, nodes = 0.0;
    while (said && std::fscanf(said.get(), "%31s %lf %lf %lf %lf %63s", name, &seconds, &objective, &bound,
                               &nodes, status) == 6) {
      const double gap = std::max(0.0, objective - bound) / std::max(1.0, std::abs(objective));
      std::printf("  %-10s %-23.23s %14.9g %14.9g %9.1e %9.0f %17.4f\n", name, status, objective, bound, gap,
                  nodes, seconds);
    }
  }
  std::filesystem::remove(file);
}

// A family's problems, and their known values.
struct Family {
  const char* name;
  std::function<OwnedProblem(std::uint64_t)> make;
};

std::vector<Family> families() {
  using namespace examples;
  HopperParameters hops;
  hops.steps = 8;
  GatesParameters flight;
  flight.steps = 26;
  flight.gates.resize(2);
  return {{"hopper, 8 steps", [=](std::uint64_t seed) { return hopper(vary(hops, seed)); }},
          {"gates, 26 steps, 2 gates", [=](std::uint64_t seed) { return gates(vary(flight, seed)); }},
          {"qpec, 10 + 20 variables",
           [](std::uint64_t seed) {
             return qpec({10, 20, 4, 2}, seed);
           }},
          {"qpec, 10 + 40 variables",
           [](std::uint64_t seed) {
             return qpec({10, 40, 4, 4}, seed);
           }},
          {"box QP, 15 variables", [](std::uint64_t seed) { return testing::box_qp(15, seed); }},
          {"box QP, 20 variables", [](std::uint64_t seed) { return testing::box_qp(20, seed); }}};
}

// Compares local solutions, with one start and with several, with proved ones.
void local_against_proved(const Settings& settings) {
  std::printf("\n%-26s %7s %7s %8s %10s %10s %9s %10s\n", "family", "proved", "of", "global", "median",
              "worst", "num_starts=", "global");
  for (const Family& family : families()) {
    int proved = 0, global = 0, global_with_starts = 0;
    std::vector<double> excess;
    for (int seed = 1; seed <= settings.seeds; ++seed) {
      const OwnedProblem p = family.make(static_cast<std::uint64_t>(seed));
      Options options;
      const auto local = solve_in_process(p.view(), options);
      options.num_starts = settings.starts;
      const auto more = solve_in_process(p.view(), options);
      options = {};
      options.global_search = true;
      options.time_limit_s = kSmallProblems_s;
      const auto best = solve_in_process(p.view(), options);
      if (!local || !more || !best || !best->proved || best->status != Status::solved) continue;
      ++proved;
      const auto above = [&](const Solution& s) {
        return is_solved(s.status)
                   ? (s.objective - best->objective) / std::max(1.0, std::abs(best->objective))
                   : HUGE_VAL;
      };
      if (above(*local) <= kSame) {
        ++global;
      } else {
        excess.push_back(above(*local));
      }
      global_with_starts += above(*more) <= kSame ? 1 : 0;
    }
    std::ranges::sort(excess);
    std::printf("%-26s %7d %7d %8d %10.2g %10.2g %9d %10d\n", family.name, proved, settings.seeds, global,
                excess.empty() ? 0.0 : excess[excess.size() / 2], excess.empty() ? 0.0 : excess.back(),
                settings.starts, global_with_starts);
    std::fflush(stdout);
  }
}

}  // namespace

void global(const Settings& settings) {
  std::printf("%-12s %-16s %6s %14s %14s %9s %9s %7s %9s %9s %8s\n", "problem", "status", "proved",
              "objective", "bound", "gap", "nodes", "open", "s", "s/node", "factors");
  int proved = 0;
  double seconds = 0.0;
  for (const Named& named : with_proofs()) {
    if (!settings.only.empty() && named.name != settings.only) continue;
    Options options;
    options.global_search = true;
    options.time_limit_s = settings.time_limit_s;
    const auto solution = solve_in_process(named.problem.view(), options);
    if (!solution) {
      std::printf("%-12s %s\n", named.name.c_str(), solution.error().field.c_str());
      continue;
    }
    const Solution& s = *solution;
    const double took = s.times.setup_s + s.times.solve_s;
    std::printf("%-12s %-16s %6s %14.9g %14.9g %9.1e %9lld %7lld %9.4f %9.2e %8d\n", named.name.c_str(),
                to_string(s.status), s.proved ? "yes" : "no", s.objective, s.bound, s.gap,
                static_cast<long long>(s.nodes), static_cast<long long>(s.open_nodes), took,
                took / static_cast<double>(std::max<std::int64_t>(s.nodes, 1)), s.factorizations);
    std::fflush(stdout);
    if (!settings.peers.empty() && !named.small) ask_peers(settings, named);
    proved += s.proved ? 1 : 0;
    seconds += took;
  }
  std::printf("%d proved, %.1f s\n", proved, seconds);
  if (settings.only.empty()) local_against_proved(settings);
}

}  // namespace marble::suite
