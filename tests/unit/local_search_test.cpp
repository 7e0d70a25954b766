// What others rely on of the local search: it never ends worse than it began, stays within its budget, and
// what it leaves behind is the elastic optimum of the branch it names.
#include "search/local_search.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "branch/branch_engines.h"
#include "marble/examples.h"
#include "support/random_problem.h"
#include "workbench.h"

namespace marble {
namespace {

using testing::Rows;
using testing::Workbench;

constexpr double kNever = std::numeric_limits<double>::infinity();
constexpr int kBudget = 200;
constexpr int kNoLimit = std::numeric_limits<int>::max() / 2;

SearchPlan switches(int patience) {
  return {.rho_first = 1e8,
          .rho_factor = 10.0,
          .rho_last = 1e8,
          .rho_soft = 0.0,
          .rho_exchange = kNever,
          .from_exact = true,
          .first_patience = patience,
          .switch_patience = 0,
          .exchange_patience = 0};
}

SearchPlan from_soft() {
  SearchPlan plan = switches(20);
  plan.rho_first = 10.0;
  plan.rho_soft = 2e3;
  plan.from_exact = false;
  plan.switch_patience = 20;
  return plan;
}

struct Search : Workbench {
  explicit Search(const OwnedProblem& p, const Options& chosen = {}, Rows* reported = nullptr)
      : Workbench(p, chosen, reported), branch(problem, *kkt), engine(problem, *kkt, branch.elastic) {}

  void choose(unsigned s_fixed) {
    WorkingSet set(problem);
    for (Index pair = 0; pair < set.layout.pairs; ++pair)
      set.fix(pair, (s_fixed >> pair % 32 & 1U) != 0, false);
    branch.point.restore(Iterate(problem), set);
  }
  /// The exact objective of a branch, infinite if it is empty.
  [[nodiscard]] double exact(const WorkingSet& set) {
    const auto own_kkt = make_kkt(problem);
    BranchEngines fresh(problem, *own_kkt);
    marble::Run own = run.part(true);
    WorkingSet sides(problem);
    for (Index pair = 0; pair < set.layout.pairs; ++pair) sides.fix(pair, set.s_fixed[pair] != 0, false);
    fresh.point.set = sides;
    return fresh.exact.solve(own, kBudget) ? fresh.point.images.objective : kNever;
  }

