#include "marble/solver.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <thread>

#include "marble/examples.h"
#include "support/branch.h"
#include "support/independent_check.h"
#include "support/random_problem.h"
#include "support/small_problems.h"

namespace marble {
namespace {

using testing::judge;
using testing::small_problems;

class Recorder : public ProgressSink {
 public:
  void report(const Progress& progress) override {
    rows.push_back(without_vectors(progress));
    sizes.push_back(progress.z.size());
  }
  std::vector<Progress> rows;
  std::vector<std::size_t> sizes;
};

double largest(const Violations& v) { return std::max({v.equality, v.inequality, v.complementarity}); }

// Stops the solve from within its own progress, after a number of rows.
class Stopper : public ProgressSink {
 public:
  explicit Stopper(int after) : after_(after) {}
  void report(const Progress&) override {
    if (++rows == after_) source.request_stop();
  }
  std::stop_source source;
  int rows = 0;

 private:
  int after_;
};

TEST(Solver, FindsTheOptimumOfEverySmallProblemOnEitherPath) {
  for (const Path path : {Path::fast, Path::paper}) {
    Options options;
    options.path = path;
    for (const auto& [problem, optimum] : small_problems()) {
      const Solution s = solve_in_process(problem.view(), options).value();
      EXPECT_EQ(s.status, Status::solved) << problem.name << ": " << s.detail;
      EXPECT_NEAR(s.objective, optimum, 1e-5 * std::max(1.0, std::abs(optimum))) << problem.name;
    }
  }
}

TEST(Solver, WhatAPathAloneCallsSolvedPassesTheIndependentCheck) {
  for (const Path path : {Path::fast, Path::paper}) {
    Options options;
    options.path = path;
    options.polish = false;
    int solved = 0;
    int global = 0;
    const auto problems = small_problems();
    for (const auto& [problem, optimum] : problems) {
      const Solution s = solve_in_process(problem.view(), options).value();
      if (s.status != Status::solved) continue;
      ++solved;
      const double slack = 1e-4 * std::max(1.0, std::abs(optimum));
      EXPECT_GE(s.objective, optimum - slack) << problem.name;
      if (s.objective <= optimum + slack) ++global;
      const testing::Verdict verdict = judge(problem.view(), s);
      EXPECT_LE(verdict.infeasibility(), 1e-6) << problem.name;
      EXPECT_LE(verdict.stationarity, 1e-5) << problem.name;
      EXPECT_LE(verdict.slackness, 1e-5) << problem.name;
    }
    const int all = static_cast<int>(problems.size());
    EXPECT_GE(solved, all - 3) << static_cast<int>(path);
    EXPECT_GE(global, all - 6) << static_cast<int>(path);
  }
}

TEST(Solver, SolvedPointsPassTheIndependentCheck) {
  for (const auto& [problem, optimum] : small_problems()) {
    const Solution s = solve_in_process(problem.view()).value();
    const testing::Verdict verdict = judge(problem.view(), s);
    EXPECT_LE(verdict.infeasibility(), 1e-9) << problem.name;
    EXPECT_LE(verdict.stationarity, 1e-9) << problem.name;
    EXPECT_LE(verdict.slackness, 1e-8) << problem.name;
    EXPECT_LE(verdict.wrong_sign, 1e-8) << problem.name;
    EXPECT_NEAR(verdict.objective, s.objective, 1e-9 * (1.0 + std::abs(s.objective))) << problem.name;
  }
}

TEST(Solver, NoRandomProblemIsCalledSolvedThatTheIndependentCheckRejects) {
  int solved = 0;
  int problems = 0;
  for (const Index n_e : {0, 2}) {
    for (const Index n_i : {0, 6}) {
      for (const Index n_c : {0, 5}) {
        for (std::uint64_t seed = 1; seed <= 40; ++seed) {
          const OwnedProblem p = testing::random_problem(
              {.variables = 10, .equalities = n_e, .inequalities = n_i, .pairs = n_c, .density = 0.3}, seed);
          const Solution s = solve_in_process(p.view()).value();
          ++problems;
          if (!is_solved(s.status)) continue;
          ++solved;
          const testing::Verdict verdict = judge(p.view(), s);
          EXPECT_LE(verdict.infeasibility(), 1e-6) << p.name;
          EXPECT_LE(verdict.stationarity, 1e-6) << p.name;
          EXPECT_LE(verdict.slackness, 1e-5) << p.name;
          EXPECT_LE(verdict.wrong_sign, 1e-6) << p.name;
        }
      }
    }
  }
  EXPECT_GE(solved, problems * 97 / 100) << "of " << problems;
}

TEST(Solver, PublicExampleTakesNoMoreFactorizationsThanTheOriginal) {
  for (const bool polish : {true, false}) {
    Options options;
    options.polish = polish;
    const auto [problem, optimum] = testing::public_example();
    const Solution s = solve_in_process(problem.view(), options).value();
    EXPECT_EQ(s.status, Status::solved);
    EXPECT_NEAR(s.objective, optimum, 1e-4);
    EXPECT_LE(s.factorizations, 26);
  }
}

TEST(Solver, ReportsEveryIterationOnceWithGrowingCounters) {
  for (const Path path : {Path::fast, Path::paper}) {
    Options options;
    options.path = path;
    options.polish = false;
    Recorder recorder;
    const OwnedProblem p = testing::random_problem({}, 3);
    const Solution s = solve_in_process(p.view(), options, {.progress = &recorder}).value();
    ASSERT_EQ(recorder.rows.size(), static_cast<std::size_t>(s.iterations) + 1);
    for (std::size_t i = 0; i < recorder.rows.size(); ++i) {
      const Progress& row = recorder.rows[i];
      EXPECT_EQ(row.iteration, static_cast<int>(i));
      EXPECT_EQ(recorder.sizes[i], p.g.size());
      EXPECT_GE(row.factorizations, row.iteration);
      EXPECT_GT(row.kappa, 0.0);
      if (i > 0) {
        EXPECT_GE(row.factorizations, recorder.rows[i - 1].factorizations);
        EXPECT_GT(row.step_length, 0.0);
        EXPECT_LE(row.step_length, 1.0);
      }
    }
    EXPECT_EQ(recorder.rows.back().factorizations, s.factorizations);
  }
}

TEST(Solver, NoIterationIsReportedTwiceOrLeftOutWhenThePolishTriesInBetween) {
  for (const OwnedProblem& p : {examples::hopper({.steps = 15}), examples::rocket()}) {
    for (const Path path : {Path::fast, Path::paper}) {
      Options options;
      options.path = path;
      Recorder recorder;
      const Solution s = solve_in_process(p.view(), options, {.progress = &recorder}).value();
      ASSERT_EQ(recorder.rows.size(), static_cast<std::size_t>(s.iterations) + 1) << p.name;
      for (std::size_t i = 1; i < recorder.rows.size(); ++i) {
        const Progress& before = recorder.rows[i - 1];
        const Progress& row = recorder.rows[i];
        ASSERT_EQ(row.iteration, static_cast<int>(i));
        EXPECT_GT(row.factorizations, before.factorizations) << "every step costs one at least";
        EXPECT_GE(row.outer_iteration, before.outer_iteration);
        EXPECT_GE(row.elapsed_s, before.elapsed_s);
        if (path == Path::paper) {
          EXPECT_LE(row.kappa, before.kappa);
          EXPECT_GE(row.rho, before.rho);
        }
      }
      EXPECT_GE(s.factorizations, recorder.rows.back().factorizations);
    }
  }
}

TEST(Solver, AStopIsHeardWithinOneIteration) {
  for (const Path path : {Path::fast, Path::paper}) {
    Options options;
    options.path = path;
    Stopper stopper(3);
    const OwnedProblem p = examples::hopper();
    const Solution s =
        solve_in_process(p.view(), options, {.progress = &stopper, .stop = stopper.source.get_token()})
            .value();
    EXPECT_EQ(s.status, Status::cancelled);
    EXPECT_EQ(stopper.rows, 3);
    EXPECT_EQ(s.z.size(), p.g.size());
    EXPECT_NEAR(judge(p.view(), s).infeasibility(),
                std::max({s.violations.equality, s.violations.inequality, s.violations.complementarity}),
                1e-9);
  }
}

TEST(Solver, AStopBeforeTheStartIsHeardBeforeAnyWork) {
  std::stop_source source;
  source.request_stop();
  const OwnedProblem p = examples::hopper({.steps = 10});
  const Solution s = solve_in_process(p.view(), {}, {.stop = source.get_token()}).value();
  EXPECT_EQ(s.status, Status::cancelled);
  EXPECT_EQ(s.iterations, 0);
  EXPECT_EQ(s.factorizations, 0);
  EXPECT_EQ(s.z.size(), p.g.size());
}

TEST(Solver, LimitsEndTheSolveWithTheirOwnStatusOnEitherPath) {
  const OwnedProblem p = examples::hopper({.steps = 10});
  for (const Path path : {Path::fast, Path::paper}) {
    for (const int limit : {0, 1, 4}) {
      Options options;
      options.path = path;
      options.max_iterations = limit;
      const Solution s = solve_in_process(p.view(), options).value();
      EXPECT_EQ(s.status, Status::iteration_limit);
      EXPECT_EQ(s.iterations, limit);
      EXPECT_NEAR(judge(p.view(), s).infeasibility(), largest(s.violations), 1e-9);
    }
    Options options;
    options.path = path;
    options.time_limit_s = 0.0;
    const Solution late = solve_in_process(p.view(), options).value();
    EXPECT_EQ(late.status, Status::time_limit);
    EXPECT_EQ(late.iterations, 0);
    EXPECT_EQ(late.factorizations, 0);
  }
}

TEST(Solver, AnEarlyEndGivesTheBestIterateItHadReported) {
  const OwnedProblem p = examples::hopper({.steps = 10});
  for (const int limit : {3, 6, 9}) {
    Options options;
    options.max_iterations = limit;
    Recorder recorder;
    const Solution s = solve_in_process(p.view(), options, {.progress = &recorder}).value();
    ASSERT_EQ(s.status, Status::iteration_limit);
    double best = largest(recorder.rows.front().violations);
    for (const Progress& row : recorder.rows) best = std::min(best, largest(row.violations));
    EXPECT_NEAR(largest(s.violations), best, 1e-9 * (1.0 + best)) << limit;
  }
}

TEST(Solver, BadInitialPointsAndOptionsAreErrors) {
  const OwnedProblem p = testing::random_problem({}, 1);
  const std::vector<double> short_z(3, 0.0);
  EXPECT_EQ(solve_in_process(p.view(), {}, {.initial_z = short_z}).error().field, "initial_z");
  std::vector<double> nan_z(p.g.size(), 0.0);
  nan_z[5] = std::nan("");
  EXPECT_EQ(solve_in_process(p.view(), {}, {.initial_z = nan_z}).error().index, 5);
  Options options;
  options.kappa_factor = 2.0;
  EXPECT_EQ(solve_in_process(p.view(), options).error().field, "kappa_factor");
}

TEST(Solver, BadInitialPointsLeaveTheSolverFitForUse) {
  const OwnedProblem p = testing::random_problem({}, 1);
  Solver solver = Solver::create(Problem::create(p.view()).value()).value();
  const Solution before = solver.solve().value();
  const std::vector<double> long_z(p.g.size() + 1, 0.0);
  EXPECT_EQ(solver.solve({.initial_z = long_z}).error().code, ErrorCode::invalid_argument);
  const std::vector<double> infinite_z(p.g.size(), std::numeric_limits<double>::infinity());
  const auto refused = solver.solve({.initial_z = infinite_z});
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().field, "initial_z");
  EXPECT_EQ(refused.error().index, 0);
  EXPECT_EQ(solver.solve().value().z, before.z);
}

TEST(Solver, StartsWhereItIsReported) {
  const OwnedProblem p = testing::random_problem({}, 6);
  std::vector<double> start(p.g.size());
  for (std::size_t i = 0; i < start.size(); ++i) start[i] = 0.1 * static_cast<double>(i) - 0.5;
  class FirstPoint : public ProgressSink {
   public:
    void report(const Progress& progress) override {
      if (z.empty()) z.assign(progress.z.begin(), progress.z.end());
    }
    std::vector<double> z;
  } first;
  const Solution s = solve_in_process(p.view(), {}, {.progress = &first, .initial_z = start}).value();
  EXPECT_EQ(s.status, Status::solved);
  ASSERT_EQ(first.z.size(), start.size());
  for (std::size_t i = 0; i < start.size(); ++i) EXPECT_NEAR(first.z[i], start[i], 1e-14);
}

TEST(Solver, GivesTheSameBitsAgainAfreshAndInParallel) {
  const OwnedProblem p = examples::rocket();
  const auto problem = Problem::create(p.view());
  Solver solver = Solver::create(*problem).value();
  const Solution first = solver.solve().value();
  const Solution again = solver.solve().value();
  EXPECT_EQ(first.z, again.z);
  EXPECT_EQ(first.factorizations, again.factorizations);
  Solution parallel[2];
  {
    std::jthread a([&] { parallel[0] = solve_in_process(p.view()).value(); });
    std::jthread b([&] { parallel[1] = solve_in_process(p.view()).value(); });
  }
  for (const Solution& s : parallel) {
    EXPECT_EQ(first.z, s.z);
    EXPECT_EQ(first.inequality_multipliers, s.inequality_multipliers);
    EXPECT_EQ(first.objective, s.objective);
  }
}

// One Solver, solved again, interrupted, solved again: each solve is as the first.
void expect_no_memory(const OwnedProblem& p, const Options& options) {
  Solver solver = Solver::create(Problem::create(p.view()).value(), options).value();
  const Solution first = solver.solve().value();
  const Solution again = solver.solve().value();
  Stopper stopper(3);
  EXPECT_TRUE(solver.solve({.progress = &stopper, .stop = stopper.source.get_token()}).has_value());
  const Solution after_stop = solver.solve().value();
  const std::vector<double> elsewhere(p.g.size(), 0.7);
  EXPECT_TRUE(solver.solve({.initial_z = elsewhere}).has_value());
  const Solution after_start = solver.solve().value();
  for (const Solution* s : {&again, &after_stop, &after_start}) {
    EXPECT_EQ(s->z, first.z) << p.name;
    EXPECT_EQ(s->complementarity_multipliers_L, first.complementarity_multipliers_L) << p.name;
    EXPECT_EQ(s->detail, first.detail) << p.name;
    EXPECT_EQ(s->iterations, first.iterations) << p.name;
    // Whether Q is convex is asked once a solver.
    EXPECT_LE(s->factorizations, first.factorizations) << p.name;
    EXPECT_GE(s->factorizations, first.factorizations - 1) << p.name;
  }
}

TEST(Solver, SolvesBeforeLeaveNoTrace) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) expect_no_memory(testing::random_problem({}, seed), {});
  expect_no_memory(examples::hopper({.steps = 10}), {});
}

