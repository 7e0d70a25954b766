#include "marble/progress.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "marble/examples.h"
#include "marble/solver.h"
#include "path/reporter.h"
#include "support/random_problem.h"
#include "workbench.h"

namespace marble {
namespace {

// What a solve reports beside its answer.
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

std::string csv(const Progress& row) {
  std::string text;
  append_progress_csv(row, text);
  return text;
}

TEST(ProgressCsv, TheColumnsAreAContract) {
  EXPECT_EQ(progress_csv_header(),
            "iteration,outer_iteration,objective,equality_violation,inequality_violation,"
            "complementarity_violation,kkt_residual,kappa,rho,step_length,regularization,factorizations,"
            "elapsed_s,incumbent,bound,gap,nodes,open_nodes");
}

TEST(ProgressCsv, EveryColumnStandsInItsPlaceWithEveryBit) {
  EXPECT_EQ(csv({.iteration = 3,
                 .outer_iteration = 2,
                 .objective = -0.1,
                 .violations = {1e-9, 2.5e-300, 1.0 / 3.0},
                 .kkt_residual = 4,
                 .kappa = 1e-14,
                 .rho = 1e6,
                 .step_length = 0.5,
                 .regularization = 1e-4,
                 .factorizations = 7,
                 .elapsed_s = 0.25,
                 .incumbent = -1.5,
                 .bound = -2,
                 .gap = 1.0 / 3.0,
                 .nodes = 5000000000,
                 .open_nodes = 12,
                 .z = {}}),
            "3,2,-0.1,1e-09,2.5e-300,0.3333333333333333,4,1e-14,1e+06,0.5,1e-04,7,0.25,-1.5,-2,"
            "0.3333333333333333,5000000000,12");
}

TEST(ProgressCsv, NumbersThatAreNoneAreNamed) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const std::string text = csv(
      {.objective = std::numeric_limits<double>::quiet_NaN(), .violations = {}, .rho = -kInfinity, .z = {}});
  EXPECT_EQ(text, "0,0,nan,0,0,0,0,0,-inf,0,0,0,0,inf,-inf,inf,0,0");
}

TEST(ProgressCsv, WhatIsReadByTheColumnsIsWhatWasWritten) {
  Progress copy;
  const Progress row{.iteration = 9,
                     .objective = 0.1,
                     .violations = {1, 2, 3},
                     .elapsed_s = 5e-5,
                     .bound = -7,
                     .nodes = 4,
                     .z = {}};
  for (const ProgressColumn& column : progress_columns()) column.set(copy, column.get(row));
  EXPECT_EQ(csv(copy), csv(row));
}

// What is reported about a run: every iteration once, in the user's units.
using testing::Rows;
using testing::Workbench;

constexpr Violations kViolations{1e-3, 2e-3, 3e-3};

// At z (scaled), with this objective in the user's units.
void report(Reporter reporter, const Workbench& w, Run& run, ConstVectorRef z, double objective) {
  const double scaled = (objective - w.problem.c0) * w.problem.cost_scale;
  reporter.report(run, z, scaled, kViolations, {.kappa = 0.25, .step_length = 0.5});
}

TEST(Reporter, ReportsAnIterationOnceWhoeverReportsIt) {
  Rows rows;
  Workbench w(testing::random_problem({}, 1), {}, &rows);
  Reporter path(w.problem), search(w.problem);
  report(path, w, w.run, w.zero(), 1.0);
  report(search, w, w.run, w.zero(), 2.0);
  EXPECT_EQ(rows.rows.size(), 1U) << "an engine that goes on begins where the last row was";
  ++w.run.iterations;
  report(search, w, w.run, w.zero(), 3.0);
  report(path, w, w.run, w.zero(), 4.0);
  ASSERT_EQ(rows.rows.size(), 2U);
  EXPECT_NEAR(rows.rows[0].objective, 1.0, 1e-12);
  EXPECT_NEAR(rows.rows[1].objective, 3.0, 1e-12);
}

TEST(Reporter, AddsTheCountersOfTheRunAndLeavesTheRestAsItWas) {
  Rows rows;
  Workbench w(testing::random_problem({}, 1), {}, &rows);
  Reporter reporter(w.problem);
  w.run.iterations = 7;
  w.run.outer_iterations = 3;
  w.run.factorizations = 11;
  report(reporter, w, w.run, w.zero(), 1.0);
  ++w.run.iterations;
  report(reporter, w, w.run, w.zero(), 1.0);
  ASSERT_EQ(rows.rows.size(), 2U);
  EXPECT_EQ(rows.rows[0].iteration, 7);
  EXPECT_EQ(rows.rows[0].outer_iteration, 3);
  EXPECT_EQ(rows.rows[0].factorizations, 11);
  EXPECT_EQ(rows.rows[0].violations.inequality, kViolations.inequality);
  EXPECT_EQ(rows.rows[0].kappa, 0.25);
  EXPECT_EQ(rows.rows[0].step_length, 0.5);
  EXPECT_GE(rows.rows[0].elapsed_s, 0.0);
  EXPECT_GE(rows.rows[1].elapsed_s, rows.rows[0].elapsed_s);
}

TEST(Reporter, GivesVectorsInTheUsersUnits) {
  for (const bool pairs : {false, true}) {
    Rows rows(pairs);
    const OwnedProblem p = testing::random_problem({}, 3);
    Workbench w(p, {}, &rows);
    Reporter reporter(w.problem);
    Iterate x(w.problem);
    x.z() = Vector::LinSpaced(w.problem.variables(), -1.0, 2.0);
    report(reporter, w, w.run, x.z(), 0.0);
    ASSERT_EQ(rows.z.size(), 1U);
    EXPECT_EQ(rows.z[0], w.user(x.z()));
    ASSERT_EQ(rows.s[0].size(), pairs ? p.l.size() : 0U);
    ASSERT_EQ(rows.t[0].size(), pairs ? p.r.size() : 0U);
    // s = L z + l by the columns of the user's own matrices.
    std::vector<double> s = p.l, t = p.r;
    for (std::size_t j = 0; j < p.g.size(); ++j) {
      for (auto k = p.L.column_pointers[j]; k < p.L.column_pointers[j + 1]; ++k)
        s[static_cast<std::size_t>(p.L.row_indices[k])] += p.L.values[k] * rows.z[0][j];
      for (auto k = p.R.column_pointers[j]; k < p.R.column_pointers[j + 1]; ++k)
        t[static_cast<std::size_t>(p.R.row_indices[k])] += p.R.values[k] * rows.z[0][j];
    }
    for (std::size_t i = 0; i < rows.s[0].size(); ++i) {
      EXPECT_NEAR(rows.s[0][i], s[i], 1e-12 * (1.0 + std::abs(s[i])));
      EXPECT_NEAR(rows.t[0][i], t[i], 1e-12 * (1.0 + std::abs(t[i])));
    }
  }
}

TEST(Reporter, WithoutASinkOrInASilentPartNobodyIsReported) {
  Workbench alone(testing::random_problem({}, 1));
  report(Reporter(alone.problem), alone, alone.run, alone.zero(), 1.0);
  EXPECT_EQ(alone.run.reported_iteration, -1);
  Rows rows;
  Workbench w(testing::random_problem({}, 1), {}, &rows);
  auto silent = w.run.part(true);
  ++silent.iterations;
  report(Reporter(w.problem), w, silent, w.zero(), 1.0);
  EXPECT_TRUE(rows.rows.empty());
  auto loud = w.run.part(false);
  ++loud.iterations;
  report(Reporter(w.problem), w, loud, w.zero(), 1.0);
  EXPECT_EQ(rows.rows.size(), 1U);
  w.run.add_part(loud);
  report(Reporter(w.problem), w, w.run, w.zero(), 1.0);
  EXPECT_EQ(rows.rows.size(), 1U) << "what a part has reported the whole does not report again";
}

}  // namespace
}  // namespace marble