  BranchEngines branch;
  LocalSearch engine;
};

OwnedProblem problem(std::uint64_t seed) {
  return testing::random_problem({.variables = 16, .equalities = 2, .inequalities = 6, .pairs = 6}, seed);
}

TEST(LocalSearch, NeverEndsWorseThanItBeganAndNoFlipIsLeftThatHelps) {
  int improved = 0;
  int searched = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    Search s(problem(seed));
    s.choose(static_cast<unsigned>(seed) * 7U);
    if (!s.branch.exact.solve(s.run, kBudget)) continue;
    ++searched;
    const double before = s.branch.point.images.objective;
    ASSERT_TRUE(s.engine.run(s.run, switches(100), kNoLimit)) << seed;
    const WorkingSet set = s.branch.point.set;
    const double after = s.exact(set);
    const double slack = 1e-5 * (1.0 + std::abs(before));
    EXPECT_LE(after, before + slack) << seed;
    EXPECT_EQ(s.engine.accepted() > 0, after < before - slack) << seed;
    improved += after < before - slack ? 1 : 0;
    for (Index pair = 0; pair < set.layout.pairs; ++pair) {
      WorkingSet neighbour = set;
      neighbour.switch_pair(pair);
      EXPECT_GE(s.exact(neighbour), after - slack)
          << seed << ": pair " << pair << " should have been switched";
    }
  }
  EXPECT_GE(searched, 15);
  EXPECT_GE(improved, 10);
}

// A chain of pairs (x, y), each best at x = 0, y = 2 and starting at x = 1, y = 0; neighbours attract each
// other.
OwnedProblem chain(Index pairs) {
  OwnedProblem p;
  Triplets Q, L, R;
  for (Index i = 0; i < pairs; ++i) {
    Q.add(2 * i, 2 * i, i == 0 || i == pairs - 1 ? 2.1 : 2.2);
    if (i > 0) Q.add(2 * i, 2 * i - 2, -0.1), Q.add(2 * i - 2, 2 * i, -0.1);
    Q.add(2 * i + 1, 2 * i + 1, 2.0);
    p.g.insert(p.g.end(), {-2.0, -4.0});
    L.add(i, 2 * i, 1.0);
    R.add(i, 2 * i + 1, 1.0);
  }
  p.Q = compress(2 * pairs, 2 * pairs, Q, "Q").value();
  p.L = compress(pairs, 2 * pairs, L, "L").value();
  p.R = compress(pairs, 2 * pairs, R, "R").value();
  p.l.assign(static_cast<std::size_t>(pairs), 0.0);
  p.r = p.l;
  return p;
}

TEST(LocalSearch, ALargeProblemTakesNoMoreFactorizationsThanASmallOneHasSwitches) {
  for (const Index pairs : {1000, 4000}) {
    Search s(chain(pairs));
    s.choose(0);
    ASSERT_TRUE(s.branch.exact.solve(s.run, kBudget));
    const int before = s.run.factorizations;
    ASSERT_TRUE(s.engine.run(s.run, switches(20), kNoLimit));
    EXPECT_EQ(s.engine.accepted(), pairs);
    EXPECT_LE(s.run.factorizations - before, 40) << "for any number of pairs";
    for (Index pair = 0; pair < pairs; ++pair) EXPECT_TRUE(s.branch.point.set.s_fixed[pair]) << pair;
    EXPECT_NEAR(s.branch.elastic.objective() / s.problem.cost_scale, -4.0 * pairs, 1e-6 * pairs);
  }
}

TEST(LocalSearch, LeavesTheElasticOptimumOfItsBranchBehind) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Search s(problem(seed));
    s.branch.point.start_from_point(s.zero());
    const SearchPlan plan = from_soft();
    ASSERT_TRUE(s.engine.run(s.run, plan, kNoLimit)) << seed;
    EXPECT_GE(s.branch.elastic.rho(), 1e6) << "the last ρ, or one at which a higher one would change nothing";
    const auto own_kkt = make_kkt(s.problem);
    BranchEngines fresh(s.problem, *own_kkt);
    fresh.point.set = s.branch.point.set;
    ASSERT_TRUE(fresh.elastic.solve(s.run, s.branch.elastic.rho(), ElasticRelaxation::Rows::held, kBudget));
    EXPECT_NEAR(s.branch.elastic.objective(), fresh.elastic.objective(),
                1e-6 * (1.0 + std::abs(fresh.elastic.objective())))
        << seed;
  }
}

TEST(LocalSearch, FromWhereAllIsSoftItFindsABetterBranchThanTheOneItBeganAt) {
  int better = 0;
  int worse = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    Search s(problem(seed));
    s.branch.point.start_from_point(s.zero());
    const double before = s.exact(s.branch.point.set);
    ASSERT_TRUE(s.engine.run(s.run, from_soft(), kNoLimit)) << seed;
    const double after = s.exact(s.branch.point.set);
    better += after < before - 1e-6 ? 1 : 0;
    worse += after > before + 1e-6 ? 1 : 0;
  }
  EXPECT_GE(better, 30);
  EXPECT_EQ(worse, 0);
}

TEST(LocalSearch, AMoveThatIsAcceptedIsAnIterationAndARow) {
  int accepted = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Rows rows;
    Search s(problem(seed), {}, &rows);
    s.branch.point.start_from_point(s.zero());
    ASSERT_TRUE(s.engine.run(s.run, from_soft(), kNoLimit));
    EXPECT_EQ(s.run.iterations, s.engine.accepted());
    EXPECT_EQ(rows.rows.size(), static_cast<std::size_t>(s.engine.accepted()));
    accepted += s.engine.accepted();
    for (std::size_t i = 0; i < rows.rows.size(); ++i) {
      EXPECT_EQ(rows.rows[i].kappa, 0.0) << "there is none";
      EXPECT_EQ(rows.rows[i].iteration, static_cast<int>(i) + 1);
      EXPECT_GE(rows.rows[i].rho, rows.rows[i == 0 ? 0 : i - 1].rho);
    }
  }
  EXPECT_GT(accepted, 20);
}

