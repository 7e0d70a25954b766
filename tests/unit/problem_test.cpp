#include "marble/problem.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "support/random_problem.h"
#include "support/small_problems.h"

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

TEST_F(Malformed, NoVariables) {
  p.g.clear();
  expect("g", -1, "at least 1");
}
TEST_F(Malformed, MoreRowsThanOffsets) {
  p.b.pop_back();
  expect("A.rows", -1, "must be 1");
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
