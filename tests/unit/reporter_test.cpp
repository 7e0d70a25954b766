// What is reported about a run: every iteration once, in the user's units.
#include "path/reporter.h"

#include <gtest/gtest.h>

#include <cmath>

#include "support/random_problem.h"
#include "workbench.h"

namespace marble {
namespace {

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