TEST(LocalSearch, WithoutPatienceNothingMoves) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    Search s(problem(seed));
    s.choose(21);
    if (!s.branch.exact.solve(s.run, kBudget)) continue;
    const WorkingSet set = s.branch.point.set;
    ASSERT_TRUE(s.engine.run(s.run, switches(0), kNoLimit));
    EXPECT_EQ(s.engine.accepted(), 0);
    EXPECT_TRUE(s.branch.point.set == set);
  }
}

TEST(LocalSearch, StopsAtItsLastFactorization) {
  const OwnedProblem p = examples::hopper({.steps = 30});
  int whole = 0;
  Rows rows;
  {
    Search s(p, {}, &rows);
    s.branch.point.start_from_point(s.zero());
    ASSERT_TRUE(s.engine.run(s.run, from_soft(), kNoLimit));
    whole = s.run.factorizations;
  }
  EXPECT_GT(whole, 80);
  for (const int last : {0, 1, 10, 20}) {
    Search s(p);
    s.branch.point.start_from_point(s.zero());
    const bool found = s.engine.run(s.run, from_soft(), last);
    // One candidate may be under way: the move, and the way back.
    EXPECT_LE(s.run.factorizations, last + 41) << last;
    EXPECT_LT(s.run.factorizations, whole) << last;
    EXPECT_TRUE(last > 0 || !found) << "not even a first elastic optimum";
  }
  for (int last = 1; last <= 30; ++last) {
    Search s(p);
    s.branch.point.start_from_point(s.zero());
    SearchPlan without_moves = from_soft();
    without_moves.first_patience = without_moves.switch_patience = 0;
    static_cast<void>(s.engine.run(s.run, without_moves, last));
    EXPECT_LE(s.run.factorizations, last + 1) << "and one for the factor of where it ends";
  }
  ASSERT_GT(rows.rows.size(), 3U);
  Search s(p);
  s.branch.point.start_from_point(s.zero());
  static_cast<void>(s.engine.run(s.run, from_soft(), rows.rows[0].factorizations));
  EXPECT_EQ(s.engine.accepted(), 1) << "the move that took the last one was the last";
}

TEST(LocalSearch, IsFalseForWhoIsToStopAndEndsSoonAfterAStop) {
  Rows rows;
  rows.stop_after = 3;
  Search s(examples::hopper({.steps = 8}), {}, &rows);
  s.branch.point.start_from_point(s.zero());
  EXPECT_FALSE(s.engine.run(s.run, from_soft(), kNoLimit));
  EXPECT_EQ(s.engine.accepted(), 3) << "the move that was reported, and none after it";
  EXPECT_FALSE(s.engine.run(s.run, from_soft(), kNoLimit));
  EXPECT_EQ(s.engine.accepted(), 0);
}

// Of each pair of gains −g₁x₁ − g₂x₂, x ≤ 1, 0 ≤ xᵢ ⊥ yᵢ ≥ 0, y₁ + y₂ ≥ 1: one of the two, and no way from
// the first to the second but by both pairs at once.
OwnedProblem one_of_two(const std::vector<std::pair<double, double>>& gains) {
  OwnedProblem p;
  Triplets Q, C, L, R;
  for (const auto& [first, second] : gains) {
    const auto at = static_cast<Index>(p.g.size());
    const auto row = static_cast<Index>(p.d.size());
    const auto pair = static_cast<Index>(p.l.size());
    p.g.insert(p.g.end(), {-first, -second, 0.0, 0.0});
    p.d.insert(p.d.end(), {1.0, 1.0, -1.0});
    for (Index i = 0; i < 4; ++i) Q.add(at + i, at + i, 0.01);
    for (Index i = 0; i < 2; ++i) {
      C.add(row + i, at + i, -1.0);
      C.add(row + 2, at + 2 + i, 1.0);
      L.add(pair + i, at + i, 1.0);
      R.add(pair + i, at + 2 + i, 1.0);
    }
    p.l.insert(p.l.end(), 2, 0.0);
  }
  p.r = p.l;
  const auto n = static_cast<Index>(p.g.size());
  p.Q = compress(n, n, Q, "Q").value();
  p.C = compress(static_cast<Index>(p.d.size()), n, C, "C").value();
  p.L = compress(static_cast<Index>(p.l.size()), n, L, "L").value();
  p.R = compress(static_cast<Index>(p.r.size()), n, R, "R").value();
  return p;
}