TEST(Solver, SolvesBeforeLeaveNoTraceWhereTheInertiaIsCorrected) {
  Options options;
  options.max_iterations = 100;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    expect_no_memory(testing::random_problem({.indefinite = true}, seed), options);
    options.path = seed % 2 == 0 ? Path::fast : Path::paper;
    expect_no_memory(testing::random_problem({}, seed), options);
  }
}

// The optimum over all branches, each solved as a problem without pairs.
double best_of_all_branches(const OwnedProblem& p) {
  double best = std::numeric_limits<double>::infinity();
  const auto pairs = static_cast<unsigned>(p.l.size());
  for (unsigned s_fixed = 0; s_fixed < 1U << pairs; ++s_fixed) {
    const OwnedProblem branch = testing::branch(p, s_fixed);
    const Solution s = solve_in_process(branch.view()).value();
    if (s.status == Status::solved) best = std::min(best, s.objective);
  }
  return best;
}

TEST(Solver, IsNeverBelowTheBestBranchAndMostlyAtIt) {
  constexpr int kProblems = 60;
  int global = 0;
  for (std::uint64_t seed = 1; seed <= kProblems; ++seed) {
    const OwnedProblem p = testing::random_problem({}, seed);
    const double best = best_of_all_branches(p);
    const Solution s = solve_in_process(p.view()).value();
    ASSERT_EQ(s.status, Status::solved) << p.name;
    EXPECT_GE(s.objective, best - 1e-7 * (1.0 + std::abs(best))) << p.name;
    if (s.objective <= best + 1e-6 * (1.0 + std::abs(best))) ++global;
  }
  EXPECT_GE(global, kProblems * 9 / 10);
}

