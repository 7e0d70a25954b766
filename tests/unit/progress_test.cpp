// What a solve reports beside its answer.
#include "marble/progress.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "marble/examples.h"
#include "marble/solver.h"

namespace marble {
namespace {

TEST(Progress, RowsCarryThePairsToWhoWantsThem) {
  const OwnedProblem p = examples::rocket();
  const auto problem = Problem::create(p.view());
  class Pairs : public ProgressSink {
   public:
    explicit Pairs(const ProblemView& problem) : problem_(problem) {}
    [[nodiscard]] bool wants_pairs() const override { return true; }
    void report(const Progress& progress) override {
      ++rows;
      expect_side(problem_.L, problem_.l, progress.z, progress.s);
      expect_side(problem_.R, problem_.r, progress.z, progress.t);
      double violation = 0.0;
      for (std::size_t i = 0; i < progress.s.size(); ++i)
        violation = std::max(violation, std::abs(std::min(progress.s[i], progress.t[i])));
      EXPECT_NEAR(violation, progress.violations.complementarity, 1e-9 * (1.0 + violation));
    }
    int rows = 0;

   private:
    // M z + offset, column by column.
    static void expect_side(const SparseMatrixView& matrix, std::span<const double> offset,
                            std::span<const double> z, std::span<const double> side) {
      std::vector<double> expected(offset.begin(), offset.end());
      for (std::size_t column = 0; column < z.size(); ++column) {
        for (auto k = matrix.column_pointers[column]; k < matrix.column_pointers[column + 1]; ++k) {
          const auto at = static_cast<std::size_t>(k);
          expected[static_cast<std::size_t>(matrix.row_indices[at])] += matrix.values[at] * z[column];
        }
      }
      ASSERT_EQ(side.size(), expected.size());
      for (std::size_t i = 0; i < side.size(); ++i)
        EXPECT_NEAR(side[i], expected[i], 1e-9 * (1.0 + std::abs(expected[i])));
    }
    const ProblemView problem_;
  } pairs(p.view());
  class Counter : public ProgressSink {
   public:
    void report(const Progress& progress) override {
      ++rows;
      EXPECT_TRUE(progress.s.empty());
    }
    int rows = 0;
  } without;
  const Solution with = solve_in_process(p.view(), {}, {.progress = &pairs}).value();
  const Solution same = solve_in_process(p.view(), {}, {.progress = &without}).value();
  EXPECT_EQ(pairs.rows, without.rows);
  EXPECT_GT(pairs.rows, 5);
  EXPECT_EQ(with.z, same.z) << "who looks changes nothing";
}

TEST(Progress, PartsOfTheTimeAreWithinTheWhole) {
  const Solution s = solve_in_process(examples::hopper().view()).value();
  const Times& t = s.times;
  EXPECT_GT(t.factorization_s, 0.0);
  EXPECT_GT(t.line_search_s, 0.0);
  EXPECT_GT(t.polish_s, 0.0);
  EXPECT_LE(t.factorization_s + t.line_search_s + t.polish_s, t.solve_s);
  Options options;
  options.polish = false;
  EXPECT_EQ(solve_in_process(examples::hopper().view(), options).value().times.polish_s, 0.0);
}

}  // namespace
}  // namespace marble
