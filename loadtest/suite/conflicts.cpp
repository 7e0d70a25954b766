// Checks planted conflicts: option explain must find parts that contradict each other, and no more than
// needed.
#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "families.h"
#include "support/conflict_check.h"
#include "support/planted_conflict.h"

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