TEST(Solver, PolishNeverMakesAnAnswerWorse) {
  for (const Path path : {Path::fast, Path::paper}) {
    for (std::uint64_t seed = 1; seed <= 60; ++seed) {
      const OwnedProblem p = testing::random_problem({.variables = 16, .pairs = 8}, seed);
      Options options;
      options.path = path;
      const Solution polished = solve_in_process(p.view(), options).value();
      options.polish = false;
      const Solution plain = solve_in_process(p.view(), options).value();
      if (plain.status != Status::solved) continue;
      EXPECT_EQ(polished.status, Status::solved) << p.name;
      // The plain point may be lower by what its violations of up to 1e-6 buy.
      EXPECT_LE(polished.objective, plain.objective + 1e-3 * (1.0 + std::abs(plain.objective))) << p.name;
      EXPECT_LE(judge(p.view(), polished).infeasibility(), 1e-9) << p.name;
    }
  }
}

TEST(Solver, ItsNumbersAreThoseOfItsPointHoweverItEnded) {
  for (const bool indefinite : {false, true}) {
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      const OwnedProblem p = testing::random_problem({.indefinite = indefinite}, seed);
      Options options;
      options.max_iterations = 5 + static_cast<int>(seed) % 40;
      const Solution s = solve_in_process(p.view(), options).value();
      const testing::Verdict verdict = judge(p.view(), s);
      const auto expect_same = [&](double reported, double found) {
        EXPECT_NEAR(reported, found, 1e-9 * (1.0 + std::abs(found))) << p.name << " " << to_string(s.status);
      };
      expect_same(s.objective, verdict.objective);
      expect_same(s.violations.equality, verdict.equality);
      expect_same(s.violations.inequality, verdict.inequality);
      expect_same(s.violations.complementarity, verdict.complementarity);
      double slackness = 0.0;
      for (std::size_t i = 0; i < p.d.size(); ++i) {
        double slack = p.d[i];
        for (Index j = 0; j < p.C.columns; ++j)
          for (Index k = p.C.column_pointers[static_cast<std::size_t>(j)];
               k < p.C.column_pointers[static_cast<std::size_t>(j) + 1]; ++k)
            if (p.C.row_indices[static_cast<std::size_t>(k)] == static_cast<Index>(i))
              slack += p.C.values[static_cast<std::size_t>(k)] * s.z[static_cast<std::size_t>(j)];
        slackness = std::max(slackness, std::abs(slack * s.inequality_multipliers[i]));
      }
      expect_same(s.kkt_residual, std::max(verdict.absolute_stationarity, slackness));
    }
  }
}

