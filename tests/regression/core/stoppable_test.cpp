// Symptom: a solve that its client had cancelled, or whose time limit had passed, kept its worker for
// minutes, and SIGTERM did not end the server: n = 11,000, a random sparse Q, a time limit of 1 s, 58 s of
// work.
//
// Ordering, symbolic analysis, numeric factorization and back-substitution each were one call that nothing
// could interrupt; the stop token and the time limit were looked at between iterations only. A factor of more
// than 2³¹ entries overflowed its count and looked small.
#include <gtest/gtest.h>

#include <thread>

#include "kkt/dense_kkt.h"
#include "kkt/elimination.h"
#include "kkt/ordering.h"
#include "kkt/sparse_ldl.h"
#include "marble/solver.h"
#include "support/random_problem.h"

namespace marble {
namespace {

using testing::filling_problem;

Pattern pattern_of(const OwnedProblem& p) { return {p.Q.column_pointers, p.Q.row_indices}; }

class Stopped : public ::testing::Test {
 protected:
  Stopped() { source_.request_stop(); }
  std::stop_source source_;
  const Interrupt stop_{source_.get_token()};
};

TEST_F(Stopped, OrderingEndsAtItsNextLook) {
  const Pattern pattern = pattern_of(filling_problem(20'000));
  std::vector<Index> permutation;
  EXPECT_FALSE(order(pattern, stop_, permutation));
  EXPECT_TRUE(order(pattern, {}, permutation));
}

TEST_F(Stopped, SymbolicAnalysisEndsAtItsNextLook) {
  const Pattern pattern = pattern_of(filling_problem(100'000));
  Elimination elimination;
  EXPECT_FALSE(analyse(pattern, stop_, elimination));
}

TEST_F(Stopped, FactorizationAndSubstitutionEndAtTheirNextLookAndLeaveNothingBehind) {
  const OwnedProblem problem = filling_problem(3'000);
  const Pattern pattern = pattern_of(problem);
  SparseLdl ldl;
  ASSERT_TRUE(ldl.analyse(pattern, {}));
  ASSERT_FALSE(ldl.allocate(stop_));
  ASSERT_TRUE(ldl.allocate({}));
  std::vector<double> values(pattern.rows.size());
  for (std::size_t k = 0; k < values.size(); ++k) values[ldl.places()[k]] = problem.Q.values[k];

  const auto solved = [&] {
    std::vector<double> x(static_cast<std::size_t>(pattern.size()), 1.0);
    EXPECT_TRUE(ldl.solve(x.data(), 0, {}));
    return x;
  };
  ASSERT_TRUE(ldl.factorize(values, {}));
  const std::vector<double> expected = solved();
  EXPECT_FALSE(ldl.factorize(values, stop_));
  ASSERT_TRUE(ldl.factorize(values, {}));
  EXPECT_EQ(solved(), expected) << "to the last bit, whatever was stopped before";
  std::vector<double> x(expected.size(), 1.0);
  EXPECT_FALSE(ldl.solve(x.data(), 0, stop_));
}

TEST_F(Stopped, ADenseFactorizationEndsBetweenItsPanels) {
  const OwnedProblem problem = testing::random_problem(
      {.variables = 1'600, .equalities = 1, .inequalities = 1, .pairs = 1, .density = 0.01}, 1);
  const ScaledProblem p = scale(Problem::create(problem.view()).value(), 1);
  DenseKkt kkt(p);
  ASSERT_TRUE(kkt.allocate(p));
  RowWeights weights(p);
  weights.delta = 1.0;
  weights.rows.inequality().setOnes();
  weights.rows.s().setOnes();
  weights.rows.t().setOnes();
  weights.cosine.setOnes();
  weights.sine.setZero();
  kkt.attend(stop_);
  EXPECT_FALSE(kkt.factor(weights));
  kkt.attend({});
  ASSERT_TRUE(kkt.factor(weights));
  Vector x = Vector::Ones(p.variables());
  Vector y = Vector::Zero(p.equalities());
  ASSERT_TRUE(kkt.solve(x, y));
  // The first row of the system, back again.
  Vector f(p.variables());
  multiply(p.Q, x, f);
  f += weights.delta * x;
  add_transposed(p.A, y, f);
  Vector images(p.layout.size());
  multiply(p.rows, x, images);
  add_transposed(p.rows, images, f);
  EXPECT_LT((f - Vector::Ones(p.variables())).lpNorm<Eigen::Infinity>(), 1e-9);
}

// Minutes of factorization lie ahead when the token is triggered, by another thread.
TEST(Stoppable, ASolveIsCancelledWithinItsFirstFactorization) {
  const OwnedProblem p = filling_problem(16'000);
  const Problem problem = Problem::create(p.view()).value();
  std::stop_source source;
  std::jthread stopper;
  const auto stop_soon = [&](const Solver&) { stopper = std::jthread([&] { source.request_stop(); }); };
  const auto solution = solve_once(problem, {}, {.stop = source.get_token()}, {}, stop_soon);
  ASSERT_TRUE(solution.has_value());
  EXPECT_EQ(solution->status, Status::cancelled);
  EXPECT_EQ(solution->iterations, 0);
  EXPECT_LE(solution->factorizations, 1);
  EXPECT_EQ(solution->z.size(), p.g.size());
}

TEST(Stoppable, ASetUpThatIsStoppedIsAnsweredWithTheInitialPoint) {
  const OwnedProblem p = filling_problem(16'000);
  const Problem problem = Problem::create(p.view()).value();
  const std::vector<double> z(p.g.size(), 2.0);
  std::stop_source source;
  source.request_stop();
  auto solution = solve_once(problem, {}, {.stop = source.get_token(), .initial_z = z});
  ASSERT_TRUE(solution.has_value());
  EXPECT_EQ(solution->status, Status::cancelled);
  EXPECT_EQ(solution->factorizations, 0);
  EXPECT_EQ(solution->z, z);
  EXPECT_GT(solution->kkt_residual, 0.0);
  EXPECT_NE(solution->objective, 0.0);

  Options options;
  options.time_limit_s = 0.0;
  const OwnedProblem lighter = filling_problem(6'000);  // not refused for its flops
  solution = solve_once(Problem::create(lighter.view()).value(), options);
  ASSERT_TRUE(solution.has_value());
  EXPECT_EQ(solution->status, Status::time_limit);
  EXPECT_EQ(solution->factorizations, 0);
  EXPECT_EQ(Solver::create(problem, {}, {.stop = source.get_token()}).error().code, ErrorCode::cancelled);
}

TEST(Stoppable, AFactorizationThatCannotFitItsTimeIsRefusedWithItsFlops) {
  const OwnedProblem p = filling_problem(80'000);
  const Problem problem = Problem::create(p.view()).value();
  Options options;
  options.time_limit_s = 20.0;  // far more than the set-up takes
  auto refused = solve_once(problem, options);
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().code, ErrorCode::resource_exhausted);
  EXPECT_NE(refused.error().message().find("flops"), std::string::npos) << refused.error().message();
  EXPECT_NE(refused.error().message().find("time limit of 20 s"), std::string::npos)
      << refused.error().message();
  refused = solve_once(problem, {}, {}, {.most_factorization_s = 25.0});
  ASSERT_FALSE(refused.has_value());
  EXPECT_NE(refused.error().message().find("25 s"), std::string::npos) << refused.error().message();
}

// The first row eliminated is connected to all: everything fills in.
TEST(Stoppable, EntriesBeyondTwoToThe31AreCounted) {
  constexpr Index kSize = 70'000;
  Pattern star{{0}, {}};
  for (Index column = 0; column < kSize; ++column) {
    if (column > 0) star.rows.push_back(0);
    star.rows.push_back(column);
    star.pointers.push_back(static_cast<Index>(star.rows.size()));
  }
  Elimination elimination;
  ASSERT_TRUE(analyse(star, {}, elimination));
  EXPECT_EQ(elimination.entries, 0.5 * kSize * (kSize - 1.0));
  EXPECT_GT(elimination.flops, 1e14);
}

}  // namespace
}  // namespace marble
