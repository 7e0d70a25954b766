#include "kkt/sparse_ldl.h"

#include <amd.h>
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <cmath>
#include <random>

#include "kkt/lanes.h"
#include "kkt/ordering.h"
#include "model/linear_algebra.h"

namespace marble {
namespace {

// LDLᵀ in blocks, and entry by entry where there is little fill, against a dense solve.
constexpr double kTolerance = 1e-9;

// [H, Aᵀ; A, −D] with H and D diagonally dominant: each order of elimination has pivots far from 0.
struct Quasidefinite {
  Quasidefinite(Index size, Index entries_of_column, std::uint64_t seed)
      : dense(Eigen::MatrixXd::Zero(size, size)) {
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> number(-1.0, 1.0);
    for (Index column = 1; column < size; ++column) {
      for (Index k = 0; k < entries_of_column; ++k) {
        const auto row = static_cast<Index>(random() % static_cast<std::uint64_t>(column));
        dense(row, column) = dense(column, row) = number(random);
      }
    }
    for (Index i = 0; i < size; ++i) {
      const double largest = 1.0 + dense.col(i).cwiseAbs().sum();
      dense(i, i) = i % 3 == 2 ? -largest : largest;
      positive += i % 3 != 2 ? 1 : 0;
    }
    for (Index column = 0; column < size; ++column) {
      for (Index row = 0; row <= column; ++row) {
        if (dense(row, column) != 0.0) pattern.rows.push_back(row);
      }
      pattern.pointers.push_back(static_cast<Index>(pattern.rows.size()));
    }
  }
  // In the order of the permuted matrix.
  [[nodiscard]] std::vector<double> values(const SparseLdl& ldl, double scale) const {
    std::vector<double> all(pattern.rows.size());
    for (Index column = 0; column < pattern.size(); ++column) {
      for (Index k = pattern.pointers[column]; k < pattern.pointers[column + 1]; ++k)
        all[ldl.places()[k]] = scale * dense(pattern.rows[k], column);
    }
    return all;
  }

  Eigen::MatrixXd dense;
  Pattern pattern{{0}, {}};
  Index positive = 0;
};

void expect_solves(const Quasidefinite& matrix, SparseLdl& ldl, double scale, Index only) {
  const Index size = matrix.pattern.size();
  ASSERT_TRUE(ldl.factorize(matrix.values(ldl, scale), {}));
  EXPECT_EQ(ldl.positive_pivots(), matrix.positive);
  Vector right = Vector::LinSpaced(size, -1.0, 2.0);
  if (only >= 0) right = Vector::Unit(size, only);
  Vector permuted(size);
  for (Index i = 0; i < size; ++i) permuted[ldl.position()[i]] = right[i];
  ASSERT_TRUE(ldl.solve(permuted.data(), only >= 0 ? ldl.position()[only] : 0, {}));
  Vector found(size);
  for (Index i = 0; i < size; ++i) found[i] = permuted[ldl.position()[i]];
  const Vector expected = (scale * matrix.dense).partialPivLu().solve(right);
  EXPECT_LT(max_abs(found - expected), kTolerance * max_abs(expected));
}

// With the factor at hand: lane k has k + 1 times the right-hand side.
void expect_solves_in_lanes(const SparseLdl& ldl, Index size) {
  using Eight = Lanes<8>;
  Vector one(size), many(8 * size);
  for (Index i = 0; i < size; ++i) {
    one[i] = std::sin(1.0 + i);
    for (int k = 0; k < 8; ++k) many[8 * i + k] = (k + 1.0) * one[i];
  }
  ASSERT_TRUE(ldl.solve(one.data(), 0, {}));
  ASSERT_TRUE(ldl.solve(reinterpret_cast<Eight*>(many.data()), 0, {}));
  for (Index i = 0; i < size; ++i) {
    for (int k = 0; k < 8; ++k)
      EXPECT_NEAR(many[8 * i + k], (k + 1.0) * one[i], 8.0 * kTolerance * max_abs(one));
  }
}

TEST(SparseLdl, SolvesInBlocksWhereTheFactorFillsInAndElseEntryByEntry) {
  int in_blocks = 0;
  for (const Index size : {1, 2, 7, 60, 150, 300, 400}) {
    for (const Index entries : {0, 1, 3, 12}) {
      const Quasidefinite matrix(size, entries, static_cast<std::uint64_t>(size + entries));
      SparseLdl ldl;
      ASSERT_TRUE(ldl.analyse(matrix.pattern, {}));
      ASSERT_TRUE(ldl.allocate({}));
      expect_solves(matrix, ldl, 1.0, -1);
      expect_solves(matrix, ldl, 3.0, -1);
      expect_solves(matrix, ldl, 1.0, size / 2);
      expect_solves_in_lanes(ldl, size);
      in_blocks += ldl.has_blocks() ? 1 : 0;
    }
  }
  EXPECT_GE(in_blocks, 4);
  EXPECT_LE(in_blocks, 15);
}

TEST(SparseLdl, InBlocksMeetsAZeroPivotOrAnInterruptionAndGoesOn) {
  Quasidefinite matrix(200, 6, 5);
  SparseLdl ldl;
  ASSERT_TRUE(ldl.analyse(matrix.pattern, {}));
  ASSERT_TRUE(ldl.has_blocks());
  ASSERT_TRUE(ldl.allocate({}));
  const std::vector<double> nothing(matrix.pattern.rows.size(), 0.0);
  EXPECT_FALSE(ldl.factorize(nothing, {}));
  expect_solves(matrix, ldl, 1.0, -1);
  // It is looked at after some hundred thousand entries: this factor has more.
  const Quasidefinite large(1500, 6, 5);
  SparseLdl of_large;
  ASSERT_TRUE(of_large.analyse(large.pattern, {}));
  ASSERT_TRUE(of_large.has_blocks());
  ASSERT_TRUE(of_large.allocate({}));
  const Interrupt now({}, Interrupt::Clock::now());
  EXPECT_FALSE(of_large.factorize(large.values(of_large, 1.0), now));
  EXPECT_TRUE(of_large.factorize(large.values(of_large, 1.0), {}));
  EXPECT_EQ(of_large.positive_pivots(), large.positive);
}

}  // namespace
}  // namespace marble

