// What the solver relies on of the strategy, stage by stage: which engine has its say when, what is kept, and
// that nothing that was found is lost again.
#include "solver/strategy.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "marble/examples.h"
#include "support/brute_force.h"
#include "support/random_problem.h"
#include "support/small_problems.h"
#include "workbench.h"

namespace marble {
namespace {

using testing::Rows;
using testing::Workbench;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// min (x − a)² + (y − b)² over 0 ≤ x ⊥ y ≥ 0.
OwnedProblem corner(double a, double b, double side = 1.0) {
  OwnedProblem p;
  p.name = "corner";
  p.g = {-2.0 * a, -2.0 * b};
  p.c0 = a * a + b * b;
  p.Q = compress(2, 2, {{0, 1}, {0, 1}, {2.0, 2.0}}, "Q").value();
  p.L = compress(1, 2, {{0}, {0}, {side}}, "L").value();
  p.R = compress(1, 2, {{0}, {1}, {side}}, "R").value();
  p.l = p.r = {0.0};
  return p;
}

// A strategy, and each run of it with counters of its own.
struct Planned : Workbench {
  explicit Planned(const OwnedProblem& p, const Options& chosen = {})
      : Workbench(p, chosen), strategy(problem, *kkt, options, nullptr) {}

  Ending start(ConstVectorRef z, const std::optional<Strategy::WarmStart>& warm_start) {
    marble::Run own(options, controls);
    kkt->attend(own.interrupt());
    answer = strategy.run(own, z, warm_start, {});
    iterations = own.iterations;
    factorizations = own.factorizations;
    return answer.ending;
  }
  Ending cold() { return start(zero(), std::nullopt); }
  Ending warm(const Iterate& solution, double reference_objective) {
    return start(zero(), Strategy::WarmStart{&solution, reference_objective});
  }
  /// The exact solution of a branch.
  [[nodiscard]] Iterate solved_branch(unsigned s_fixed) {
    const auto own_kkt = make_kkt(problem);
    BranchEngines branch(problem, *own_kkt);
    WorkingSet set(problem);
    for (Index pair = 0; pair < set.layout.pairs; ++pair) set.fix(pair, (s_fixed >> pair & 1U) != 0, false);
    branch.point.set = set;
    EXPECT_TRUE(branch.exact.solve(run, 100));
    return branch.point.x;
  }
  [[nodiscard]] double objective() const { return judged(answer.x->z()).objective; }

