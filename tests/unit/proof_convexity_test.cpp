// What second-order tests rely on: Q is looked at once, by one factorization at most, until it changes.
#include <gtest/gtest.h>

#include "proof/convexity.h"
#include "workbench.h"

namespace marble {
namespace {

using testing::FailingKkt;
using testing::Rows;
using testing::Workbench;

// ½zᵀ[a b; b c]z, unscaled, with a pair so that it is a problem at all.
OwnedProblem quadratic(double a, double b, double c) {
  OwnedProblem p;
  p.g = {0.0, 0.0};
  p.Q = compress(2, 2, {{0, 0, 1, 1}, {0, 1, 0, 1}, {a, b, b, c}}, "Q").value();
  p.L = compress(1, 2, {{0}, {0}, {1.0}}, "L").value();
  p.R = compress(1, 2, {{0}, {1}, {1.0}}, "R").value();
  p.l = p.r = {0.0};
  return p;
}

TEST(Convexity, OfADiagonallyDominantQIsKnownAtNoCost) {
  Workbench w(quadratic(2.0, -1.0, 1.0));
  Convexity convexity(w.problem, *w.kkt);
  EXPECT_TRUE(convexity.known());
  EXPECT_TRUE(convexity.decide(w.run));
  EXPECT_EQ(w.run.factorizations, 0);
}

TEST(Convexity, OfOthersIsDecidedByOneFactorization) {
  for (const double c : {5.0, 1.0}) {  // 4 makes it singular
    Workbench w(quadratic(1.0, 2.0, c));
    Convexity convexity(w.problem, *w.kkt);
    EXPECT_FALSE(convexity.known()) << "not yet";
    EXPECT_EQ(w.run.factorizations, 0);
    EXPECT_EQ(convexity.decide(w.run), c > 4.0);
    EXPECT_EQ(convexity.known(), c > 4.0);
    EXPECT_EQ(convexity.decide(w.run), c > 4.0);
    EXPECT_EQ(w.run.factorizations, 1) << "once for all solves with it";
  }
}

TEST(Convexity, IsDecidedAnewForNewValues) {
  Workbench w(quadratic(1.0, 2.0, 5.0));
  Convexity convexity(w.problem, *w.kkt);
  EXPECT_TRUE(convexity.decide(w.run));
  for (double& value : w.problem.Q.values) value = -value;
  w.kkt->load(w.problem);
  convexity.forget();
  EXPECT_FALSE(convexity.known());
  EXPECT_FALSE(convexity.decide(w.run));
  EXPECT_EQ(w.run.factorizations, 2);
}

TEST(Convexity, NeedsNoFactorizationWhereOneHasShownNegativeCurvature) {
  Workbench w(quadratic(1.0, 2.0, 1.0));
  Convexity convexity(w.problem, *w.kkt);
  w.run.nonconvex = true;
  EXPECT_FALSE(convexity.decide(w.run));
  EXPECT_EQ(w.run.factorizations, 0);
}

TEST(Convexity, IsNotDecidedByAFactorizationThatWasInterrupted) {
  Rows rows;
  Workbench w(quadratic(1.0, 2.0, 5.0), {}, &rows);
  FailingKkt kkt(*w.kkt, 1, &rows.source);
  Convexity convexity(w.problem, kkt);
  EXPECT_FALSE(convexity.decide(w.run));
  const SolveControls controls;
  marble::Run later(w.options, controls);
  static_cast<void>(convexity.decide(later));
  EXPECT_EQ(later.factorizations, 1) << "it is looked at again";
}

}  // namespace
}  // namespace marble