// Ordering and symbolic analysis against SuiteSparse's own, which they stand in for.
extern "C" {  // ldl.h forgets to say so
#include <ldl.h>
}
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <thread>

#include "kkt/elimination.h"

namespace marble {
namespace {

// Of several kinds: scattered, banded, a grid, with rows connected to nearly all, cliques in a chain, full.
Pattern random_pattern(std::mt19937_64& random, Index size, int kind) {
  const auto below = [&random](Index bound) {
    return static_cast<Index>(random() % static_cast<std::uint64_t>(bound));
  };
  std::vector<std::vector<Index>> columns(static_cast<std::size_t>(size));
  const auto connect = [&](Index i, Index j) {
    if (i < size && j < size) columns[std::max(i, j)].push_back(std::min(i, j));
  };
  const Index width = 1 + below(8);
  for (Index i = 0; i < size; ++i) {
    connect(i, i);
    if (kind == 0 || kind == 3) {
      for (Index k = below(width); k > 0; --k) connect(i, below(size));
    } else if (kind == 1) {
      for (Index k = 1; k <= width; ++k) connect(i, i + (below(3) > 0 ? k : 0));
    } else if (kind == 2) {
      connect(i, i + 1);
      connect(i, i + 4 * width);
    } else if (kind == 4) {
      for (Index j = i - i % width; j < i; ++j) connect(i, j), connect(i + 1, j);
    } else if (size < 100) {
      for (Index j = 0; j < i; ++j) connect(i, below(4) == 0 ? j : i);
    }
    if (kind == 3) connect(i, below(3));
  }
  Pattern pattern{{0}, {}};
  for (std::vector<Index>& column : columns) {
    std::sort(column.begin(), column.end());
    column.erase(std::unique(column.begin(), column.end()), column.end());
    pattern.rows.insert(pattern.rows.end(), column.begin(), column.end());
    pattern.pointers.push_back(static_cast<Index>(pattern.rows.size()));
  }
  return pattern;
}

// 3000 entries and more than 20,000: at once, and by a thread of its own.
TEST(Ordering, IsThatOfAmdWhoeverComputesIt) {
  std::mt19937_64 random(7);
  for (int number = 0; number < 24; ++number) {
    const auto size = static_cast<Index>(number % 2 == 0 ? 500 : 30'000);
    const Pattern pattern = random_pattern(random, size, number / 2 % 6);
    std::vector<Index> expected(static_cast<std::size_t>(size));
    ASSERT_EQ(
        amd_order(size, pattern.pointers.data(), pattern.rows.data(), expected.data(), nullptr, nullptr),
        AMD_OK);
    std::vector<Index> found;
    ASSERT_TRUE(order(pattern, {}, found));
    ASSERT_EQ(found, expected) << "pattern " << number << " of size " << size;
  }
}

// More are given up than may compute at once: those that find no place can be stopped as well, and a place
// comes.
TEST(Ordering, IsGivenUpInTimeHoweverManyWereBefore) {
  std::mt19937_64 random(9);
  Pattern pattern = random_pattern(random, 12'000, 0);
  ASSERT_GT(pattern.rows.size(), 20'000U) << "else it is ordered at once";
  std::vector<Index> permutation;
  const int many = 3 * std::max(4, 2 * static_cast<int>(std::thread::hardware_concurrency()));
  for (int i = 0; i < many; ++i)
    static_cast<void>(
        order(pattern, Interrupt({}, Interrupt::Clock::now() + std::chrono::milliseconds(6)), permutation));
  EXPECT_TRUE(order(pattern, {}, permutation));
  EXPECT_EQ(permutation.size(), 12'000U);
}

TEST(Ordering, OfNothingIsNothing) {
  std::vector<Index> permutation{1};
  EXPECT_TRUE(order({{0}, {}}, {}, permutation));
  EXPECT_TRUE(permutation.empty());
}

TEST(Elimination, HasTheTreeAndTheCountsOfLdl) {
  std::mt19937_64 random(8);
  for (int number = 0; number < 2000; ++number) {
    const auto size = static_cast<Index>(1 + random() % (number % 20 == 0 ? 1000 : 80));
    Pattern pattern = random_pattern(random, size, number % 6);
    for (Index column = 0; column < size; ++column)
      std::shuffle(pattern.rows.begin() + pattern.pointers[column],
                   pattern.rows.begin() + pattern.pointers[column + 1], random);
    const auto n = static_cast<std::size_t>(size);
    std::vector<Index> pointers(n + 1), parent(n), counts(n), flag(n);
    ldl_symbolic(size, pattern.pointers.data(), pattern.rows.data(), pointers.data(), parent.data(),
                 counts.data(), flag.data(), nullptr, nullptr);
    Elimination found;
    ASSERT_TRUE(analyse(pattern, {}, found));
    ASSERT_EQ(found.parent, parent) << "pattern " << number << " of size " << size;
    ASSERT_EQ(found.counts, counts) << "pattern " << number << " of size " << size;
    ASSERT_EQ(found.entries, pointers.back());
  }
}

}  // namespace
}  // namespace marble
