#include "marble/solver.h"

#include <gtest/gtest.h>

#include <cmath>
#include <thread>

#include "marble/examples.h"
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
    rows.push_back(progress);
    rows.back().z = {};
    sizes.push_back(progress.z.size());
  }
  std::vector<Progress> rows;
  std::vector<std::size_t> sizes;
};

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
      const Solution s = solve(problem.view(), options).value();
      EXPECT_EQ(s.status, Status::solved) << problem.name << ": " << s.detail;
      EXPECT_NEAR(s.objective, optimum, 1e-5 * std::max(1.0, std::abs(optimum))) << problem.name;
    }
  }
}

TEST(Solver, SolvedPointsPassTheIndependentCheck) {
  for (const auto& [problem, optimum] : small_problems()) {
    const Solution s = solve(problem.view()).value();
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
          const Solution s = solve(p.view()).value();
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
    const Solution s = solve(problem.view(), options).value();
    EXPECT_EQ(s.status, Status::solved);
    EXPECT_NEAR(s.objective, optimum, 1e-4);
    EXPECT_LE(s.factorizations, 26);
  }
}

TEST(Solver, RoboticsProblemsEndFeasible) {
  for (const OwnedProblem& p : {examples::hopper(), examples::rocket()}) {
    const Solution s = solve(p.view()).value();
    EXPECT_EQ(s.status, Status::solved) << p.name << ": " << s.detail;
    EXPECT_LE(judge(p.view(), s).infeasibility(), 1e-8) << p.name;
  }
}

TEST(Solver, GatesEndFeasibleOrSayWhyNot) {
  const OwnedProblem p = examples::gates();
  const Solution s = solve(p.view()).value();
  if (is_solved(s.status)) {
    EXPECT_LE(judge(p.view(), s).infeasibility(), 1e-6);
  } else {
    EXPECT_NE(s.detail.find("violations: equality"), std::string::npos) << s.detail;
    EXPECT_NEAR(judge(p.view(), s).infeasibility(),
                std::max({s.violations.equality, s.violations.inequality, s.violations.complementarity}),
                1e-9);
  }
}

TEST(Solver, ReportsEveryIterationOnceWithGrowingCounters) {
  for (const Path path : {Path::fast, Path::paper}) {
    Options options;
    options.path = path;
    options.polish = false;
    Recorder recorder;
    const OwnedProblem p = testing::random_problem({}, 3);
    const Solution s = solve(p.view(), options, {.progress = &recorder}).value();
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

TEST(Solver, AStopIsHeardWithinOneIteration) {
  for (const Path path : {Path::fast, Path::paper}) {
    Options options;
    options.path = path;
    Stopper stopper(3);
    const OwnedProblem p = examples::hopper();
    const Solution s =
        solve(p.view(), options, {.progress = &stopper, .stop = stopper.source.get_token()}).value();
    EXPECT_EQ(s.status, Status::cancelled);
    EXPECT_EQ(stopper.rows, 3);
    EXPECT_EQ(s.z.size(), p.g.size());
    EXPECT_NEAR(judge(p.view(), s).infeasibility(),
                std::max({s.violations.equality, s.violations.inequality, s.violations.complementarity}),
                1e-9);
  }
}

TEST(Solver, LimitsEndTheSolveWithTheirOwnStatus) {
  const OwnedProblem p = examples::hopper({.steps = 10});
  Options options;
  options.max_iterations = 4;
  const Solution limited = solve(p.view(), options).value();
  EXPECT_EQ(limited.status, Status::iteration_limit);
  EXPECT_EQ(limited.iterations, 4);
  options = {};
  options.time_limit_s = 0.0;
  const Solution late = solve(p.view(), options).value();
  EXPECT_EQ(late.status, Status::time_limit);
  EXPECT_EQ(late.iterations, 0);
}

TEST(Solver, BadInitialPointsAndOptionsAreErrors) {
  const OwnedProblem p = testing::random_problem({}, 1);
  const std::vector<double> short_z(3, 0.0);
  EXPECT_EQ(solve(p.view(), {}, {.initial_z = short_z}).error().field, "initial_z");
  std::vector<double> nan_z(p.g.size(), 0.0);
  nan_z[5] = std::nan("");
  EXPECT_EQ(solve(p.view(), {}, {.initial_z = nan_z}).error().index, 5);
  Options options;
  options.kappa_factor = 2.0;
  EXPECT_EQ(solve(p.view(), options).error().field, "kappa_factor");
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
    std::jthread a([&] { parallel[0] = solve(p.view()).value(); });
    std::jthread b([&] { parallel[1] = solve(p.view()).value(); });
  }
  for (const Solution& s : parallel) {
    EXPECT_EQ(first.z, s.z);
    EXPECT_EQ(first.inequality_multipliers, s.inequality_multipliers);
    EXPECT_EQ(first.objective, s.objective);
  }
}

TEST(Solver, UpperTriangleAndFullHessianGiveTheSameBits) {
  OwnedProblem p = testing::random_problem({}, 9);
  const Solution full = solve(p.view()).value();
  Triplets upper;
  for (Index j = 0; j < p.Q.columns; ++j) {
    for (Index k = p.Q.column_pointers[j]; k < p.Q.column_pointers[j + 1]; ++k) {
      if (p.Q.row_indices[k] <= j) upper.add(p.Q.row_indices[k], j, p.Q.values[k]);
    }
  }
  p.Q = compress(p.Q.rows, p.Q.columns, upper, "Q").value();
  p.hessian_form = HessianForm::upper_triangle;
  EXPECT_EQ(solve(p.view()).value().z, full.z);
}

}  // namespace
}  // namespace marble
