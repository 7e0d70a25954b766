#include "marble/problem.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "support/random_problem.h"

namespace marble {
namespace {

// A good problem that each test spoils in one place.
class Malformed : public ::testing::Test {
 protected:
  OwnedProblem p =
      testing::random_problem({.variables = 4, .equalities = 2, .inequalities = 3, .pairs = 2}, 1);

  void expect(const std::string& field, std::int64_t index, const std::string& bound) {
    const auto problem = Problem::create(p.view());
    ASSERT_FALSE(problem.has_value());
    const Error& error = problem.error();
    EXPECT_EQ(error.code, ErrorCode::invalid_argument);
    EXPECT_EQ(error.field, field) << error.message();
    EXPECT_EQ(error.index, index) << error.message();
    EXPECT_NE(error.bound.find(bound), std::string::npos) << error.message();
  }
};

TEST_F(Malformed, TheUnspoiltProblemIsAccepted) { EXPECT_TRUE(Problem::create(p.view()).has_value()); }

TEST_F(Malformed, AnErrorSaysTheOffendingValueToo) {
  p.R.row_indices[1] = 2;
  EXPECT_EQ(Problem::create(p.view()).error().message(), "R.row_indices[1] = 2: must be in [0, 2)");
  p.d[1] = -std::numeric_limits<double>::infinity();
  p.R.row_indices[1] = 1;
  EXPECT_EQ(Problem::create(p.view()).error().message(), "d[1] = -inf: must be finite");
}

TEST_F(Malformed, NoVariables) {
  p.g.clear();
  expect("g", -1, "at least 1");
}
TEST_F(Malformed, MoreRowsThanOffsets) {
  p.b.pop_back();
  expect("A.rows", -1, "must be 1");
}
TEST_F(Malformed, NegativeRows) {
  p.A.rows = -1;
  expect("A.rows", -1, "must be 2");
}
TEST_F(Malformed, OffsetsWithoutTheirMatrix) {
  p.C = {};
  expect("C.rows", -1, "must be 3");
}
TEST_F(Malformed, HessianOfAnotherSize) {
  p.Q.rows = 3;
  expect("Q.rows", -1, "must be 4");
}
TEST_F(Malformed, HessianThatIsNotSquare) {
  p.Q.columns = 3;
  p.Q.column_pointers.pop_back();
  expect("Q.columns", -1, "must be 4");
}
TEST_F(Malformed, RightWithoutLeft) {
  p.L = {};
  p.l.clear();
  expect("r", -1, "must have 0");
}
TEST_F(Malformed, WrongColumns) {
  p.C.columns = 5;
  expect("C.columns", -1, "must be 4");
}
TEST_F(Malformed, LeftAndRightDiffer) {
  p.r.push_back(0.0);
  expect("r", -1, "must have 2");
}
TEST_F(Malformed, ColumnPointersOfWrongLength) {
  p.L.column_pointers.pop_back();
  expect("L.column_pointers", -1, "must have 5");
}
TEST_F(Malformed, ColumnPointersThatDoNotStartAtZero) {
  p.L.column_pointers[0] = 1;
  expect("L.column_pointers", 0, "must be 0");
}
TEST_F(Malformed, ColumnPointersThatFall) {
  p.A.column_pointers[2] = -1;
  expect("A.column_pointers", 2, "must be in [");
}
TEST_F(Malformed, ColumnPointersBeyondTheEntries) {
  p.A.column_pointers[1] = std::numeric_limits<Index>::max();
  expect("A.column_pointers", 1, "must be in [");
}
TEST_F(Malformed, ColumnPointersThatEndEarly) {
  p.A.column_pointers[4] -= 1;
  expect("A.column_pointers", 4, "must be " + std::to_string(p.A.values.size()));
}
TEST_F(Malformed, NoColumnPointers) {
  p.A.column_pointers.clear();
  expect("A.column_pointers", -1, "must have 5");
}
TEST_F(Malformed, RowIndexTooLarge) {
  p.R.row_indices[1] = 2;
  expect("R.row_indices", 1, "must be in [0, 2)");
}
TEST_F(Malformed, NegativeRowIndex) {
  p.R.row_indices[0] = -1;
  expect("R.row_indices", 0, "must be in [0, 2)");
}
TEST_F(Malformed, ValuesAndIndicesOfDifferentLength) {
  p.A.values.pop_back();
  expect("A.values", -1, "as many as row_indices");
}
TEST_F(Malformed, NanInAMatrix) {
  p.C.values[2] = std::nan("");
  expect("C.values", 2, "must be finite");
}
TEST_F(Malformed, InfinityInTheHessian) {
  p.Q.values[0] = std::numeric_limits<double>::infinity();
  expect("Q.values", 0, "must be finite");
}
TEST_F(Malformed, InfiniteOffset) {
  p.d[1] = std::numeric_limits<double>::infinity();
  expect("d", 1, "must be finite");
}
TEST_F(Malformed, NanInTheCost) {
  p.g[3] = std::nan("");
  expect("g", 3, "must be finite");
}
TEST_F(Malformed, InfiniteConstant) {
  p.c0 = -std::numeric_limits<double>::infinity();
  expect("c0", -1, "must be finite");
}
TEST_F(Malformed, UnsortedRows) {
  p.Q = SparseMatrix{4, 4, {0, 2, 2, 2, 2}, {1, 0}, {1.0, 1.0}};
  expect("Q.row_indices", 1, "must be greater");
}
TEST_F(Malformed, DuplicateEntry) {
  p.Q = SparseMatrix{4, 4, {0, 2, 2, 2, 2}, {0, 0}, {1.0, 1.0}};
  expect("Q.row_indices", 1, "must be greater");
}
TEST_F(Malformed, AsymmetricValue) {
  p.Q = SparseMatrix{4, 4, {0, 1, 2, 2, 2}, {1, 0}, {1.0, 2.0}};
  expect("Q.values", 1, "symmetric");
}
TEST_F(Malformed, MissingMirrorImageAbove) {
  p.Q = SparseMatrix{4, 4, {0, 1, 1, 1, 1}, {2}, {1.0}};
  expect("Q.values", 0, "symmetric");
}
TEST_F(Malformed, MissingMirrorImageBelow) {
  p.Q = SparseMatrix{4, 4, {0, 0, 0, 1, 1}, {0}, {1.0}};
  expect("Q.values", 0, "symmetric");
}
TEST_F(Malformed, LowerEntryInAnUpperTriangle) {
  p.Q = SparseMatrix{4, 4, {0, 1, 1, 1, 1}, {2}, {1.0}};
  p.hessian_form = HessianForm::upper_triangle;
  expect("Q.row_indices", 0, "upper triangle");
}

TEST(Problem, SymmetryCheckAgreesWithTheDefinitionOnRandomPatterns) {
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    OwnedProblem p = testing::random_problem({.variables = 9, .density = 0.2}, seed);
    ASSERT_TRUE(Problem::create(p.view()).has_value()) << seed;
    // Spoil one off-diagonal entry.
    for (Index j = 0, k = 0; j < 9; ++j) {
      for (; k < p.Q.column_pointers[j + 1]; ++k) {
        if (p.Q.row_indices[k] == j) continue;
        OwnedProblem spoilt = p;
        spoilt.Q.values[k] *= 1.001;
        EXPECT_FALSE(Problem::create(spoilt.view()).has_value()) << seed << " entry " << k;
      }
    }
  }
}

TEST(Problem, MirrorImagesMayDifferByRounding) {
  OwnedProblem p;
  p.g = {0.0, 0.0};
  p.Q = SparseMatrix{2, 2, {0, 1, 2}, {1, 0}, {1e6, 1e6 * (1.0 + 1e-14)}};
  EXPECT_TRUE(Problem::create(p.view()).has_value());
  p.Q.values[1] = 1e6 * (1.0 + 1e-10);
  EXPECT_FALSE(Problem::create(p.view()).has_value());
  p.Q.values = {1e-300, 2e-300};
  EXPECT_FALSE(Problem::create(p.view()).has_value()) << "the bound is relative, however small the entries";
}

// BᵀQB summed in two orders, as a product of matrices leaves it.
TEST(Problem, ProductsOfMatricesAreSymmetricToTheirRounding) {
  constexpr Index n = 150;
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    OwnedProblem p = testing::random_problem({.variables = n, .density = 0.02}, seed);
    std::vector<double> B(static_cast<std::size_t>(n) * n), dense(B.size());
    std::mt19937_64 random(seed);
    for (double& entry : B) entry = std::uniform_real_distribution<>(-1.0, 1.0)(random);
    const double weight = seed % 2 == 0 ? 1.0 : -1.0;  // of half of the rows: indefinite, diagonals cancel
    const auto at = [](Index i, Index j) {
      return static_cast<std::size_t>(i) * n + static_cast<std::size_t>(j);
    };
    for (Index i = 0; i < n; ++i) {
      for (Index j = 0; j < n; ++j) {
        double sum = 0.0;
        for (Index k = 0; k < n; ++k) {
          const Index row = i < j ? k : n - 1 - k;
          sum += (row < n / 2 ? weight : 1.0) * B[at(row, i)] * B[at(row, j)];
        }
        dense[at(i, j)] = sum;
      }
    }
    p.Q = SparseMatrix{n, n, {0}, {}, {}};
    for (Index j = 0; j < n; ++j) {
      for (Index i = 0; i < n; ++i) p.Q.row_indices.push_back(i), p.Q.values.push_back(dense[at(i, j)]);
      p.Q.column_pointers.push_back((j + 1) * n);
    }
    const auto problem = Problem::create(p.view());
    ASSERT_TRUE(problem.has_value()) << seed << ": " << problem.error().message();
    // One entry that is wrong by a billionth of its row is found.
    p.Q.values[at(3, 70)] += 1e-9 * n;
    EXPECT_EQ(Problem::create(p.view()).error().field, "Q.values") << seed;
  }
}

