#include "path/certificate.h"

#include <gtest/gtest.h>

#include <initializer_list>
#include <limits>

#include "dense_system.h"
#include "marble/solver.h"
#include "random_setting.h"

namespace marble {
namespace {

OwnedProblem one_variable(double gradient) {
  OwnedProblem p;
  p.g = {gradient};
  return p;
}

void add_inequality(OwnedProblem& p, const std::vector<std::pair<double, double>>& rows) {
  Triplets entries;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    entries.add(static_cast<Index>(i), 0, rows[i].first);
    p.d.push_back(rows[i].second);
  }
  p.C = compress(static_cast<Index>(rows.size()), 1, entries, "C").value();
}

TEST(Certificate, ContradictoryBoundsAreProvedInfeasible) {
  OwnedProblem p = one_variable(1.0);
  add_inequality(p, {{1.0, -2.0}, {-1.0, 1.0}});  // z ≥ 2 and z ≤ 1
  const Solution s = solve_in_process(p.view()).value();
  ASSERT_EQ(s.status, Status::infeasible) << s.detail;
  ASSERT_EQ(s.certificate.size(), 2U);
  // −Cᵀν = 0 and −dᵀν = 1 with ν ≥ 0: for every z, 0 ≤ νᵀ(Cz + d) = −1.
  EXPECT_GE(s.certificate[0], 0.0);
  EXPECT_GE(s.certificate[1], 0.0);
  EXPECT_NEAR(s.certificate[0] - s.certificate[1], 0.0, 1e-5);
  EXPECT_NEAR(2.0 * s.certificate[0] - s.certificate[1], 1.0, 1e-5);
}

TEST(Certificate, ALinearCostWithoutBoundIsUnboundedAndSaysWhere) {
  OwnedProblem p = one_variable(-1.0);
  add_inequality(p, {{1.0, 0.0}});  // z ≥ 0, min −z
  const Solution s = solve_in_process(p.view()).value();
  ASSERT_EQ(s.status, Status::unbounded) << s.detail;
  ASSERT_EQ(s.certificate.size(), 1U);
  EXPECT_DOUBLE_EQ(s.certificate[0], 1.0);
}

// Farkas by plain loops over the user's own data: for a certificate (y, ν, ξ, η) the combination
// yᵀ(Az + b) − νᵀ(Cz + d) − ξᵀ(Lz + l) − ηᵀ(Rz + r) is 1 for every z, yet no feasible z can make it positive.
void expect_proof(const OwnedProblem& p, const std::vector<double>& certificate, double tolerance) {
  ASSERT_EQ(certificate.size(), p.b.size() + p.d.size() + p.l.size() + p.r.size());
  std::vector<double> combination(p.g.size(), 0.0);
  double constant = 0.0;
  std::size_t next = 0;
  const auto add = [&](const SparseMatrix& m, const std::vector<double>& offset, double sign) {
    for (std::size_t i = 0; i < offset.size(); ++i) {
      if (sign < 0.0) {
        EXPECT_GE(certificate[next + i], 0.0);
      }
      constant += sign * offset[i] * certificate[next + i];
    }
    for (Index j = 0; j < m.columns; ++j) {
      for (Index k = m.column_pointers[j]; k < m.column_pointers[j + 1]; ++k)
        combination[j] += sign * m.values[k] * certificate[next + m.row_indices[k]];
    }
    next += offset.size();
  };
  add(p.A, p.b, 1.0);
  add(p.C, p.d, -1.0);
  add(p.L, p.l, -1.0);
  add(p.R, p.r, -1.0);
  EXPECT_NEAR(constant, 1.0, tolerance);
  for (const double entry : combination) EXPECT_NEAR(entry, 0.0, tolerance);
}

SparseMatrix row(std::initializer_list<double> values) {
  Triplets entries;
  Index column = 0;
  for (const double value : values) entries.add(0, column++, value);
  return compress(1, column, entries, "row").value();
}

// z₁ = −1, 0 ≤ z₁ ⊥ z₂ ≥ 0.
OwnedProblem contradicted_pair() {
  OwnedProblem p;
  p.g = {0.0, 0.0};
  p.A = row({1.0, 0.0});
  p.b = {1.0};
  p.L = row({1.0, 0.0});
  p.R = row({0.0, 1.0});
  p.l = p.r = {0.0};
  return p;
}

TEST(Certificate, MultipliersThatProveContradictionAreScaledToAProof) {
  const OwnedProblem owned = contradicted_pair();
  for (const int passes : {0, 10}) {
    const ScaledProblem p = testing::scaled(owned, passes);
    Iterate x(p);
    x.y()[0] = 1e6;
    x.lambda_L()[0] = -1e6;
    const auto proof = infeasibility_certificate(p, x);
    ASSERT_TRUE(proof.has_value());
    expect_proof(owned, proof->multipliers, 1e-12);
    EXPECT_GT(proof->radius, 1e12);
  }
}

TEST(Certificate, MultipliersThatAlmostProveItDoNot) {
  const ScaledProblem p = testing::scaled(contradicted_pair());
  Iterate x(p);
  x.y()[0] = 1e6;
  EXPECT_FALSE(infeasibility_certificate(p, x).has_value()) << "the combination depends on z";
  x.lambda_L()[0] = -0.99e6;
  EXPECT_FALSE(infeasibility_certificate(p, x).has_value()) << "it still does";
  x.lambda_L()[0] = -1e6;
  x.lambda_R()[0] = 1e6;
  EXPECT_FALSE(infeasibility_certificate(p, x).has_value())
      << "a multiplier that only complementarity allows";
  x.all.setZero();
  EXPECT_FALSE(infeasibility_certificate(p, x).has_value());
  x.all.setConstant(std::numeric_limits<double>::quiet_NaN());
  EXPECT_FALSE(infeasibility_certificate(p, x).has_value());
}

TEST(Certificate, NoMultipliersProveAFeasibleProblemInfeasible) {
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    testing::Setting s({.variables = 3, .equalities = 2, .inequalities = 3, .pairs = 2}, seed);
    s.x.all *= 1e7;
    EXPECT_FALSE(infeasibility_certificate(s.problem, s.x).has_value()) << seed;
  }
}

