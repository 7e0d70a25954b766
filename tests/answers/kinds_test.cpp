// The kinds of answers in words: the table of cases that all languages have.
#include <gtest/gtest.h>

#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>

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
  const Json cases = Json::parse(std::ifstream(KINDS));
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

TEST(SolutionKinds, SegmentsDoNotSpendTheBudgetOfASearchTogether) {
  Solution solution;
  solution.status = Status::solved;
  solution.second_order = SecondOrder::necessary;
  solution.factorizations = 2000;
  solution.detail = "path; violations: equality 1.00e-12";
  EXPECT_NE(what_to_try(facts_of(solution, {})).find("max_local_search_factorizations"), std::string::npos);
  solution.detail = "segments; violations: equality 1.00e-12";
  EXPECT_EQ(what_to_try(facts_of(solution, {})).find("max_local_search_factorizations"), std::string::npos);
  EXPECT_NE(what_to_try(facts_of(solution, {})).find("num_starts=8"), std::string::npos);
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