  Strategy strategy;
  Strategy::Answer answer = {};
  int iterations = 0, factorizations = 0;
};

TEST(Strategy, WhatItCallsSolvedIsExactAndNoWorseThanThePathAlone) {
  for (const auto& [problem, optimum] : testing::known_problems()) {
    Options path_only;
    path_only.polish = false;
    Planned whole(problem), alone(problem, path_only);
    const Ending end = whole.cold();
    ASSERT_EQ(end.status, Status::solved) << problem.name << ": " << end.detail;
    EXPECT_LE(whole.judged(whole.answer.x->z()).infeasibility(), 1e-9) << problem.name;
    EXPECT_NE(end.detail.find("violations: equality"), std::string::npos) << end.detail;
    if (alone.cold().status != Status::solved) continue;
    EXPECT_LE(whole.objective(), alone.objective() + 1e-3 * (1.0 + std::abs(optimum))) << problem.name;
  }
}

TEST(Strategy, SaysWhichEnginesFoundTheAnswer) {
  const auto found_by = [](const OwnedProblem& p) {
    const std::string detail = Planned(p).cold().detail;
    return detail.substr(0, detail.find(';'));
  };
  EXPECT_EQ(found_by(corner(1.0, 2.0)), "path");
  EXPECT_EQ(found_by(examples::hopper({.steps = 15})), "soft start, local search");
  EXPECT_EQ(found_by(examples::rocket()), "interior point, local search");
  Planned p(corner(1.0, 2.0));
  EXPECT_EQ(p.warm(p.solved_branch(1), 1.0).detail.rfind("warm start; ", 0), 0U);
}

TEST(Strategy, AFeasiblePointOfThePathThatIsClearlyLowerIsTheAnswer) {
  constexpr double kBest = 0.45 * 0.45;          // of a branch
  for (const double kappa_min : {1e-2, 8e-3}) {  // where the branch is looked at first, and beyond
    Options options;
    options.kappa_min = kappa_min;
    options.complementarity_tolerance = 0.05;
    Planned p(corner(0.45, 0.5), options);
    const Ending end = p.cold();
    EXPECT_EQ(end.status, Status::solved) << end.detail;
    EXPECT_LT(p.objective(), kBest - 2e-3);
    EXPECT_LE(p.judged(p.answer.x->z()).infeasibility(), 0.05);
    options.complementarity_tolerance = 1e-6;
    Planned strict(corner(0.45, 0.5), options);
    EXPECT_EQ(strict.cold().status, Status::solved);
    EXPECT_NEAR(strict.objective(), kBest, 1e-9) << "what is not feasible is no answer";
  }
}

TEST(Strategy, WithoutPolishItIsThePathAlone) {
  Options options;
  options.polish = false;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const OwnedProblem p = testing::random_problem({}, seed);
    Planned whole(p, options);
    const Ending end = whole.cold();
    if (end.status != Status::solved) continue;
    Workbench w(p, options);
    PathEngine path(w.problem, *w.kkt, w.options);
    path.start(w.zero());
    for (const double kappa : {1e-2, 1e-6, w.options.kappa_min}) {
      if (path.follow(w.run, kappa)) break;
    }
    EXPECT_EQ(whole.answer.x->all, path.iterate().all) << p.name;
    EXPECT_EQ(whole.factorizations, w.run.factorizations) << p.name;
    EXPECT_FALSE(whole.answer.b_stationary.has_value());
  }
}

TEST(Strategy, WithoutASearchBudgetNoBranchIsLeft) {
  Options options;
  options.max_local_search_factorizations = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Planned p(testing::random_problem({.variables = 16, .pairs = 8}, seed), options);
    const Ending end = p.cold();
    EXPECT_EQ(end.detail.find("local search"), std::string::npos) << end.detail;
    EXPECT_EQ(end.detail.find("neighbouring"), std::string::npos) << end.detail;
    EXPECT_EQ(end.detail.find("descent"), std::string::npos) << end.detail;
  }
}

TEST(Strategy, SearchesAreWorthTheirFactorizations) {
  int lower = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    const OwnedProblem problem = testing::random_problem({.variables = 20, .pairs = 10}, seed);
    Options none;
    none.max_local_search_factorizations = 0;
    Planned with(problem), without(problem, none);
    if (with.cold().status != Status::solved || without.cold().status != Status::solved) continue;
    EXPECT_LE(with.objective(), without.objective() + 1e-7 * (1.0 + std::abs(without.objective()))) << seed;
    lower += with.objective() < without.objective() - 1e-6 ? 1 : 0;
  }
  EXPECT_GE(lower, 10);
}

TEST(Strategy, RunsBeforeLeaveNoTrace) {
  Planned p(examples::hopper({.steps = 12}));
  const Ending first = p.cold();
  const Vector z = p.answer.x->z();
  const int factorizations = p.factorizations;
  const Iterate solution = *p.answer.x;
  EXPECT_EQ(p.warm(solution, p.objective()).status, Status::solved);
  EXPECT_TRUE(p.answer.stayed_warm);
  static_cast<void>(p.start(Vector::Constant(z.size(), 0.2), std::nullopt));
  EXPECT_FALSE(p.answer.stayed_warm);
  const Ending again = p.cold();
  EXPECT_EQ(again.detail, first.detail);
  EXPECT_EQ(p.answer.x->z(), z);
  EXPECT_EQ(p.factorizations, factorizations);
}

