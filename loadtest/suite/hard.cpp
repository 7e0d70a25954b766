#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <string>
#include <vector>

#include "families.h"
#include "hard_families.h"

namespace marble::suite {
namespace {

struct Tally {
  int problems = 0, solved = 0, wrong = 0;
  std::map<std::string, int> unsolved;  // by status
  std::vector<double> factorizations, milliseconds;
  double lowest_sum = 0.0;
};

// True if an independent check or the construction of the problem contradicts the status.
bool is_wrong(const Record& r, const HardProblem& problem) {
  if (is_solved(r.status)) return problem.proof || r.violation > 1e-6;
  const bool claims_proof = r.status == Status::infeasible || r.status == Status::unbounded;
  return claims_proof && problem.proof != r.status;
}

}  // namespace

void hard(const Settings& settings) {
  std::vector<std::string> order;
  std::map<std::string, Tally> tallies;
  for (const HardProblem& problem : hard_problems(settings.seeds, settings.judging)) {
    Tally& tally = tallies[problem.family];
    if (tally.problems++ == 0) order.push_back(problem.family);
    const Record r = solve_and_judge(problem.family, problem.problem, {}, 0.0);
    const bool wrong = is_wrong(r, problem);
    const double optimum = problem.optimum.value_or(r.objective);
    const bool best = std::abs(r.objective - optimum) <= 1e-6 * std::max(1.0, std::abs(optimum));
    const bool solved = problem.proof ? r.status == problem.proof : is_solved(r.status) && !wrong && best;
    tally.solved += solved;
    tally.wrong += wrong;
    if (!solved) ++tally.unsolved[to_string(r.status)];
    if (solved && !problem.proof) tally.lowest_sum += r.objective;
    tally.factorizations.push_back(r.factorizations);
    tally.milliseconds.push_back(r.milliseconds);
  }
  std::printf("%-18s %8s %6s %6s %13s %6s %10s %10s %16s  %s\n", "family", "problems", "solved", "wrong",
              "factorizations", "worst", "ms", "worst", "mean objective", "else");
  for (const std::string& family : order) {
    const Tally& tally = tallies[family];
    std::string rest;
    for (const auto& [status, count] : tally.unsolved)
      rest += (rest.empty() ? "" : ", ") + std::to_string(count) + " " + status;
    std::printf("%-18s %8d %6d %6d %13.0f %6.0f %10.3f %10.3f %16.9g  %s\n", family.c_str(), tally.problems,
                tally.solved, tally.wrong, median(tally.factorizations),
                *std::ranges::max_element(tally.factorizations), median(tally.milliseconds),
                *std::ranges::max_element(tally.milliseconds), tally.lowest_sum / std::max(1, tally.solved),
                rest.c_str());
  }
  std::printf("\n");
}

}  // namespace marble::suite