TEST(Problem, WhatShouldBeZeroMayBeRoundingOnEitherSide) {
  OwnedProblem p;
  p.g = {0.0, 0.0, 0.0};
  p.Q = SparseMatrix{3, 3, {0, 1, 2, 4}, {0, 1, 0, 2}, {4.0, 2.0, 1e-17, 3.0}};
  EXPECT_TRUE(Problem::create(p.view()).has_value()) << "above the diagonal";
  p.Q = SparseMatrix{3, 3, {0, 2, 3, 4}, {0, 2, 1, 2}, {4.0, 1e-17, 2.0, 3.0}};
  EXPECT_TRUE(Problem::create(p.view()).has_value()) << "below";
  p.Q = SparseMatrix{3, 3, {0, 2, 4, 6}, {0, 2, 0, 1, 1, 2}, {4.0, 1e-17, 1e-17, 2.0, 1e-17, 3.0}};
  EXPECT_TRUE(Problem::create(p.view()).has_value()) << "some of both";
  // Another variable's size is no excuse: rows 0 and 2 hold nothing large.
  p.Q = SparseMatrix{3, 3, {0, 1, 2, 4}, {0, 1, 0, 2}, {4.0, 1e20, 1e-6, 3.0}};
  EXPECT_EQ(Problem::create(p.view()).error().index, 2);
  // Entries whose squares are no numbers any more.
  p.Q = SparseMatrix{3, 3, {0, 1, 2, 3}, {1, 0, 2}, {1e308, -1e308, 1.0}};
  EXPECT_FALSE(Problem::create(p.view()).has_value());
  p.Q = SparseMatrix{3, 3, {0, 1, 2, 3}, {1, 0, 2}, {1e308, 1e308 * (1 - 1e-15), 1.0}};
  EXPECT_TRUE(Problem::create(p.view()).has_value());
}