TEST(Strategy, AProofIsLookedForInEachRunAnew) {
  OwnedProblem contradiction = corner(1.0, 2.0);  // x >= 1 and x <= 0
  contradiction.C = compress(2, 2, {{0, 1}, {0, 0}, {1.0, -1.0}}, "C").value();
  contradiction.d = {-1.0, 0.0};
  OwnedProblem endless = corner(1.0, 2.0);
  endless.Q = compress(2, 2, {}, "Q").value();
  for (const auto& [problem, status] :
       {std::pair{contradiction, Status::infeasible}, std::pair{endless, Status::unbounded}}) {
    Planned p(problem);
    for (int run = 1; run <= 3; ++run) EXPECT_EQ(p.cold().status, status) << "run " << run;
  }
}

TEST(Strategy, AWarmStartWhoseBranchIsStillFeasibleIsAllThereIs) {
  for (const unsigned s_fixed : {0U, 1U}) {
    Planned p(corner(1.0, 2.0));
    const Iterate solution = p.solved_branch(s_fixed);
    const Ending end = p.warm(solution, -kInfinity);
    EXPECT_EQ(end.status, Status::solved);
    EXPECT_TRUE(p.answer.stayed_warm);
    EXPECT_EQ(p.iterations, 0) << "no step of the path";
    EXPECT_LE(p.factorizations, 2);
    EXPECT_NEAR(p.objective(), s_fixed ? 1.0 : 4.0, 1e-9);
  }
}

TEST(Strategy, AWarmStartThatCannotBeRestoredIsAColdOne) {
  Planned warm(examples::hopper({.steps = 10})), cold(examples::hopper({.steps = 10}));
  Iterate nonsense(warm.problem);
  nonsense.all = 1e3 * Vector::LinSpaced(nonsense.all.size(), -1.0, 1.0);
  const Ending end = warm.warm(nonsense, -kInfinity);
  EXPECT_EQ(end.status, Status::solved) << end.detail;
  static_cast<void>(cold.cold());
  EXPECT_LE(warm.objective(), cold.objective() + 1e-9 * std::abs(cold.objective()))
      << "what a cold start finds is not lost";
}

TEST(Strategy, BetweenAWarmAnswerAndAColdOneTheBetterWins) {
  int both = 0;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    const testing::RandomSizes sizes{.variables = 30, .equalities = 3, .inequalities = 60, .pairs = 9};
    const OwnedProblem problem = testing::random_problem(sizes, seed);
    Planned other(testing::random_problem(sizes, seed + 1000));
    static_cast<void>(other.cold());
    Planned warm(problem), judged_worse(problem), cold(problem);
    const Iterate start = *other.answer.x;
    if (warm.warm(start, kInfinity).status != Status::solved || !warm.answer.stayed_warm) continue;
    if (cold.cold().status != Status::solved) continue;
    const Ending end = judged_worse.warm(start, -kInfinity);
    ASSERT_EQ(end.status, Status::solved) << seed;
    const double slack = 1e-8 * (1.0 + std::abs(warm.objective()));
    if (judged_worse.answer.stayed_warm) continue;  // so little work that it needs no other opinion
    ++both;
    EXPECT_LE(judged_worse.objective(), std::min(warm.objective(), cold.objective()) + slack) << seed;
  }
  EXPECT_GE(both, 8);
}

// In the user's units the objectives overflow.
TEST(Strategy, AnObjectiveOfMinusInfinityIsNotAboveAReferenceOfMinusInfinity) {
  int restored = 0;
  for (std::uint64_t seed = 1; seed <= 60 && restored < 3; ++seed) {
    const testing::RandomSizes sizes{.variables = 30, .equalities = 3, .inequalities = 60, .pairs = 9};
    const OwnedProblem problem = testing::random_problem(sizes, seed);
    Planned other(testing::random_problem(sizes, seed + 1000)), usual(problem), overflown(problem);
    static_cast<void>(other.cold());
    const Iterate start = *other.answer.x;
    static_cast<void>(usual.warm(start, -1e30));
    if (usual.answer.stayed_warm) continue;  // a small change, of which no objective is compared
    static_cast<void>(usual.warm(start, kInfinity));
    if (!usual.answer.stayed_warm) continue;
    ++restored;
    overflown.problem.c0 = -kInfinity;
    static_cast<void>(overflown.warm(start, -kInfinity));
    EXPECT_TRUE(overflown.answer.stayed_warm) << seed;
  }
  EXPECT_EQ(restored, 3);
}

