// Option explain: the conflict of an infeasible problem, judged by enumeration.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stop_token>
#include <string>
#include <vector>

#include "marble/solver.h"
#include "marble/warm_solver.h"
#include "support/conflict_check.h"
#include "support/problem_builder.h"
#include "support/random_problem.h"

namespace marble {
namespace {

using testing::ProblemBuilder;
using Indices = std::vector<Index>;

Options explaining() {
  Options options;
  options.explain = true;
  return options;
}

Solution explained(const OwnedProblem& p, const Options& options = explaining(),
                   const SolveControls& controls = {}) {
  return solve_in_process(p.view(), options, controls).value();
}

Conflict conflict_of(const OwnedProblem& p) {
  const Solution s = explained(p);
  EXPECT_EQ(s.status, Status::infeasible) << s.detail;
  EXPECT_TRUE(s.conflict.has_value()) << s.detail;
  return s.conflict.value_or(Conflict{});
}

// x + y = 4, x ≤ 1, y ≤ 2, and rows that have nothing to do with it.
OwnedProblem short_rows() {
  return ProblemBuilder("short", {1.0, 1.0, 1.0})
      .equal({1.0, 0.0, -1.0, 0.0})
      .equal({1.0, 1.0, 0.0, -4.0})
      .at_least({0.0, 0.0, 1.0, 9.0})
      .at_least({-1.0, 0.0, 0.0, 1.0})
      .at_least({0.0, -1.0, 0.0, 2.0})
      .optimum(0.0)
      .problem;
}

// 0 ≤ x ⊥ 1 − x ≥ 0 three times, and x₀ + x₁ + x₂ = 1.5.
OwnedProblem three_switches() {
  return ProblemBuilder("switches", {0.0, 0.0, 0.0})
      .equal({1.0, 1.0, 1.0, -1.5})
      .pair({1.0, 0.0, 0.0, 0.0}, {-1.0, 0.0, 0.0, 1.0})
      .pair({0.0, 1.0, 0.0, 0.0}, {0.0, -1.0, 0.0, 1.0})
      .pair({0.0, 0.0, 1.0, 0.0}, {0.0, 0.0, -1.0, 1.0})
      .optimum(0.0)
      .problem;
}

TEST(Explain, NamesTheRowsThatConflictAndNoOthers) {
  const Conflict conflict = conflict_of(short_rows());
  EXPECT_EQ(conflict.equalities, Indices{1});
  EXPECT_EQ(conflict.inequalities, (Indices{1, 2}));
  EXPECT_TRUE(conflict.minimal) << conflict.detail;
  EXPECT_EQ(conflict.size(), 3U);
}

TEST(Explain, NamesAPairBySidesWhereTheirSignsAloneConflict) {
  const Conflict conflict = conflict_of(ProblemBuilder("sides", {1.0, 1.0})
                                            .at_least({-1.0, -1.0, -1.0})
                                            .pair({1.0, 0.0, 0.0}, {0.0, 1.0, 0.0})
                                            .optimum(0.0)
                                            .problem);
  EXPECT_EQ(conflict.left_sides, Indices{0});
  EXPECT_EQ(conflict.right_sides, Indices{0});
  EXPECT_TRUE(conflict.complementarities.empty());
  EXPECT_TRUE(conflict.minimal);
}

TEST(Explain, NamesAPairByItsComplementarityWhereTheSignsAreNotNeeded) {
  const Conflict conflict = conflict_of(ProblemBuilder("both", {0.0, 0.0})
                                            .at_least({1.0, 0.0, -1.0})
                                            .at_least({0.0, 1.0, -1.0})
                                            .pair({1.0, 0.0, 0.0}, {0.0, 1.0, 0.0})
                                            .optimum(0.0)
                                            .problem);
  EXPECT_EQ(conflict.inequalities, (Indices{0, 1}));
  EXPECT_EQ(conflict.complementarities, Indices{0});
  EXPECT_EQ(conflict.size(), 3U);
  EXPECT_TRUE(conflict.minimal);
}

TEST(Explain, BranchesOverThePairsOfAConflict) {
  const Conflict conflict = conflict_of(three_switches());
  EXPECT_EQ(conflict.equalities, Indices{0});
  EXPECT_EQ(conflict.complementarities, (Indices{0, 1, 2}));
  EXPECT_EQ(conflict.size(), 4U);
  EXPECT_TRUE(conflict.minimal);
}

TEST(Explain, NamesARowThatNoPointMeetsByItself) {
  const Conflict conflict = conflict_of(
      ProblemBuilder("constant", {1.0}).at_least({1.0, 0.0}).at_least({0.0, -1.0}).optimum(0.0).problem);
  EXPECT_EQ(conflict.inequalities, Indices{1});
  EXPECT_EQ(conflict.size(), 1U);
  EXPECT_TRUE(conflict.minimal);
}

TEST(Explain, IgnoresContradictionsWithinTheTolerances) {
  const OwnedProblem p = ProblemBuilder("rounding", {0.0})
                             .equal({1.0, -1.0})
                             .equal({1.0, -1.0 - 1e-9})
                             .at_least({-1.0, 0.5})
                             .optimum(0.0)
                             .problem;
  const Conflict conflict = conflict_of(p);
  EXPECT_EQ(conflict.inequalities, Indices{0});
  EXPECT_EQ(conflict.equalities.size(), 1U);
  EXPECT_TRUE(conflict.minimal);
}

TEST(Explain, CountsItsWorkInTheSolution) {
  const Solution without = explained(short_rows(), {});
  const Solution with = explained(short_rows());
  EXPECT_FALSE(without.conflict.has_value());
  ASSERT_TRUE(with.conflict.has_value());
  EXPECT_GT(with.conflict->factorizations, 0);
  EXPECT_EQ(with.factorizations, without.factorizations + with.conflict->factorizations);
}

TEST(Explain, ChangesNoBitOfAnAnswerThatIsFeasible) {
  const OwnedProblem p = testing::random_problem({}, 3);
  const Solution without = explained(p, {}), with = explained(p);
  ASSERT_EQ(with.status, Status::solved);
  EXPECT_FALSE(with.conflict.has_value());
  EXPECT_EQ(with.z, without.z);
  EXPECT_EQ(with.detail, without.detail);
  EXPECT_EQ(with.factorizations, without.factorizations);
}

// Without its searches the solver proves nothing of three_switches().
Options without_searches() {
  Options options = explaining();
  options.max_feasibility_factorizations = options.max_small_problem_nodes = 0;
  return options;
}

TEST(Explain, ProvesWhatWasLocallyInfeasible) {
  Options silent = without_searches();
  silent.explain = false;
  ASSERT_EQ(explained(three_switches(), silent).status, Status::locally_infeasible);
  const Solution s = explained(three_switches(), without_searches());
  EXPECT_EQ(s.status, Status::infeasible);
  EXPECT_TRUE(s.proved);
  EXPECT_EQ(s.bound, std::numeric_limits<double>::infinity());
  ASSERT_TRUE(s.conflict.has_value());
  EXPECT_TRUE(s.conflict->minimal);
}

TEST(Explain, SaysWhereALocallyInfeasibleProblemHasAPoint) {
  const std::vector<double> weights = {47, 21, 58, 32, 31, 55, 47, 41, 34};
  std::vector<double> sum = weights;
  sum.push_back(-143.0);  // 21 + 34 + 41 + 47
  ProblemBuilder builder("subset", std::vector<double>(weights.size(), 0.0));
  builder.equal(sum);
  for (std::size_t i = 0; i < weights.size(); ++i) {
    std::vector<double> left(weights.size() + 1), right(weights.size() + 1);
    left[i] = 1.0;
    right[i] = -1.0;
    right.back() = 1.0;
    builder.pair(left, right);
  }
  Options options = without_searches();
  options.max_local_search_factorizations = 0;
  const Solution s = explained(builder.optimum(0.0).problem, options);
  ASSERT_EQ(s.status, Status::locally_infeasible);
  EXPECT_FALSE(s.conflict.has_value());
  EXPECT_NE(s.detail.find("explain: it is not infeasible"), std::string::npos) << s.detail;
}

TEST(Explain, LeavesACertificateOfTheConflictsRowsAlone) {
  const Solution s = explained(short_rows());
  ASSERT_EQ(s.certificate.size(), 5U);
  EXPECT_EQ(s.certificate[0], 0.0);
  EXPECT_NEAR(std::abs(s.certificate[1]), 1.0, 1e-9);  // by 1, so that x + y = 3
  EXPECT_EQ(s.certificate[2], 0.0);
  EXPECT_NEAR(s.certificate[3], 1.0, 1e-9);
  EXPECT_NEAR(s.certificate[4], 1.0, 1e-9);
}

// Stops the solve as soon as it looks for the conflict.
class StopInConflict final : public Pause {
 public:
  void look() override {
    if (monitor.read().phase == Phase::conflict) stop.request_stop();
  }
  [[nodiscard]] std::chrono::steady_clock::duration paused() const override { return {}; }