TEST(Problem, StoredZerosOfQNeedNoMirrorImage) {
  OwnedProblem p;
  p.g = {0.0, 0.0, 0.0};
  // Column 0 holds (1, 0) = 0 and (2, 0) = 5; only the second is mirrored.
  p.Q = SparseMatrix{3, 3, {0, 2, 2, 3}, {1, 2, 0}, {0.0, 5.0, 5.0}};
  EXPECT_TRUE(Problem::create(p.view()).has_value());
  p.Q.values[0] = 1.0;
  EXPECT_EQ(Problem::create(p.view()).error().index, 0);
  p.Q = SparseMatrix{3, 3, {0, 0, 1, 1}, {0}, {0.0}};
  EXPECT_TRUE(Problem::create(p.view()).has_value());
}

TEST(Problem, AnUpperTriangleIsAccepted) {
  OwnedProblem p;
  p.g = {0.0, 0.0};
  p.Q = SparseMatrix{2, 2, {0, 1, 3}, {0, 0, 1}, {2.0, 1.0, 2.0}};
  p.hessian_form = HessianForm::upper_triangle;
  EXPECT_TRUE(Problem::create(p.view()).has_value());
  p.hessian_form = HessianForm::full;
  EXPECT_EQ(Problem::create(p.view()).error().field, "Q.values");
}

TEST(Problem, AbsentBlocksAreEmpty) {
  OwnedProblem p;
  p.g = {1.0, 2.0};
  const auto problem = Problem::create(p.view());
  ASSERT_TRUE(problem.has_value());
  EXPECT_EQ(problem->variables(), 2);
  EXPECT_EQ(problem->equalities() + problem->inequalities() + problem->pairs(), 0);
}