// ½qx² − 2x + ½y² + gy over 0 ≤ x ⊥ y ≥ 0: (0, 0) solves the branch x = 0, but on the other x grows, to 2/q.
OwnedProblem half_a_corner(double q, double g = 1.0) {
  OwnedProblem p = corner(0.0, 0.0);
  p.g = {-2.0, g};
  p.Q = compress(2, 2, {{0, 1}, {0, 1}, {q, 1.0}}, "Q").value();
  return p;
}

TEST(Strategy, WhereBranchesMeetTheOthersAreTriedToo) {
  for (const double g : {1.0, 0.0}) {  // y = 0 with a multiplier, and as the minimum that happens to be there
    Planned p(half_a_corner(1.0, g));
    const Ending end = p.warm(p.solved_branch(1), kInfinity);
    EXPECT_EQ(end.status, Status::solved);
    EXPECT_NEAR(p.objective(), -2.0, 1e-9) << end.detail;
    EXPECT_EQ(end.detail.rfind("neighbouring branch; ", 0), 0U) << end.detail;
    EXPECT_EQ(p.answer.b_stationary, true);
  }
  Options options;
  options.max_local_search_factorizations = 0;
  Planned none(half_a_corner(1.0), options);
  EXPECT_EQ(none.warm(none.solved_branch(1), kInfinity).status, Status::solved);
  EXPECT_NEAR(none.objective(), 0.0, 1e-9) << "no branch but its own is looked at";
  EXPECT_FALSE(none.answer.b_stationary.has_value()) << "and nothing is said of the others";
}

TEST(Strategy, AWarmAnswerBesideABranchThatFallsForEverIsUnbounded) {
  Planned p(half_a_corner(0.0));  // on the other branch x grows for ever
  const Ending end = p.warm(p.solved_branch(1), kInfinity);
  EXPECT_EQ(end.status, Status::unbounded) << end.detail;
  ASSERT_EQ(end.certificate.size(), 2U);
  EXPECT_NEAR(end.certificate[0], 1.0, 1e-9);
  EXPECT_FALSE(p.answer.b_stationary.has_value());
}

// −½|z|² over −1 ≤ z ≤ 1: the path stays at 0, and a descent goes from face to face.
TEST(Strategy, APathThatEndsAtASaddleSaysSoThoughTheBudgetForLeavingItRanOut) {
  OwnedProblem p;
  Triplets Q, C;
  for (Index i = 0; i < 6; ++i) {
    Q.add(i, i, -1.0);
    C.add(i, i, 1.0);
    C.add(6 + i, i, -1.0);
  }
  p.g.assign(6, 0.0);
  p.d.assign(12, 1.0);
  p.Q = compress(6, 6, Q, "Q").value();
  p.C = compress(12, 6, C, "C").value();
  std::vector<SecondOrder> said;
  for (int budget = 1; budget <= 41; budget += 4) {
    Options options;
    options.max_local_search_factorizations = budget;
    Planned planned(p, options);
    ASSERT_EQ(planned.cold().status, Status::solved) << budget;
    const SecondOrder word = planned.answer.second_order;
    EXPECT_NEAR(planned.objective(), word == SecondOrder::minimum ? -3.0 : 0.0, 1e-9) << budget;
    if (said.empty() || said.back() != word) said.push_back(word);
  }
  EXPECT_EQ(said, (std::vector{SecondOrder::unknown, SecondOrder::saddle, SecondOrder::minimum}))
      << "it was not looked for; it is one; it was left";
}

}  // namespace
}  // namespace marble
