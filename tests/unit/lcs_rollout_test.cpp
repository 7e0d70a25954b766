// Roll-outs, and the small complementarity problems that they consist of.
#include <gtest/gtest.h>

#include <optional>

#include "lcs/small_lcp.h"
#include "lcs_systems.h"

namespace marble {
namespace {

using testing::numbers;
using testing::OwnedSystem;
using testing::random_system;
using testing::Rows;
using testing::Values;

std::optional<Eigen::VectorXd> solved(const Rows& M, const Eigen::VectorXd& q, SmallLcp::End* end = nullptr) {
  SmallLcp lcp;
  Eigen::VectorXd z(q.size());
  const SmallLcp::End ended = lcp.solve(SmallLcp::ConstMap(M.data(), M.rows(), M.cols()), q, z);
  if (end != nullptr) *end = ended;
  return ended == SmallLcp::End::solved ? std::optional(z) : std::nullopt;
}

double residual(const Rows& M, const Eigen::VectorXd& q, const Eigen::VectorXd& z) {
  return z.cwiseMin(M * z + q).cwiseAbs().maxCoeff();
}

// The only solution, by trying every set of positive unknowns.
std::optional<Eigen::VectorXd> enumerated(const Rows& M, const Eigen::VectorXd& q) {
  const Eigen::Index m = q.size();
  for (unsigned set = 0; set < 1u << m; ++set) {
    Rows system = Rows::Identity(m, m);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(m);
    for (Eigen::Index i = 0; i < m; ++i) {
      if ((set >> i & 1u) == 0) continue;
      system.row(i) = M.row(i);
      right[i] = -q[i];
    }
    const Eigen::VectorXd z = system.fullPivLu().solve(right);
    if (residual(M, q, z) < 1e-9) return z;
  }
  return std::nullopt;
}

TEST(SmallLcp, AgreesWithEnumeration) {
  for (unsigned seed = 0; seed < 200; ++seed) {
    const auto m = static_cast<Index>(1 + seed % 8);
    const OwnedSystem s = random_system(seed, 1, 1, m);
    const Eigen::Map<const Rows> M(s.F.data(), m, m);
    const Eigen::Map<const Eigen::VectorXd> q(s.c.data(), m);
    const auto z = solved(M, q), expected = enumerated(M, q);
    ASSERT_TRUE(z && expected) << seed;
    EXPECT_LT((*z - *expected).cwiseAbs().maxCoeff(), 1e-8 * (1.0 + expected->cwiseAbs().maxCoeff())) << seed;
  }
}

TEST(SmallLcp, SolvesLargerOnesToRounding) {
  for (unsigned seed = 0; seed < 100; ++seed) {
    const OwnedSystem s = random_system(1000 + seed, 1, 1, 40);
    const Eigen::Map<const Rows> M(s.F.data(), 40, 40);
    const Eigen::Map<const Eigen::VectorXd> q(s.c.data(), 40);
    const auto z = solved(M, q);
    ASSERT_TRUE(z) << seed;
    EXPECT_LT(residual(M, q, *z), 1e-10 * (1.0 + z->cwiseAbs().maxCoeff())) << seed;
  }
}

// Contacts with friction after Stewart and Trinkle: for each, a normal force, two of friction, and the
// sliding speed, whose rows of M are no longer positive semidefinite but copositive. All contacts are alike,
// so that every step of the method ties.
TEST(SmallLcp, EndsOnDegenerateContactsWithFriction) {
  const Index contacts = 4, m = 4 * contacts;
  for (const double normal_speed : {-1.0, 0.0, 1.0}) {
    Rows M = Rows::Zero(m, m);
    Eigen::VectorXd q = Eigen::VectorXd::Zero(m);
    for (Index i = 0; i < contacts; ++i) {
      for (Index j = 0; j < contacts; ++j) {
        M(4 * i, 4 * j) = 1.0;
        M(4 * i + 1, 4 * j + 1) = M(4 * i + 2, 4 * j + 2) = 1.0;
        M(4 * i + 1, 4 * j + 2) = M(4 * i + 2, 4 * j + 1) = -1.0;
      }
      M(4 * i + 1, 4 * i + 3) = M(4 * i + 2, 4 * i + 3) = 1.0;
      M(4 * i + 3, 4 * i) = 0.5;
      M(4 * i + 3, 4 * i + 1) = M(4 * i + 3, 4 * i + 2) = -1.0;
      q[4 * i] = normal_speed, q[4 * i + 1] = 0.25, q[4 * i + 2] = -0.25;
    }
    const auto z = solved(M, q);
    ASSERT_TRUE(z) << normal_speed;
    EXPECT_LT(residual(M, q, *z), 1e-12) << normal_speed;
  }
}

// The same with random contacts of a random body, of which two may be alike, and friction in two directions.
TEST(SmallLcp, SolvesRandomContactsWithFriction) {
  std::mt19937 random(21);
  for (int trial = 0; trial < 300; ++trial) {
    const Index contacts = 4, each = 6, m = each * contacts, speeds = 8;
    Values jacobian = numbers(random, static_cast<std::size_t>(3 * contacts * speeds));
    if (trial % 3 == 0)
      std::copy_n(jacobian.begin(), 3 * speeds, jacobian.begin() + 3 * speeds);  // two alike
    const Eigen::Map<const Rows> J(jacobian.data(), 3 * contacts, speeds);
    const Values free = numbers(random, static_cast<std::size_t>(speeds), trial % 2 == 0 ? 1e-2 : 1.0);
    Rows T = Rows::Zero(m, speeds), M = Rows::Zero(m, m);
    for (Index i = 0; i < contacts; ++i) {
      T.row(each * i + 1) = J.row(3 * i);
      for (Index side = 0; side < 2; ++side) {
        T.row(each * i + 2 + 2 * side) = J.row(3 * i + 1 + side);
        T.row(each * i + 3 + 2 * side) = -J.row(3 * i + 1 + side);
      }
    }
    M = T * T.transpose();
    Eigen::VectorXd q = T * Eigen::Map<const Eigen::VectorXd>(free.data(), speeds);
    for (Index i = 0; i < contacts; ++i) {
      M(each * i, each * i + 1) = 0.8;
      q[each * i + 1] += trial % 4 == 0 ? 0.0 : 0.1;  // the gap: at rest there is a solution
      for (Index j = 2; j < each; ++j) {
        M(each * i + j, each * i) = 1.0;
        M(each * i, each * i + j) = -1.0;
      }
    }
    const auto z = solved(M, q);
    ASSERT_TRUE(z) << trial;
    EXPECT_LT(residual(M, q, *z), 1e-8 * (1.0 + z->maxCoeff())) << trial;
  }
}

// Murty, "Linear Complementarity, Linear and Nonlinear Programming" (1988), 2.6: pivots by least index cycle.
TEST(SmallLcp, SolvesMurtysCyclingExample) {
  Rows M(3, 3);
  M << 1, 2, 0, 0, 1, 2, 2, 0, 1;
  const auto z = solved(M, Eigen::Vector3d(-1, -1, -1));
  ASSERT_TRUE(z);
  EXPECT_LT((*z - Eigen::Vector3d::Constant(1.0 / 3.0)).cwiseAbs().maxCoeff(), 1e-15);
}

TEST(SmallLcp, DoesNotDependOnUnits) {
  std::mt19937 random(11);
  for (unsigned seed = 0; seed < 50; ++seed) {
    const Index m = 6;
    const OwnedSystem s = random_system(300 + seed, 1, 1, m);
    const Eigen::Map<const Rows> M(s.F.data(), m, m);
    const Eigen::Map<const Eigen::VectorXd> q(s.c.data(), m);
    Eigen::VectorXd rows(m), columns(m);
    for (Index i = 0; i < m; ++i) {
      rows[i] = std::pow(10.0, static_cast<int>(random() % 17) - 8);
      columns[i] = std::pow(10.0, static_cast<int>(random() % 17) - 8);
    }
    const auto z = solved(M, q);
    const auto scaled = solved(rows.asDiagonal() * M * columns.asDiagonal(), rows.cwiseProduct(q));
    ASSERT_TRUE(z && scaled) << seed;
    EXPECT_LT((scaled->cwiseProduct(columns) - *z).cwiseAbs().maxCoeff(), 1e-8 * (1.0 + z->maxCoeff()))
        << seed;
  }
}

// As of contacts in the air, whose tangential speeds are zero but for rounding.
TEST(SmallLcp, TakesRoundingForZero) {
  const Eigen::Vector4d q(8.0, -4e-19, 4e-19, 0.0);
  Rows M = Rows::Zero(4, 4);
  M << 1, 0, 0, 0, 0, 1, -1, 1, 0, -1, 1, 1, 0.5, -1, -1, 0;
  const auto z = solved(M, q);
  ASSERT_TRUE(z);
  EXPECT_LT(z->maxCoeff(), 1e-15);
}

TEST(SmallLcp, ReportsARayAndNumbersThatOverflow) {
  SmallLcp::End end = SmallLcp::End::solved;
  EXPECT_FALSE(solved(Rows::Zero(1, 1), Eigen::VectorXd::Constant(1, -1.0), &end));
  EXPECT_EQ(end, SmallLcp::End::ray);
  EXPECT_FALSE(solved(-Rows::Identity(2, 2), Eigen::VectorXd::Constant(2, -1.0), &end));
  EXPECT_EQ(end, SmallLcp::End::ray);
  EXPECT_FALSE(solved(Rows::Identity(1, 1), Eigen::VectorXd::Constant(1, std::nan("")), &end));
  EXPECT_EQ(end, SmallLcp::End::not_finite);
}

TEST(Rollout, SatisfiesDynamicsAndComplementarity) {
  std::mt19937 random(5);
  for (unsigned seed = 0; seed < 100; ++seed) {
    const auto nx = static_cast<Index>(1 + seed % 5), nu = static_cast<Index>(1 + seed % 3),
               nl = static_cast<Index>(seed % 7);
    const OwnedSystem s = random_system(seed, nx, nu, nl, seed % 2 == 0 ? 8 : 0);
    const LCS lcs = LCS::create(s.view()).value();
    const Values x0 = numbers(random, static_cast<std::size_t>(nx));
    const Values u = numbers(random, 8 * static_cast<std::size_t>(nu));
    const auto made = rollout(lcs, x0, u);
    ASSERT_TRUE(made.has_value()) << seed << ": " << made.error().message();
    EXPECT_EQ(Values(made->x.begin(), made->x.begin() + nx), x0);
    EXPECT_EQ(made->u, u);
    double size = 1.0;
    for (const double value : made->x) size = std::max(size, std::abs(value));
    for (const double value : made->lam) size = std::max(size, std::abs(value));
    EXPECT_LT(testing::residual(s, *made), 1e-11 * size) << seed;
  }
}

TEST(Rollout, NamesTheStageWhereTheMethodEndsInARay) {
  OwnedSystem s = random_system(9, 2, 1, 1, 5);
  s.E.assign(5 * 2, 0.0), s.H.assign(5, 0.0), s.F.assign(5, 1.0), s.c.assign(5, 1.0);
  s.F[3] = 0.0, s.c[3] = -1.0;  // λ ⊥ −1 ≥ 0
  const LCS lcs = LCS::create(s.view()).value();
  const Error error = rollout(lcs, Values(2, 0.0), Values(5, 0.0)).error();
  EXPECT_EQ(error.code, ErrorCode::failed_precondition);
  EXPECT_EQ(error.field, "stages");
  EXPECT_EQ(error.index, 3);
  EXPECT_NE(error.bound.find("ended in a ray"), std::string::npos);
}

TEST(Rollout, ReportsStatesThatOverflow) {
  OwnedSystem s = random_system(9, 1, 1, 0);
  s.A = {1e200};
  const LCS lcs = LCS::create(s.view()).value();
  const Error error = rollout(lcs, Values{1e200}, Values(3, 0.0)).error();
  EXPECT_EQ(error.message(), "stages[0]: the state or lambda overflows");
}

TEST(Rollout, RefusesBadArguments) {
  const OwnedSystem s = random_system(10, 2, 2, 1, 4);
  const LCS lcs = LCS::create(s.view()).value();
  EXPECT_EQ(rollout(lcs, Values(3), Values(8)).error().field, "x0");
  EXPECT_EQ(rollout(lcs, Values(2), Values(6)).error().message(),
            "u = 6: must have 4 (stages) times 2 entries");
  Values u(8);
  u[5] = std::nan("");
  EXPECT_EQ(rollout(lcs, Values(2), u).error().message(), "u[2][1] = nan: must be finite");
}

}  // namespace
}  // namespace marble
