// The interior point method for relaxations, and clauses, against an enumeration of all branches.
#include "global/interior_point.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "marble/solver.h"
#include "support/brute_force.h"
#include "support/random_problem.h"

namespace marble {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kFar = 1e3;

// The least of what all choices of sides end with, and how many of them were left undecided: their bounds are
// true, but say little.
struct Branches {
  double least = kInfinity;
  int undecided = 0;
};

Branches solve_branches(const ScaledProblem& problem, const Box& box, InteriorPoint& engine) {
  Branches result;
  for (unsigned branch = 0; branch < 1U << static_cast<unsigned>(problem.pairs()); ++branch) {
    EXPECT_TRUE(engine.start(Vector::Zero(problem.variables())));
    for (Index pair = 0; pair < problem.pairs(); ++pair)
      engine.fix((branch >> static_cast<unsigned>(pair) & 1U) != 0 ? problem.layout.s(pair)
                                                                   : problem.layout.t(pair));
    const NodeEngine::End end = engine.solve(box, kInfinity, Interrupt());
    result.undecided += end == NodeEngine::End::undecided;
    if (end != NodeEngine::End::infeasible) result.least = std::min(result.least, engine.bound());
  }
  return result;
}

TEST(InteriorPoint, BoundsOfTheRootAndOfAllBranchesAreTrueAndTheLeastIsTheOptimum) {
  int undecided = 0;
  for (std::uint64_t seed = 1; seed <= 150; ++seed) {
    testing::RandomSizes sizes;
    sizes.variables = 4 + static_cast<Index>(seed % 9);
    sizes.equalities = static_cast<Index>(seed % 3);
    sizes.pairs = 1 + static_cast<Index>(seed % 4);
    const OwnedProblem p = testing::random_problem(sizes, seed);
    const auto best = testing::brute_force(p.view());
    ASSERT_TRUE(best) << seed;
    const ScaledProblem problem = scale(Problem::create(p.view()).value(), 10);
    const Box box(problem, kFar);
    InteriorPoint engine(problem, make_kkt(problem));
    const double size = std::max(1.0, std::abs(best->objective));

    ASSERT_TRUE(engine.start(Vector::Zero(problem.variables())));
    EXPECT_NE(engine.solve(box, kInfinity, Interrupt()), NodeEngine::End::infeasible) << seed;
    EXPECT_LE(problem.user_objective(engine.bound()), best->objective + 1e-7 * size) << seed;

    const Branches branches = solve_branches(problem, box, engine);
    const double least = problem.user_objective(branches.least);
    EXPECT_LE(least, best->objective + 1e-7 * size) << seed;
    if (branches.undecided == 0) {
      EXPECT_GE(least, best->objective - 1e-5 * size) << seed;
    }
    undecided += branches.undecided;
  }
  EXPECT_LE(undecided, 10) << "of some thousand";
}

// A point on a line that is to be at 1 in one of the steps and at −1 in another one, each step near where it
// was before: u_k, v_k ≥ 0 say in which, and sum up to 1.
OwnedProblem two_places(Index steps) {
  OwnedProblem p;
  const auto at = [](Index step, Index variable) {
    return 5 * step + variable;
  };  // x, u, v, |x − 1|, |x + 1|
  const Index n = 5 * steps;
  Triplets Q, A, C, L, R;
  p.g.assign(static_cast<std::size_t>(n), 0.0);
  for (Index k = 0; k < steps; ++k) {
    Q.add(at(k, 0), at(k, 0), k + 1 < steps ? 4.0 : 2.0);  // x_0² + Σ (x_k+1 − x_k)²
    if (k + 1 < steps) {
      Q.add(at(k, 0), at(k + 1, 0), -2.0);
      Q.add(at(k + 1, 0), at(k, 0), -2.0);
    }
    for (Index place = 0; place < 2; ++place) {
      A.add(place, at(k, 1 + place), 1.0);
      const Index row = 2 * k + place;
      const double where = place == 0 ? 1.0 : -1.0;
      for (const double sign : {1.0, -1.0}) {
        const auto bound = static_cast<Index>(p.d.size());
        C.add(bound, at(k, 3 + place), 1.0);
        C.add(bound, at(k, 0), sign);
        p.d.push_back(-sign * where);
      }
      L.add(row, at(k, 1 + place), 1.0);
      R.add(row, at(k, 3 + place), 1.0);
    }
  }
  p.b.assign(2, -1.0);
  p.l.assign(static_cast<std::size_t>(2 * steps), 0.0);
  p.r = p.l;
  p.Q = compress(n, n, Q, "Q").value();
  p.A = compress(2, n, A, "A").value();
  p.C = compress(4 * steps, n, C, "C").value();
  p.L = compress(2 * steps, n, L, "L").value();
  p.R = compress(2 * steps, n, R, "R").value();
  return p;
}

TEST(Clauses, OfPlacesToBeAtSomeTimeAreBranchedOnAndTheProofIsThatOfAllBranches) {
  const OwnedProblem small = two_places(5);
  const auto best = testing::brute_force(small.view());
  ASSERT_TRUE(best);
  Options options;
  options.global_search = true;
  const Solution s = solve_in_process(small.view(), options).value();
  EXPECT_TRUE(s.proved) << s.detail;
  EXPECT_NEAR(s.objective, best->objective, 1e-6);
  EXPECT_LE(s.bound, best->objective + 1e-7);

  // Pair by pair this would take the more nodes the more steps there are to the power of two.
  const Solution large = solve_in_process(two_places(30).view(), options).value();
  EXPECT_TRUE(large.proved) << large.detail;
  EXPECT_LE(large.nodes, 1000) << large.detail;
}

}  // namespace
}  // namespace marble
