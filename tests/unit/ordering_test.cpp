// Ordering and symbolic analysis against SuiteSparse's own, which they stand in for.
#include "kkt/ordering.h"

#include <amd.h>
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