SearchPlan exchanges(bool wanted) {
  SearchPlan plan = switches(20);
  plan.rho_first = plan.rho_last = 1e7;
  plan.rho_exchange = wanted ? 1e7 : kNever;
  plan.exchange_patience = 5;
  return plan;
}

TEST(LocalSearch, ExchangesTwoPairsWhereNoFlipAloneIsFeasible) {
  for (const bool wanted : {false, true}) {
    Search s(one_of_two({{1.0, 3.0}}));
    s.choose(2U);  // x₂ = 0 and y₁ = 0: x = (1, 0)
    ASSERT_TRUE(s.branch.exact.solve(s.run, kBudget));
    ASSERT_TRUE(s.engine.run(s.run, exchanges(wanted), kNoLimit));
    EXPECT_EQ(s.engine.accepted(), wanted ? 1 : 0);
    ASSERT_TRUE(s.branch.exact.solve(s.run, kBudget));
    EXPECT_NEAR(s.user(s.branch.point.x.z())[wanted ? 1 : 0], 1.0, 1e-6);
  }
}

// How often the answer to a force on one variable is asked for: what a move of its row costs.
class CountingKkt final : public testing::WrappedKkt {
 public:
  CountingKkt(Kkt& inner, Index variable) : WrappedKkt(inner), variable_(variable) {}
  [[nodiscard]] bool solve_sparse(std::span<const Index> indices, std::span<const double> values,
                                  VectorRef x) override {
    asked += indices.size() == 1 && indices[0] == variable_ ? 1 : 0;
    return WrappedKkt::solve_sparse(indices, values, x);
  }
  int asked = 0;

 private:
  Index variable_;
};

TEST(LocalSearch, TwoPairsThatFailedAreNotTriedAgainWhileNothingNearThemChanges) {
  // The first block is where it should be, though its second x pulls hardest of all.
  Workbench w(one_of_two({{30.0, 10.0}, {1.0, 3.0}, {1.0, 4.0}, {1.0, 5.0}}));
  CountingKkt kkt(*w.kkt, 2);  // y₁ of that block, which the exchange moves
  BranchEngines branch(w.problem, kkt);
  LocalSearch search(w.problem, kkt, branch.elastic);
  WorkingSet set(w.problem);
  for (Index pair = 0; pair < w.problem.pairs(); ++pair) set.fix(pair, pair % 2 == 1, false);
  branch.point.restore(Iterate(w.problem), set);
  ASSERT_TRUE(branch.exact.solve(w.run, kBudget));
  ASSERT_TRUE(search.run(w.run, exchanges(true), kNoLimit));
  EXPECT_EQ(search.accepted(), 3) << "the other blocks, each a list of its own";
  EXPECT_EQ(kkt.asked, 2) << "in the first list; and in the last, which comes to that pair itself";
}

// Rows that are not held give way a hundred times as far, so that to drive one to 0 seems to cost next to
// nothing.
class LyingKkt final : public testing::WrappedKkt {
 public:
  using WrappedKkt::WrappedKkt;
  [[nodiscard]] bool solve_sparse(std::span<const Index> indices, std::span<const double> values,
                                  VectorRef x) override {
    const bool solved = WrappedKkt::solve_sparse(indices, values, x);
    if (max_abs(x) > 1e-5) x *= 100.0;  // of a row that is held it is about 1/ρ
    return solved;
  }
};