  ActivityMonitor monitor;
  std::stop_source stop;
};

TEST(Explain, StoppedItNamesAConflictThatIsNotMinimal) {
  StopInConflict pause;
  const OwnedProblem p = testing::planted_conflict(testing::Plant::budgets, 3);
  const Solution s = explained(p, explaining(),
                               {.stop = pause.stop.get_token(), .pause = &pause, .activity = &pause.monitor});
  EXPECT_EQ(s.status, Status::infeasible);
  ASSERT_TRUE(s.conflict.has_value()) << s.detail;
  EXPECT_FALSE(s.conflict->minimal);
  EXPECT_TRUE(s.conflict->detail.starts_with("not minimal: stopped")) << s.conflict->detail;
  EXPECT_FALSE(testing::have_point(p.view(), *s.conflict));
}

TEST(Explain, IsRefusedWhereMoreThanOneProblemIsSolved) {
  const OwnedProblem p = short_rows();
  const auto session = WarmSolver::create(Problem::create(p.view()).value(), explaining());
  ASSERT_FALSE(session.has_value());
  EXPECT_EQ(session.error().field, "explain");
  auto other = WarmSolver::create(Problem::create(p.view()).value()).value();
  EXPECT_EQ(other.set_options(explaining()).error().field, "explain");
}

class PlantedConflicts : public ::testing::TestWithParam<testing::Plant> {};

// 34 of each kind. What is claimed must hold; what is found must be minimal nearly always.
TEST_P(PlantedConflicts, AreFoundAndMinimal) {
  constexpr int kSeeds = 34;
  int minimal = 0;
  for (int seed = 0; seed < kSeeds; ++seed) {
    const OwnedProblem p = testing::planted_conflict(GetParam(), static_cast<std::uint64_t>(seed));
    const Solution s = explained(p);
    ASSERT_EQ(s.status, Status::infeasible) << "seed " << seed << ": " << s.detail;
    ASSERT_TRUE(s.conflict.has_value()) << "seed " << seed;
    ASSERT_LE(s.conflict->complementarities.size(), 12U) << "seed " << seed;
    EXPECT_FALSE(testing::have_point(p.view(), *s.conflict)) << "seed " << seed;
    minimal += s.conflict->minimal && testing::is_irreducible(p.view(), *s.conflict);
  }
  EXPECT_GE(minimal, kSeeds - 1);
}

INSTANTIATE_TEST_SUITE_P(All, PlantedConflicts, ::testing::ValuesIn(testing::kPlants));

}  // namespace
}  // namespace marble