TEST(Problem, InitialPointMustFitAndBeFinite) {
  EXPECT_TRUE(Problem::check_initial_point({}, 3).has_value());
  const double good[] = {1.0, 2.0, 3.0};
  EXPECT_TRUE(Problem::check_initial_point(good, 3).has_value());
  EXPECT_EQ(Problem::check_initial_point(good, 4).error().field, "initial_z");
  const double bad[] = {1.0, std::nan(""), 3.0};
  EXPECT_EQ(Problem::check_initial_point(bad, 3).error().index, 1);
}

TEST(Compress, SortsAndAddsDuplicates) {
  Triplets entries;
  entries.add(1, 1, 2.0);
  entries.add(0, 1, 1.0);
  entries.add(1, 1, 3.0);
  entries.add(1, 0, 4.0);
  const SparseMatrix m = compress(2, 2, entries, "M").value();
  EXPECT_EQ(m.column_pointers, (std::vector<Index>{0, 1, 3}));
  EXPECT_EQ(m.row_indices, (std::vector<Index>{1, 0, 1}));
  EXPECT_EQ(m.values, (std::vector<double>{4.0, 1.0, 5.0}));
}

TEST(Compress, NoEntriesMakeAMatrixOfZeros) {
  const SparseMatrix m = compress(2, 3, {}, "M").value();
  EXPECT_EQ(m.rows, 2);
  EXPECT_EQ(m.column_pointers, (std::vector<Index>{0, 0, 0, 0}));
  EXPECT_EQ(m.view().entries(), 0);
}

TEST(Compress, ManyRandomEntriesKeepTheirSums) {
  std::uint64_t state = 1;
  const auto next = [&state] { return static_cast<Index>((state = state * 6364136223846793005u + 1) >> 40); };
  Triplets entries;
  std::vector<double> expected(7 * 5, 0.0);
  for (int k = 0; k < 200; ++k) {
    entries.add(next() % 7, next() % 5, next() % 100);
    expected[static_cast<std::size_t>(entries.rows.back() * 5 + entries.columns.back())] +=
        entries.values.back();
  }
  const SparseMatrix m = compress(7, 5, entries, "M").value();
  std::vector<double> actual(7 * 5, 0.0);
  for (Index j = 0; j < 5; ++j) {
    for (Index k = m.column_pointers[j]; k < m.column_pointers[j + 1]; ++k) {
      if (k > m.column_pointers[j]) {
        EXPECT_LT(m.row_indices[k - 1], m.row_indices[k]);
      }
      actual[static_cast<std::size_t>(m.row_indices[k] * 5 + j)] += m.values[k];
    }
  }
  EXPECT_EQ(actual, expected);
}

TEST(Compress, NamesEveryKindOfFault) {
  const auto message = [](Index rows, Index columns, const Triplets& entries) {
    return compress(rows, columns, entries, "M").error().message();
  };
  EXPECT_EQ(message(2, 2, {{0, -1}, {0, 0}, {1.0, 1.0}}), "M.i[1] = -1: must be in [0, 2)");
  EXPECT_EQ(message(2, 2, {{0, 2}, {0, 0}, {1.0, 1.0}}), "M.i[1] = 2: must be in [0, 2)");
  EXPECT_EQ(message(0, 2, {{0}, {0}, {1.0}}), "M.i[0] = 0: must be in [0, 0)");
  EXPECT_EQ(message(2, 2, {{0, 0}, {0, 1}, {1.0, std::nan("")}}), "M.v[1] = nan: must be finite");
  EXPECT_EQ(message(2, 2, {{0}, {0, 1}, {1.0, 2.0}}), "M.i = 1 entries: must have 2 entries, as many as v");
  EXPECT_EQ(message(2, 2, {{0, 1}, {0}, {1.0, 2.0}}), "M.j = 1 entries: must have 2 entries, as many as v");
  EXPECT_EQ(message(-1, 2, {}), "M.rows = -1: must be >= 0");
  EXPECT_EQ(message(2, -1, {}), "M.cols = -1: must be >= 0");
}

TEST(Compress, RefusesDuplicatesWhoseSumOverflows) {
  const Error error = compress(1, 1, {{0, 0}, {0, 0}, {1e308, 1e308}}, "M").error();
  EXPECT_EQ(error.field, "M.v");
  EXPECT_EQ(error.index, 1);
  EXPECT_NE(error.bound.find("finite"), std::string::npos);
}

TEST(Compress, NamesTheEntryThatIsOutOfRange) {
  Triplets entries;
  entries.add(0, 0, 1.0);
  entries.add(0, 5, 1.0);
  const Error error = compress(2, 2, entries, "M").error();
  EXPECT_EQ(error.field, "M.j");
  EXPECT_EQ(error.index, 1);
  EXPECT_EQ(error.message(), "M.j[1] = 5: must be in [0, 2)");
}

}  // namespace
}  // namespace marble
