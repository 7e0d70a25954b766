// What the strategy relies on of the ways to better branches: where each begins, and when there is another.
#include "search/branch_search.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "branch/branch_engines.h"
#include "marble/examples.h"
#include "support/random_problem.h"
#include "workbench.h"

namespace marble {
namespace {

// The search, with all that it works on.
struct Searched {
  Searched(testing::Workbench& w, Kkt& kkt)
      : path(w.problem, kkt, w.options),
        branch(w.problem, kkt),
        incumbent(w.problem, w.options, branch.exact),
        search(w.problem, kkt, w.options, path, branch, incumbent) {}
  PathEngine path;
  BranchEngines branch;
  Incumbent incumbent;
  BranchSearch search;
};

// Says when each further start begins: each is softer than all before it.
class NotingKkt final : public testing::WrappedKkt {
 public:
  NotingKkt(Kkt& inner, std::function<void()> begins) : WrappedKkt(inner), begins_(std::move(begins)) {}
  [[nodiscard]] bool factorize(const RowWeights& weights) override {
    const double next = tuning::soft_rho * std::pow(tuning::further_softer, begun + 1);
    if (std::abs(weights.rho - next) <= 1e-12 * next) {
      ++begun;
      begins_();
    }
    return WrappedKkt::factorize(weights);
  }
  int begun = 0;

 private:
  std::function<void()> begins_;
};

TEST(BranchSearch, FurtherStartsAreFreeAfterACheapSoftStartWhileTheyGain) {
  int by_count = 0;
  int by_uselessness = 0;
  int by_cost = 0;
  std::vector<OwnedProblem> problems;
  for (const int steps : {8, 18, 21, 24, 27, 30}) problems.push_back(examples::hopper({.steps = steps}));
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    problems.push_back(
        testing::random_problem({.variables = 20, .equalities = 1, .inequalities = 0, .pairs = 20}, seed));
    problems.push_back(examples::qpec(
        {.upper_variables = 4, .lower_variables = 12, .constraints = 2, .degenerate_pairs = 2}, seed));
  }
  for (const OwnedProblem& problem : problems) {
    for (const bool after_soft_start : {true, false}) {
      testing::Workbench w(problem);
      const Incumbent* found = nullptr;
      std::vector<double> objectives;  // of the incumbent as each start begins, then at the end
      std::vector<int> factorizations;
      NotingKkt kkt(*w.kkt, [&] {
        objectives.push_back(found->best().objective);
        factorizations.push_back(w.run.factorizations - 1);
      });
      Searched s(w, kkt);
      found = &s.incumbent;
      s.search.find(w.run, w.zero());
      if (!s.incumbent.exists()) continue;
      s.search.repeat_soft_start(w.run, after_soft_start);
      if (!after_soft_start) {
        EXPECT_EQ(kkt.begun, 0) << "nobody asked for any";
        continue;
      }
      objectives.push_back(s.incumbent.best().objective);
      factorizations.push_back(w.run.factorizations);
      int useless = 0;  // in a row
      for (int i = 0; i < kkt.begun; ++i) {
        const auto start = static_cast<std::size_t>(i);
        EXPECT_LT(i + 1, tuning::further_round);
        EXPECT_LT(useless, tuning::useless_starts);
        EXPECT_LT(factorizations[start], tuning::cheap_search);
        useless = objectives[start + 1] < objectives[start] ? 0 : useless + 1;
      }
      const bool count = kkt.begun + 1 == tuning::further_round;
      const bool gave_up = useless == tuning::useless_starts;
      const bool cost = factorizations.back() >= tuning::cheap_search;
      EXPECT_TRUE(count || gave_up || cost) << "why did it end?";
      by_count += count && !cost ? 1 : 0;
      by_uselessness += gave_up && !count ? 1 : 0;
      by_cost += cost && !count && !gave_up ? 1 : 0;
    }
  }
  EXPECT_GT(by_count, 0);
  EXPECT_GT(by_uselessness, 0);
  EXPECT_GT(by_cost, 0);
}

// Remembers which rows each factorization held.
class RememberingKkt final : public testing::WrappedKkt {
 public:
  using WrappedKkt::WrappedKkt;
  [[nodiscard]] bool factorize(const RowWeights& weights) override {
    if (weights.rho == tuning::soft_rho) held.clear();  // of the last soft start and what came after it
    held.push_back((weights.rows.all.array() > 0.0).cast<int>());
    return WrappedKkt::factorize(weights);
  }
  std::vector<Eigen::ArrayXi> held;
};

TEST(BranchSearch, WhereASoftStartBringsNothingTheIncumbentsOwnBranchIsSearched) {
  int searched = 0;
  std::vector<OwnedProblem> problems;
  for (const int steps : {8, 9, 10}) problems.push_back(examples::hopper({.steps = steps}));
  for (std::uint64_t seed = 1; seed <= 12; ++seed)
    problems.push_back(examples::qpec(
        {.upper_variables = 8, .lower_variables = 40, .constraints = 2, .degenerate_pairs = 2}, seed));
  for (const OwnedProblem& problem : problems) {
    testing::Workbench w(problem);
    RememberingKkt kkt(*w.kkt);
    Searched s(w, kkt);
    s.search.find(w.run, w.zero());  // so good that another soft start finds nothing better
    ASSERT_TRUE(s.incumbent.exists()) << problem.name;
    const ExactSolution before = s.incumbent.best();
    const bool soft = s.search.improve(w.run, w.zero());
    if (!soft || std::string(s.incumbent.best().origin).rfind("soft", 0) == 0) continue;
    ++searched;
    Eigen::ArrayXi rows(static_cast<Index>(before.set.held.size()));
    for (Index row = 0; row < rows.size(); ++row) rows[row] = before.set.held[row] != 0 ? 1 : 0;
    EXPECT_TRUE(std::any_of(kkt.held.begin(), kkt.held.end(), [&](const auto& held) {
      return (held == rows).all();
    })) << problem.name;
  }
  EXPECT_GT(searched, 7);
}

}  // namespace
}  // namespace marble
