// Exchanges of pairs, where no single pair can switch, beside an enumeration.
#include "global/exchange_search.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "branch/branch_engines.h"
#include "marble/examples.h"
#include "marble/solver.h"
#include "support/independent_check.h"
#include "support/portfolio.h"
#include "workbench.h"

namespace marble {
namespace {

using testing::best_portfolio;
using testing::portfolio;
using testing::Workbench;

constexpr double kNoLimit = std::numeric_limits<double>::infinity();

// A search on a workbench, from the branch with the last assets.
struct Bench : Workbench {
  explicit Bench(const OwnedProblem& p, Index most, testing::Rows* reported = nullptr)
      : Workbench(p, {}, reported), engines(problem, *kkt), incumbent(problem, options, engines.exact) {
    WorkingSet set(problem);
    for (Index pair = 0; pair < problem.pairs(); ++pair) set.fix(pair, pair < problem.pairs() - most, false);
    engines.point.restore(Iterate(problem), set);
    EXPECT_EQ(incumbent.solve_branch(run, "start", 100), Incumbent::Outcome::kept);
  }
  std::int64_t search(std::int64_t most_points, double bytes = kNoLimit) {
    return ExchangeSearch(problem, engines.point, incumbent).run(run, most_points, bytes);
  }
  [[nodiscard]] double objective() const { return problem.user_objective(incumbent.best().objective); }

  BranchEngines engines;
  Incumbent incumbent;
};

TEST(ExchangeSearch, FindsTheOptimumThatNoSingleSwitchLeadsTo) {
  int found = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    Bench bench(portfolio(12, 3, seed), 3);
    const double optimum = best_portfolio(12, 3, seed);
    const double start = bench.objective();
    EXPECT_GT(bench.search(4000), 0);
    EXPECT_GE(bench.objective(), optimum - 1e-7) << seed;
    EXPECT_LE(bench.objective(), start) << seed;
    found += std::abs(bench.objective() - optimum) <= 1e-7 ? 1 : 0;
  }
  EXPECT_EQ(found, 10);
}

TEST(ExchangeSearch, EndsAtItsBudget) {
  for (const std::int64_t most : {1, 2, 7, 40}) {
    Bench bench(portfolio(16, 4, 3), 4);
    const std::int64_t branches = bench.search(most);
    EXPECT_GE(branches, 1) << most;
    EXPECT_LE(branches, most) << "each takes a point or more";
  }
  Bench idle(portfolio(16, 4, 3), 4);
  EXPECT_EQ(idle.search(0), 0);
}

TEST(ExchangeSearch, AppliesWhereARowTiesThePairsTogether) {
  EXPECT_TRUE(ExchangeSearch::applies(Workbench(portfolio(16, 4, 3)).problem));
  EXPECT_FALSE(ExchangeSearch::applies(Workbench(examples::hopper({.steps = 10})).problem));
}

TEST(ExchangeSearch, FindsTheSameInEveryRun) {
  Bench one(portfolio(20, 4, 5), 4), other(portfolio(20, 4, 5), 4);
  EXPECT_EQ(one.search(900), other.search(900));
  EXPECT_EQ(one.incumbent.best().x.all, other.incumbent.best().x.all);
}

TEST(ExchangeSearch, DoesNothingWithoutMemoryOrAfterAStop) {
  Bench bench(portfolio(16, 4, 3), 4);
  const double start = bench.objective();
  EXPECT_EQ(bench.search(100, 1000.0), 0);
  EXPECT_EQ(bench.objective(), start);
  testing::Rows rows;
  Bench stopped(portfolio(16, 4, 3), 4, &rows);
  rows.source.request_stop();
  EXPECT_EQ(stopped.search(100), 0);
  EXPECT_EQ(stopped.objective(), start);
}

TEST(ExchangeSearch, LowersDefaultAnswersAndEffortLeavesItOut) {
  int better = 0, optimal = 0;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    const OwnedProblem p = portfolio(20, 4, seed);
    const Solution first = solve_in_process(p.view(), Options{.effort = 0.0}).value();
    const Solution s = solve_in_process(p.view(), Options{}).value();
    ASSERT_EQ(s.status, Status::solved);
    EXPECT_LE(testing::judge(p.view(), s).infeasibility(), 1e-9);
    EXPECT_LE(s.objective, first.objective + 1e-9);
    EXPECT_EQ(first.detail.find("exchanges"), std::string::npos);
    better += s.objective < first.objective - 1e-6 ? 1 : 0;
    optimal += s.objective <= best_portfolio(20, 4, seed) + 1e-6 ? 1 : 0;
  }
  EXPECT_GE(better, 3);
  EXPECT_GE(optimal, 5);
}

TEST(ExchangeSearch, IsLeftOutWhereNoRowTiesPairsTogether) {
  const Solution s = solve_in_process(examples::hopper({.steps = 6}).view()).value();
  ASSERT_EQ(s.status, Status::solved);
  EXPECT_EQ(s.detail.find("exchanges"), std::string::npos) << s.detail;
}

}  // namespace
}  // namespace marble
