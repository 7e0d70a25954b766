// Solves the same problems in other units: of all variables, of each, of rows, of the cost.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "families.h"
#include "marble/macmpec.h"
#include "noise.h"
#include "support/independent_check.h"
#include "support/other_units.h"

namespace marble::suite {
namespace {

struct Case {
  std::string name;
  testing::OtherUnits units = {};
};

}  // namespace

void units(const Settings& settings) {
  const auto power = [](double exponent) { return [=] { return std::pow(10.0, exponent); }; };
  std::vector<Case> all;
  for (int k = -8; k <= 8; ++k) all.push_back({"z = 1e" + std::to_string(k) + " z'", {power(k)}});
  for (const int k : {-8, 8}) {
    all.push_back({"rows x 1e" + std::to_string(k), {power(0), power(k)}});
    all.push_back({"cost x 1e" + std::to_string(k), {power(0), power(0), std::pow(10.0, k)}});
  }
  Noise noise(1);
  for (int seed = 1; seed <= settings.seeds; ++seed) {
    const auto random = [&noise] { return std::pow(10.0, 4.0 * noise.uniform()); };
    all.push_back({"variables x 1e+-4 ~" + std::to_string(seed), {random}});
    all.push_back({"rows x 1e+-4 ~" + std::to_string(seed), {power(0), random}});
  }
  std::printf("%-24s %8s %8s %8s  %s\n", "units", "right", "median", "worst", "not right");
  for (const auto& [name, units] : all) {
    std::vector<double> factorizations;
    std::string wrong;
    std::size_t right = 0;
    for (const examples::MacmpecProblem& each : examples::macmpec()) {
      const OwnedProblem nominal = each.problem();
      const auto [problem, variables] = testing::convert(nominal, units);
      Solution answer = solve_in_process(problem.view()).value();
      factorizations.push_back(answer.factorizations);
      for (std::size_t j = 0; j < variables.size(); ++j) answer.z[j] *= variables[j];
      const double loss =
          (answer.objective / units.cost - each.optimum) / std::max(1.0, std::abs(each.optimum));
      const bool is_right = is_solved(answer.status) && loss <= 1e-5 &&
                            testing::judge(nominal.view(), answer).infeasibility() <= 1e-6;
      right += is_right ? 1 : 0;
      if (!is_right) wrong.append(" ").append(each.name);
    }
    std::printf("%-24s %5zu/%zu %8.0f %8.0f %s\n", name.c_str(), right, examples::macmpec().size(),
                median(factorizations), *std::ranges::max_element(factorizations), wrong.c_str());
    std::fflush(stdout);
  }
}

}  // namespace marble::suite