TEST(Solver, BoundedIndefiniteProblemsEndAtALocalSolution) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    OwnedProblem p = testing::random_problem({.inequalities = 0, .indefinite = true}, seed);
    Triplets box;
    Index rows = 0;
    for (Index j = 0; j < static_cast<Index>(p.g.size()); ++j) {
      for (const double sign : {1.0, -1.0}) {
        box.add(rows++, j, sign);
        p.d.push_back(5.0);
      }
    }
    p.C = compress(rows, static_cast<Index>(p.g.size()), box, "C").value();
    const Solution s = solve_in_process(p.view()).value();
    ASSERT_EQ(s.status, Status::solved) << p.name << ": " << s.detail;
    EXPECT_NE(s.detail.find("not convex"), std::string::npos) << p.name << ": " << s.detail;
    const testing::Verdict verdict = judge(p.view(), s);
    EXPECT_LE(verdict.infeasibility(), 1e-6) << p.name;
    EXPECT_LE(verdict.stationarity, 1e-6) << p.name;
    EXPECT_LE(verdict.wrong_sign, 1e-6) << p.name;
  }
}

TEST(Solver, UpperTriangleAndFullHessianGiveTheSameBits) {
  OwnedProblem p = testing::random_problem({}, 9);
  const Solution full = solve_in_process(p.view()).value();
  Triplets upper;
  for (Index j = 0; j < p.Q.columns; ++j) {
    for (Index k = p.Q.column_pointers[j]; k < p.Q.column_pointers[j + 1]; ++k) {
      if (p.Q.row_indices[k] <= j) upper.add(p.Q.row_indices[k], j, p.Q.values[k]);
    }
  }
  p.Q = compress(p.Q.rows, p.Q.columns, upper, "Q").value();
  p.hessian_form = HessianForm::upper_triangle;
  EXPECT_EQ(solve_in_process(p.view()).value().z, full.z);
}

}  // namespace
}  // namespace marble