TEST(LocalSearch, AMoveThatProvesNoBetterThanWasSaidIsTakenBack) {
  int tried = 0;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    Search s(problem(seed));
    s.choose(static_cast<unsigned>(seed) * 7U);
    if (!s.branch.exact.solve(s.run, kBudget)) continue;
    ASSERT_TRUE(s.engine.run(s.run, switches(100), kNoLimit)) << seed;  // no switch is left that helps
    const WorkingSet best = s.branch.point.set;
    const Iterate x = s.branch.point.x;
    LyingKkt lying(*s.kkt);
    BranchEngines branch(s.problem, lying);
    LocalSearch search(s.problem, lying, branch.elastic);
    branch.point.restore(x, best);
    const int before = s.run.factorizations;
    ASSERT_TRUE(search.run(s.run, switches(100), kNoLimit)) << seed;
    tried += s.run.factorizations - before > 2 ? 1 : 0;
    EXPECT_EQ(search.accepted(), 0) << seed;
    EXPECT_EQ(branch.point.set.s_fixed, best.s_fixed) << seed;
    EXPECT_NEAR(branch.elastic.objective(), s.branch.elastic.objective(),
                1e-6 * (1.0 + std::abs(s.branch.elastic.objective())))
        << seed;
  }
  EXPECT_GE(tried, 40);
}

TEST(LocalSearch, PullingAreFixedSidesWithDescentOnTheOtherSide) {
  // ½(x − a)² + ½(y − b)² on the branch x = 0: x pulls exactly if a > 0.
  for (const double a : {-1.0, 0.0, 2.0}) {
    OwnedProblem p;
    p.g = {-a, -1.0};
    p.Q = compress(2, 2, {{0, 1}, {0, 1}, {1.0, 1.0}}, "Q").value();
    p.L = compress(1, 2, {{0}, {0}, {1.0}}, "L").value();
    p.R = compress(1, 2, {{0}, {1}, {1.0}}, "R").value();
    p.l = p.r = {0.0};
    Search s(p);
    s.choose(1);
    ASSERT_TRUE(s.branch.exact.solve(s.run, kBudget));
    EXPECT_EQ(LocalSearch::pulling(s.branch.point.x, s.branch.point.set), a > 0.0 ? 1 : 0) << a;
    OwnedProblem mirrored = p;
    std::swap(mirrored.L, mirrored.R);
    Search m(mirrored);
    m.choose(0);
    ASSERT_TRUE(m.branch.exact.solve(m.run, kBudget));
    EXPECT_EQ(LocalSearch::pulling(m.branch.point.x, m.branch.point.set), a > 0.0 ? 1 : 0) << a;
  }
}

TEST(LocalSearch, ARunBeforeLeavesNoTrace) {
  const OwnedProblem p = examples::hopper({.steps = 6});
  Search s(p);
  s.branch.point.start_from_point(s.zero());
  ASSERT_TRUE(s.engine.run(s.run, from_soft(), kNoLimit));
  const Vector first = s.branch.point.x.all;
  const int factorizations = s.run.factorizations;
  const int accepted = s.engine.accepted();
  s.choose(12345);
  static_cast<void>(s.engine.run(s.run, from_soft(), kNoLimit));
  s.choose(0);
  s.branch.point.start_from_point(s.zero());
  const int before = s.run.factorizations;
  ASSERT_TRUE(s.engine.run(s.run, from_soft(), kNoLimit));
  EXPECT_EQ(s.branch.point.x.all, first);
  EXPECT_EQ(s.engine.accepted(), accepted);
  EXPECT_EQ(s.run.factorizations - before, factorizations);
}

TEST(LocalSearch, EndsAfterTheFirstRhoAboveItsCutoff) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    Search whole(problem(seed));
    whole.choose(0);
    if (!whole.engine.run(whole.run, from_soft(), kNoLimit)) continue;
    SearchPlan plan = from_soft();
    plan.cutoff = -kNever;
    Search cut(problem(seed));
    cut.choose(0);
    EXPECT_FALSE(cut.engine.run(cut.run, plan, kNoLimit)) << seed;
    EXPECT_EQ(cut.branch.elastic.rho(), plan.rho_first) << seed;
    EXPECT_LE(cut.run.factorizations, whole.run.factorizations) << seed;
    plan.cutoff = kNever;
    Search uncut(problem(seed));
    uncut.choose(0);
    ASSERT_TRUE(uncut.engine.run(uncut.run, plan, kNoLimit)) << seed;
    EXPECT_EQ(uncut.run.factorizations, whole.run.factorizations) << seed;
  }
}

}  // namespace
}  // namespace marble
