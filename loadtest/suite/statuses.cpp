#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>
#include <string>
#include <vector>

#include "families.h"
#include "support/brute_force.h"
#include "support/conflict_check.h"
#include "support/ill_conditioned.h"
#include "support/independent_check.h"
#include "support/integer_problem.h"

// Checks the reported statuses: random problems of small integers against an enumeration of all branches, and
// ill-conditioned complementarity problems that have a solution.
namespace marble::suite {
namespace {

struct Tally {
  int status = 0, optimum = 0, stationary = 0, proved = 0, bounds = 0, solved = 0;
  std::vector<double> factorizations;
};

double tolerance(double objective) { return 1e-6 * std::max(1.0, std::abs(objective)); }

void count(const OwnedProblem& p, const std::optional<testing::GlobalOptimum>& truth, bool global, Tally& t) {
  Options options;
  options.global_search = global;
  const Solution s = solve_in_process(p.view(), options).value();
  t.factorizations.push_back(s.factorizations);
  const bool feasible = !is_solved(s.status) || testing::judge(p.view(), s).infeasibility() <= 1e-6;
  t.status += s.status == testing::true_status(truth) && feasible;
  t.proved += s.proved;
  const double optimum = !truth ? INFINITY : truth->objective;
  t.bounds += s.bound <= optimum + (std::isfinite(optimum) ? tolerance(optimum) : 0.0);
  if (s.status != Status::solved) return;
  ++t.solved;
  t.optimum += s.objective <= optimum + tolerance(optimum);
  t.stationary += s.b_stationary.value_or(false);
}

// Odd seeds are for tuning, even ones for judging.
std::uint64_t seed_of(int i, bool judging) { return 2 * static_cast<std::uint64_t>(i) + (judging ? 2 : 1); }

void integers(const Settings& settings) {
  std::printf("%-12s %-7s %8s %8s %8s %8s %12s %8s %8s %13s %6s\n", "integers", "mode", "problems", "status",
              "solved", "optimum", "B-stationary", "bound", "proved", "factorizations", "worst");
  for (const testing::IntegerFamily family : testing::kIntegerFamilies) {
    Tally tallies[2];
    for (int i = 0; i < settings.seeds; ++i) {
      const OwnedProblem p = testing::integer_problem(family, seed_of(i, settings.judging));
      const auto truth = testing::brute_force(p.view());
      for (const bool global : {false, true}) count(p, truth, global, tallies[global]);
    }
    for (const bool global : {false, true}) {
      const Tally& t = tallies[global];
      std::printf("%-12s %-7s %8d %8d %8d %8d %12d %8d %8d %13.0f %6.0f\n",
                  std::string(testing::name(family)).c_str(), global ? "global_search" : "default",
                  settings.seeds, t.status, t.solved, t.optimum, t.stationary, t.bounds, t.proved,
                  median(t.factorizations), *std::ranges::max_element(t.factorizations));
    }
  }
}

void ill_conditioned(const Settings& settings) {
  std::printf("%-12s %-9s %8s %8s %8s %8s %13s %6s\n", "LCPs", "smallest", "problems", "solved", "refuted",
              "wrong", "factorizations", "worst");
  for (const bool far : {false, true}) {
    for (const double smallest : {1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12}) {
      int solved = 0, refuted = 0, wrong = 0;
      std::vector<double> factorizations;
      for (int i = 0; i < settings.seeds; ++i) {
        const OwnedProblem p = testing::ill_conditioned_lcp(smallest, seed_of(i, settings.judging), far);
        const Solution s = solve_in_process(p.view(), {}).value();
        factorizations.push_back(s.factorizations);
        solved += s.status == Status::solved;
        refuted += s.status == Status::infeasible || s.status == Status::unbounded;
        wrong += s.status == Status::solved && testing::judge(p.view(), s).infeasibility() > 1e-6;
      }
      std::printf("%-12s %-9.0e %8d %8d %8d %8d %13.0f %6.0f\n", far ? "far" : "near", smallest,
                  settings.seeds, solved, refuted, wrong, median(factorizations),
                  *std::ranges::max_element(factorizations));
    }
  }
}

}  // namespace

void statuses(const Settings& settings) {
  integers(settings);
  ill_conditioned(settings);
}

}  // namespace marble::suite

// Checks planted conflicts: option explain must find parts that contradict each other, and no more than
// needed.
namespace marble::suite {
namespace {

const char* name_of(testing::Plant plant) {
  switch (plant) {
    case testing::Plant::inequalities:
      return "inequalities";
    case testing::Plant::equalities:
      return "equalities";
    case testing::Plant::sides:
      return "sides of pairs";
    case testing::Plant::subset_sum:
      return "subset sum";
    case testing::Plant::subset_band:
      return "subset band";
    case testing::Plant::budgets:
      break;
  }
  return "budgets";
}

}  // namespace

void conflicts(const Settings& settings) {
  std::printf("%-15s %8s %8s %8s %8s %10s %13s %6s\n", "planted", "problems", "found", "true", "minimal",
              "mean parts", "factorizations", "worst");
  for (const testing::Plant plant : testing::kPlants) {
    int found = 0, valid = 0, minimal = 0;
    double parts = 0.0;
    std::vector<double> factorizations;
    for (int i = 0; i < settings.seeds; ++i) {
      const std::uint64_t seed = 2 * static_cast<std::uint64_t>(i) + (settings.judging ? 2 : 1);
      const OwnedProblem p = testing::planted_conflict(plant, seed);
      const Solution s = solve_in_process(p.view(), {.explain = true}).value();
      factorizations.push_back(s.factorizations);
      if (!s.conflict) continue;
      ++found;
      parts += static_cast<double>(s.conflict->size());
      if (s.conflict->complementarities.size() > 12) continue;  // too many to enumerate
      valid += !testing::have_point(p.view(), *s.conflict);
      minimal += s.conflict->minimal && testing::is_irreducible(p.view(), *s.conflict);
    }
    std::printf("%-15s %8d %8d %8d %8d %10.1f %13.0f %6.0f\n", name_of(plant), settings.seeds, found, valid,
                minimal, parts / std::max(1, found), median(factorizations),
                *std::ranges::max_element(factorizations));
  }
}

}  // namespace marble::suite