TEST(Certificate, RandomProblemsWithContradictoryRowsAreNeverSolvedAndMostlyProvedInfeasible) {
  for (const Path path : {Path::fast, Path::paper}) {
    int proved = 0;
    for (std::uint64_t seed = 1; seed <= 40; ++seed) {
      OwnedProblem p = testing::random_problem({}, seed);
      // Row 0 of C says C₀z + d₀ ≥ 0; the new row says C₀z + d₀ ≤ −1.
      Triplets entries;
      const auto rows = static_cast<Index>(p.d.size());
      for (Index j = 0; j < p.C.columns; ++j) {
        for (Index k = p.C.column_pointers[j]; k < p.C.column_pointers[j + 1]; ++k) {
          entries.add(p.C.row_indices[k], j, p.C.values[k]);
          if (p.C.row_indices[k] == 0) entries.add(rows, j, -p.C.values[k]);
        }
      }
      p.C = compress(rows + 1, p.C.columns, entries, "C").value();
      p.d.push_back(-p.d[0] - 1.0);
      Options options;
      options.path = path;
      const Solution s = solve_in_process(p.view(), options).value();
      EXPECT_FALSE(is_solved(s.status)) << seed << ": " << s.detail;
      EXPECT_NE(s.status, Status::unbounded) << seed;
      EXPECT_EQ(s.certificate.empty(), s.status != Status::infeasible) << seed;
      if (s.status != Status::infeasible) continue;
      ++proved;
      expect_proof(p, s.certificate, 1e-4);
    }
    EXPECT_GE(proved, 35) << option_table()[0].choices[static_cast<std::size_t>(path)];
  }
}

