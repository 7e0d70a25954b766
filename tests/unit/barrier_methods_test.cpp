// l1_barrier, its kin and aladin_beta: their pieces against differences and dense solves, and where they end.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "dense_system.h"
#include "marble/research/methods.h"
#include "random_setting.h"
#include "research/aladin_beta.h"
#include "research/newton_system.h"
#include "research/tuning.h"
#include "research_problems.h"
#include "support/dense_algebra.h"
#include "workbench.h"

namespace marble {
namespace {

using State = ReferenceMethod::State;
using Schedule = L1Barrier::Schedule;
using testing::two_sides;
using testing::Workbench;

State run_to_end(ReferenceMethod& method, Workbench& w, ConstVectorRef from, int most = 500) {
  method.start(from);
  State state = State::going_on;
  for (int i = 0; i < most && state == State::going_on; ++i) state = method.step(w.run);
  return state;
}

TEST(PairBlock, IsTurnedToTheWeightsOfTheSameMatrix) {
  const OwnedProblem p = two_sides(1.0);
  const ScaledProblem problem = testing::scaled(p, 0);
  for (const double xi : {-3.0, 0.0, 0.7}) {
    for (const double weight : {0.0, 2.0, 1e6}) {
      RowWeights weights(problem);
      const PairBlock block(0.3, 1.7, 2.0, 0.5, xi, weight);
      block.put(0, weights);
      const double c = weights.cosine[0], s = weights.sine[0];
      const double first = weights.rows.s()[0], second = weights.rows.t()[0];
      const double size = 1e-9 * (1.0 + weight);
      EXPECT_NEAR(first * c * c + second * s * s, 2.0 + weight * 1.7 * 1.7, size);
      EXPECT_NEAR((first - second) * c * s, xi + weight * 0.3 * 1.7, size);
      EXPECT_NEAR(first * s * s + second * c * c, 0.5 + weight * 0.3 * 0.3, size);
      EXPECT_NEAR(first * second, block.determinant, size * (1.0 + weight));
    }
  }
}

// The multiplier of the product is the derivative of what p and n cost.
TEST(L1Barrier, ElasticVariablesAreWhereTheirBarrierIsLeast) {
  const auto cost = [](double v, double rho, double mu) {
    const L1Barrier::Elastic e(v, rho, mu);
    return rho * (e.p + e.n) - mu * (std::log(e.p) + std::log(e.n));
  };
  for (const double rho : {1.0, 100.0}) {
    for (const double mu : {10.0, 1e-3}) {
      for (const double v : {0.01, 0.5, 2.0}) {
        const L1Barrier::Elastic e(v, rho, mu);
        EXPECT_GT(e.n, 0.0);
        EXPECT_NEAR(e.p - e.n, v, 1e-12 * (1.0 + e.p));
        EXPECT_NEAR(mu / e.p + mu / e.n, 2.0 * rho, 1e-9 * rho);
        const double h = 1e-3 * v;
        const double slope = (cost(v + h, rho, mu) - cost(v - h, rho, mu)) / (2.0 * h);
        EXPECT_NEAR(slope, rho - mu / e.p, 1e-5 * rho) << v;
      }
    }
  }
}

// Of (0, 2) no κ is smaller than q/2: f + ρxy has its minimum there from ρ = q/2 on, and before it at x > 0.
TEST(L1Barrier, IsExactOnceThePenaltyIsAsLargeAsTheMultiplier) {
  const double rho = tuning::barrier_rho_most_stepwise;
  for (const double q : {1.5 * rho, 2.5 * rho}) {
    Workbench w(two_sides(q), {.scaling_passes = 0});
    L1Barrier method(w.problem, *w.kkt, w.options, Schedule::every_step);
    const State state = run_to_end(method, w, w.zero());
    const auto z = w.user(method.iterate().z());
    const bool exact = 0.5 * q < rho;
    EXPECT_EQ(state, exact ? State::ended : State::given_up);
    const double inside = 1.0 - rho * rho / (q * q);
    EXPECT_NEAR(z[0], exact ? 0.0 : (1.0 - 2.0 * rho / q) / inside, 1e-6);
    EXPECT_NEAR(z[1], exact ? 2.0 : (2.0 - rho / q) / inside, 1e-6);
    EXPECT_EQ(method.penalty(), rho);
  }
}

TEST(L1Barrier, MovesItsParametersAfterAStepOrAfterAProblem) {
  Workbench w(two_sides(1.0), {.scaling_passes = 0});
  L1Barrier stepwise(w.problem, *w.kkt, w.options, Schedule::every_step);
  stepwise.start(w.zero());
  for (int k = 1; k <= 3; ++k) {
    ASSERT_EQ(stepwise.step(w.run), State::going_on);
    EXPECT_NEAR(stepwise.relaxation(), 10.0 * std::pow(0.2, k), 1e-12);
    EXPECT_EQ(stepwise.penalty(), std::min(10.0 * std::pow(4.0, k), tuning::barrier_rho_most_stepwise));
  }
  L1Barrier by_problem(w.problem, *w.kkt, w.options, Schedule::every_problem);
  by_problem.start(w.zero());
  int steps = 0;
  for (double mu = by_problem.relaxation(); by_problem.step(w.run) == State::going_on; ++steps) {
    const double now = by_problem.relaxation();
    EXPECT_TRUE(now == mu || now == 0.2 * mu) << now;
    mu = now;
  }
  EXPECT_GT(steps, 12) << "more steps than problems";
}

TEST(PlainBarrier, ReachesAMinimumWithoutAPenalty) {
  Workbench w(two_sides(1.0), {.scaling_passes = 0});
  L1Barrier method(w.problem, *w.kkt, w.options, Schedule::no_penalty);
  static_cast<void>(run_to_end(method, w, w.zero()));
  const auto z = w.user(method.iterate().z());
  EXPECT_NEAR(std::min(z[0], z[1]), 0.0, 1e-9);
  EXPECT_NEAR(std::min(std::abs(z[0] - 1.0), std::abs(z[1] - 2.0)), 0.0, 1e-6);
  EXPECT_EQ(method.penalty(), 0.0);
}

TEST(AladinBeta, ACopyIsTheMinimumOfItsBarrierWithItsDerivativesThere) {
  const double r = 0.1, sigma = tuning::aladin_sigma;
  for (const double x : {-0.05, 0.3, 4.0}) {
    for (const double lambda : {-20.0, 0.0, 5.0}) {
      for (const double cost : {0.0, 10.0}) {
        const double mu = 0.5;
        const AladinBeta::Copy copy(x, lambda, cost, mu, r);
        const auto slope = [&](double beta) { return cost - mu / (r + beta); };
        ASSERT_GT(copy.value, -r);
        EXPECT_NEAR(slope(copy.value) - lambda + sigma * (copy.value - x), 0.0, 1e-9);
        EXPECT_NEAR(copy.slope, slope(copy.value), 1e-9) << "(15b)";
        const double h = 1e-6 * (r + copy.value);
        EXPECT_NEAR(copy.curvature, (slope(copy.value + h) - slope(copy.value - h)) / (2.0 * h),
                    1e-5 * copy.curvature)
            << "(16b), (16c)";
      }
    }
  }
  EXPECT_EQ(AladinBeta::Copy(0.0, -1.0, 0.0, 1e-14, 1e-14).curvature, tuning::scale_range);
}

// (17) as one dense system: of dz, dq, dm, y and the multiplier of the linearized products.
TEST(SplitStep, IsTheSolutionOfTheWholeQp) {
  for (const auto& sizes : testing::all_shapes()) {
    const testing::Setting setting(sizes, 7);
    const ScaledProblem& p = setting.problem;
    const Index n = p.variables(), rows = p.layout.size(), pairs = p.pairs(), n_e = p.equalities();
    Iterate point(p);
    point.z() = setting.x.z();
    point.y() = setting.x.y();
    Images at(p);
    at.evaluate(p, point);
    testing::RandomVectors random(3);
    const Vector curvature = random.next(rows + 2 * pairs).cwiseAbs().array() + 1.0;
    const Vector slope = random.next(rows + 2 * pairs), product = random.next(pairs);
    const Vector coupling = 0.5 * random.next(pairs);
    const Eigen::MatrixXd J = testing::dense(p.rows), A = testing::dense(p.A);
    const auto L = J.middleRows(p.layout.inequalities, pairs), R = J.bottomRows(pairs);
    Eigen::MatrixXd T = at.rows.t().asDiagonal() * L;
    T += at.rows.s().asDiagonal() * R;
    Eigen::MatrixXd K = Eigen::MatrixXd::Zero(n + 2 * pairs + n_e + pairs, n + 2 * pairs + n_e + pairs);
    K.topLeftCorner(n, n) = testing::dense(p.Q) + J.transpose() * curvature.head(rows).asDiagonal() * J;
    K.topLeftCorner(n, n) +=
        L.transpose() * coupling.asDiagonal() * R + R.transpose() * coupling.asDiagonal() * L;
    Vector right(K.rows());
    right.head(n) = -at.stationarity - J.transpose() * slope.head(rows);
    for (Index k = 0; k < 2 * pairs; ++k) {
      const Index q = n + k, last = n + 2 * pairs + n_e + k % pairs;
      K(q, q) = curvature[rows + k];
      K(q, last) = K(last, q) = k < pairs ? -1.0 : 1.0;
      right[q] = -slope[rows + k];
    }
    K.block(n + 2 * pairs, 0, n_e, n) = A;
    K.block(0, n + 2 * pairs, n, n_e) = A.transpose();
    right.segment(n + 2 * pairs, n_e) = -at.equality;
    K.bottomLeftCorner(pairs, n) = T;
    K.topRightCorner(n, pairs) = T.transpose();
    right.tail(pairs) = -product;
    const Vector expected = testing::dense_solve(K, right);
    for (const auto& kkt : testing::backends(p)) {
      const Options options;
      SplitStep qp(p, *kkt, options);
      qp.curvature = curvature, qp.slope = slope, qp.coupling = coupling, qp.product = product;
      const SolveControls controls;
      marble::Run run(options, controls);
      ASSERT_TRUE(qp.solve(run, at)) << kkt->name();
      const double tolerance = 1e-5 * (1.0 + max_abs(expected));
      EXPECT_LT(max_abs(qp.z_step - expected.head(n)), tolerance) << kkt->name();
      EXPECT_LT(max_abs(qp.step.tail(2 * pairs) - expected.segment(n, 2 * pairs)), tolerance) << kkt->name();
      EXPECT_LT(max_abs(qp.step.head(rows) - J * expected.head(n)), tolerance) << kkt->name();
      EXPECT_LT(max_abs(qp.multiplier - expected.tail(pairs)), tolerance) << kkt->name();
    }
  }
}

TEST(AladinBeta, ReachesAMinimumItselfAndItsThreeProblemsAgreeThere) {
  Workbench w(two_sides(1.0), {.scaling_passes = 0});
  AladinBeta method(w.problem, *w.kkt, w.options);
  EXPECT_EQ(run_to_end(method, w, w.zero()), State::ended);
  EXPECT_EQ(method.remark(), "");
  EXPECT_LE(method.coupling_gap(), 1e-6);
  EXPECT_LE(w.judged(method.iterate().z()).infeasibility(), 1e-6);
  EXPECT_LE(max_abs(w.images(method.iterate()).stationarity), 1e-6);
}

// In exact arithmetic x = y for ever, down to the corner; rounding alone would choose.
TEST(AladinBeta, ReportsEqualSidesApart) {
  OwnedProblem p = two_sides(1.0);
  p.g = {-1.0, -1.0};
  const std::vector<double> start = {1.0, 1.0};
  for (const Method method : {Method::aladin_beta, Method::l1_barrier, Method::l1_barrier_stepwise}) {
    const Solution s =
        research::solve_in_process(p.view(), {.scaling_passes = 0, .method = method}, {.initial_z = start})
            .value();
    EXPECT_EQ(s.status, Status::solved) << s.detail;
    EXPECT_NEAR(s.z[0], 1.0, 1e-5) << s.detail;
    EXPECT_NEAR(s.z[1], 0.0, 1e-5) << s.detail;
  }
}

TEST(AladinBeta, WhereItsMeritRisesThePenaltyBarrierGoesOnAndItSaysSo) {
  int solved = 0, fallen_back = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const OwnedProblem p = testing::random_problem({}, seed);
    const Solution s = research::solve_in_process(p.view(), {.method = Method::aladin_beta}).value();
    fallen_back += s.detail.find("l1_barrier went on from the best point") != std::string::npos;
    solved += s.status == Status::solved;
    if (s.status == Status::solved) {
      EXPECT_LE(testing::judge(p.view(), s).infeasibility(), 2e-6) << s.detail;
    }
  }
  EXPECT_GE(solved, 8);
  EXPECT_GE(fallen_back, 1);
}

TEST(AladinBeta, ASystemWithoutASolutionEndsItAndTheFallbackAsFailed) {
  Workbench w(two_sides(1.0), {.scaling_passes = 0});
  testing::FailingKkt failing(*w.kkt, 5);
  AladinBeta method(w.problem, failing, w.options);
  EXPECT_EQ(run_to_end(method, w, w.zero()), State::failed);
  EXPECT_TRUE(method.remark().starts_with("a system of it had no solution after ")) << method.remark();
}

}  // namespace
}  // namespace marble
