// How far branch and bound proves the known problems, and what a node costs.
#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "families.h"
#include "marble/examples.h"
#include "marble/solver.h"
#include "support/problems/shared_problems.h"

namespace marble::suite {
namespace {

struct Named {
  std::string name;
  OwnedProblem problem;
};

std::vector<Named> with_proofs(const Settings& settings) {
  std::vector<Named> problems;
  for (const auto& file : problem_files(settings.benchmarks / "macmpec"))
    problems.push_back({file.stem(), testing::read_shared(file).problem});
  examples::HopperParameters hopper;
  hopper.steps = 10;
  problems.push_back({"hopper 10", examples::hopper(hopper)});
  problems.push_back({"rocket", examples::rocket()});
  problems.push_back({"gates", examples::gates()});
  problems.push_back({"qpec", examples::qpec({}, 0)});
  problems.push_back({"hopper 60", examples::hopper()});
  return problems;
}

}  // namespace

void global(const Settings& settings) {
  std::printf("%-12s %-16s %6s %14s %14s %9s %9s %7s %9s %9s %8s\n", "problem", "status", "proved",
              "objective", "bound", "gap", "nodes", "open", "s", "s/node", "factors");
  int proved = 0;
  double seconds = 0.0;
  for (const Named& named : with_proofs(settings)) {
    if (!settings.only.empty() && named.name != settings.only) continue;
    Options options;
    options.global = true;
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
    proved += s.proved ? 1 : 0;
    seconds += took;
  }
  std::printf("%d proved, %.1f s\n", proved, seconds);
}

}  // namespace marble::suite