TEST(Certificate, APieceThatIsInfeasibleDoesNotProveTheRelaxationInfeasible) {
  // 0 ≤ z ⊥ z ≥ 0 and z ≥ 1: the relaxation has z = 1, the problem nothing.
  OwnedProblem p = one_variable(0.0);
  add_inequality(p, {{1.0, -1.0}});
  p.L = p.R = row({1.0});
  p.l = p.r = {0.0};
  for (const Path path : {Path::fast, Path::paper}) {
    Options options;
    options.path = path;
    const Solution s = solve_in_process(p.view(), options).value();
    EXPECT_FALSE(is_solved(s.status)) << s.detail;
    EXPECT_TRUE(s.certificate.empty());
    // A tree proves it of both branches; the paper's path has none.
    EXPECT_EQ(s.status == Status::infeasible, path == Path::fast) << s.detail;
  }
}

// min −z₁ s.t. 0 ≤ z₁ ⊥ z₂ ≥ 0, in units that differ by 1e4.
OwnedProblem unbounded_pair() {
  OwnedProblem p;
  p.g = {-1.0, 0.0};
  p.L = row({1e2, 0.0});
  p.R = row({0.0, 1e-2});
  p.l = p.r = {0.0};
  return p;
}

TEST(Certificate, ADirectionOfDescentThatKeepsEveryConstraintIsUnbounded) {
  for (const int passes : {0, 10}) {
    const ScaledProblem p = testing::scaled(unbounded_pair(), passes);
    Iterate x(p);
    x.z()[0] = 1e9;
    EXPECT_TRUE(seems_unbounded(p, x));
    const auto d = unbounded_direction(p, x.z());
    ASSERT_TRUE(d.has_value());
    EXPECT_EQ(*d, (std::vector{1.0, 0.0}));
    x.z()[1] = 1e-3;
    EXPECT_TRUE(seems_unbounded(p, x));
    EXPECT_FALSE(unbounded_direction(p, x.z()).has_value()) << "both sides grow, if one slowly";
  }
}

TEST(Certificate, ADirectionThatBreaksAConstraintOrCostsIsNot) {
  const ScaledProblem p = testing::scaled(unbounded_pair());
  Iterate x(p);
  x.z() << 1e9, 1e8;
  EXPECT_FALSE(unbounded_direction(p, x.z()).has_value()) << "both sides of the pair grow";
  x.z() << -1e9, 0.0;
  EXPECT_FALSE(unbounded_direction(p, x.z()).has_value()) << "uphill, and s < 0";
  x.z() << 0.0, 1e9;
  EXPECT_FALSE(unbounded_direction(p, x.z()).has_value()) << "no descent";
  x.z().setConstant(std::numeric_limits<double>::infinity());
  EXPECT_FALSE(unbounded_direction(p, x.z()).has_value());
  OwnedProblem curved = unbounded_pair();
  Triplets entries;
  entries.add(0, 0, 1e-2);
  curved.Q = compress(2, 2, entries, "Q").value();
  const ScaledProblem q = testing::scaled(curved);
  x.z() << 1e9, 0.0;
  EXPECT_FALSE(unbounded_direction(q, x.z()).has_value()) << "the curvature wins in the end";
}

TEST(Certificate, AnUnboundedBranchOfAPairIsFound) {
  const Solution s = solve_in_process(unbounded_pair().view()).value();
  ASSERT_EQ(s.status, Status::unbounded) << s.detail;
  EXPECT_EQ(s.certificate[0], 1.0);
  EXPECT_NEAR(s.certificate[1], 0.0, 1e-6);
}

TEST(Certificate, FeasibleProblemsGetNone) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    const OwnedProblem p = testing::random_problem({}, seed);
    const Solution s = solve_in_process(p.view()).value();
    EXPECT_NE(s.status, Status::infeasible) << seed;
    EXPECT_NE(s.status, Status::unbounded) << seed;
    EXPECT_TRUE(s.certificate.empty());
  }
}

}  // namespace
}  // namespace marble
