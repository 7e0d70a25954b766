// The kinds of answers in words, and spent budgets: the tables of cases that all languages have.
#include <gtest/gtest.h>

#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>

#include "marble/options.h"
#include "marble/report/solution_kind.h"

namespace marble {
namespace {

using Json = nlohmann::json;

template <class Enum>
Enum named(const std::string& name, int most) {
  for (int value = 0; value <= most; ++value)
    if (name == to_string(static_cast<Enum>(value))) return static_cast<Enum>(value);
  ADD_FAILURE() << name;
  return {};
}

SolutionFacts facts_of(const Json& json) {
  SolutionFacts facts;
  facts.status = named<Status>(json["status"], static_cast<int>(Status::numerical_failure));
  facts.proved = json.value("proved", false);
  if (json.contains("b_stationary")) facts.b_stationary = json["b_stationary"].get<bool>();
  facts.second_order =
      named<SecondOrder>(json.value("second_order", "unknown"), static_cast<int>(SecondOrder::convex));
  facts.objective = json.value("objective", 0.0);
  facts.gap = json.value("gap", std::numeric_limits<double>::infinity());
  facts.feasible = json["feasible"];
  facts.pairs = json["pairs"];
  facts.factorizations = json["factorizations"];
  facts.budget_spent = json.value("budget_spent", false);
  facts.starts = json.value("starts", 1);
  facts.global_search = json.value("global_search", false);
  return facts;
}

TEST(SolutionKinds, FollowTheTableOfCases) {
  const Json cases = Json::parse(std::ifstream(ANSWERS "/kinds.json"));
  std::set<SolutionKind> met;
  for (const Json& entry : cases) {
    const SolutionFacts facts = facts_of(entry["facts"]);
    EXPECT_EQ(to_string(kind_of(facts)), entry["kind"]) << entry;
    EXPECT_EQ(kind_text(facts), entry["text"]) << entry;
    EXPECT_EQ(what_to_try(facts), entry["what_to_try"]) << entry;
    met.insert(kind_of(facts));
  }
  EXPECT_EQ(met.size(), static_cast<std::size_t>(SolutionKind::failed) + 1) << "every kind has a case";
}

TEST(SolutionKinds, AMaximumIsCalledOne) {
  SolutionFacts facts{.status = Status::solved, .second_order = SecondOrder::minimum, .pairs = 3};
  facts.maximize = true;
  EXPECT_EQ(kind_text(facts), "local maximum; no bound is known");
}

TEST(SolutionKinds, ABudgetIsSpentAsTheTableOfCasesSays) {
  for (const Json& entry : Json::parse(std::ifstream(ANSWERS "/budgets.json"))) {
    Options options;
    for (const auto& [name, value] : entry["options"].items()) {
      ASSERT_TRUE(set_option(options, name, value.get<double>())) << entry;
    }
    Solution solution;
    solution.status = Status::solved;
    solution.second_order = SecondOrder::necessary;
    solution.factorizations = entry["factorizations"];
    solution.detail = entry["detail"];
    const SolutionFacts facts = facts_of(solution, options);
    EXPECT_EQ(facts.budget_spent, entry["spent"].get<bool>()) << entry;
    const std::string advice = what_to_try(facts);
    EXPECT_EQ(advice.find("max_local_search_factorizations") != std::string::npos, facts.budget_spent);
    EXPECT_NE(advice.find("num_starts="), std::string::npos) << advice;
  }
}

TEST(SolutionKinds, AStoppedSolveIsFeasibleByTheTolerancesOfItsOwnOptions) {
  Solution solution;
  solution.status = Status::time_limit;
  solution.violations.equality = 1e-4;
  Options options;
  EXPECT_EQ(kind_of(facts_of(solution, options)), SolutionKind::stopped_infeasible);
  options.equality_tolerance = 1e-3;
  EXPECT_EQ(kind_of(facts_of(solution, options)), SolutionKind::stopped_feasible);
}

}  // namespace
}  // namespace marble
