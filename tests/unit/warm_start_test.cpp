// Updates in place and starts from an earlier answer.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "marble/examples.h"
#include "marble/solver.h"
#include "marble/warm_solver.h"
#include "support/independent_check.h"
#include "support/random_problem.h"

namespace marble {
namespace {

Solver make(const OwnedProblem& p, const Options& options = {}) {
  return Solver::create(Problem::create(p.view()).value(), options).value();
}

void shake(std::vector<double>& values, std::mt19937_64& engine, double size) {
  for (double& value : values) value *= 1.0 + size * (static_cast<double>(engine() >> 11) * 0x1p-52 - 1.0);
}

OwnedProblem shaken(OwnedProblem p, std::uint64_t seed, double size) {
  std::mt19937_64 engine(seed);
  for (auto* vector : {&p.g, &p.b, &p.d, &p.l, &p.r}) shake(*vector, engine, size);
  return p;
}

ProblemUpdate vectors_of(const OwnedProblem& p) {
  return {.c0 = p.c0, .g = p.g, .b = p.b, .d = p.d, .l = p.l, .r = p.r};
}

ProblemUpdate all_of(const OwnedProblem& p) {
  ProblemUpdate update = vectors_of(p);
  update.Q = p.Q.values;
  update.A = p.A.values;
  update.C = p.C.values;
  update.L = p.L.values;
  update.R = p.R.values;
  return update;
}

std::vector<OwnedProblem> of_every_backend() {
  return {testing::random_problem({}, 1), examples::rocket(),
          examples::qpec({.upper_variables = 5, .lower_variables = 20}, 1)};
}

TEST(Update, SolvesTheNewProblemAsIfItWereMadeForIt) {
  for (const OwnedProblem& p : of_every_backend()) {
    Solver solver = make(p);
    static_cast<void>(solver.solve().value());
    const OwnedProblem changed = shaken(p, 7, 0.01);
    ASSERT_TRUE(solver.update(vectors_of(changed)).has_value());
    const Solution updated = solver.solve().value();
    const Solution made = make(changed).solve().value();
    ASSERT_EQ(updated.status, Status::solved) << p.name << updated.detail;
    // Its scale factors are those of the first problem, so the bits differ, and the branch may.
    EXPECT_LE(testing::judge(changed.view(), updated).infeasibility(), 1e-8) << p.name;
    EXPECT_NEAR(updated.objective, made.objective, 1e-8 * (1.0 + std::abs(made.objective))) << p.name;
  }
}

TEST(Update, ThereAndBackGivesTheFirstBitsAgain) {
  for (const OwnedProblem& p : of_every_backend()) {
    Solver solver = make(p);
    const Solution first = solver.solve().value();
    OwnedProblem changed = shaken(p, 3, 0.05);
    std::mt19937_64 engine(5);
    for (auto* matrix : {&changed.A, &changed.C, &changed.L, &changed.R}) shake(matrix->values, engine, 0.01);
    ASSERT_TRUE(solver.update(all_of(changed)).has_value());
    EXPECT_NE(solver.solve().value().z, first.z) << p.name;
    ASSERT_TRUE(solver.update(all_of(p)).has_value());
    const Solution again = solver.solve().value();
    EXPECT_EQ(again.z, first.z) << p.name;
    EXPECT_EQ(again.factorizations, first.factorizations) << p.name;
  }
}

TEST(Update, OfMatrixValuesReachesEveryBackend) {
  for (const OwnedProblem& p : of_every_backend()) {
    Solver solver = make(p);
    OwnedProblem changed = p;
    for (double& value : changed.Q.values) value *= 1.5;
    for (auto* matrix : {&changed.C, &changed.L, &changed.R}) {
      for (double& value : matrix->values) value *= 2.0;
    }
    for (auto* vector : {&changed.d, &changed.l, &changed.r}) {
      for (double& value : *vector) value *= 2.0;
    }
    ASSERT_TRUE(solver.update(all_of(changed)).has_value());
    const Solution s = solver.solve().value();
    ASSERT_EQ(s.status, Status::solved) << p.name;
    const testing::Verdict verdict = testing::judge(changed.view(), s);
    EXPECT_LE(verdict.infeasibility(), 1e-8) << p.name;
    EXPECT_LE(verdict.stationarity, 1e-7) << p.name;
    EXPECT_NEAR(s.objective, verdict.objective, 1e-9 * (1.0 + std::abs(s.objective))) << p.name;
  }
}

TEST(Update, NamesWhatIsWrongAndChangesNothing) {
  const OwnedProblem p = testing::random_problem({}, 2);
  Solver solver = make(p);
  const Solution before = solver.solve().value();
  const std::vector<double> two = {1.0, 2.0};
  std::vector<double> d = p.d;
  d[3] = std::numeric_limits<double>::quiet_NaN();
  const auto message = [&](const ProblemUpdate& update) { return solver.update(update).error().message(); };
  EXPECT_EQ(message({.g = two}), "g = 2 entries: must have 12 entries");
  EXPECT_EQ(message({.g = p.g, .d = d}), "d[3] = nan: must be finite");
  EXPECT_EQ(message({.c0 = std::numeric_limits<double>::infinity()}), "c0 = inf: must be finite");
  ProblemUpdate update;
  update.L = two;
  EXPECT_EQ(solver.update(update).error().field, "L.values");
  EXPECT_EQ(solver.solve().value().z, before.z);
}

TEST(WarmStart, OfTheSameProblemIsTheSameAnswerAtOnce) {
  for (const OwnedProblem& p : of_every_backend()) {
    Solver solver = make(p);
    const Solution cold = solver.solve().value();
    const Solution warm = solver.solve({.warm_start = &cold}).value();
    ASSERT_EQ(warm.status, Status::solved) << p.name;
    EXPECT_LE(warm.factorizations, 3) << p.name;
    EXPECT_NEAR(warm.objective, cold.objective, 1e-8 * (1.0 + std::abs(cold.objective))) << p.name;
    EXPECT_EQ(warm.reference_objective, cold.reference_objective);
  }
}

TEST(WarmStart, SmallChangesTakeFewFactorizationsAndGiveSoundAnswers) {
  for (const OwnedProblem& nominal : of_every_backend()) {
    Solver solver = make(nominal);
    Solution last = solver.solve().value();
    int factorizations = 0;
    for (std::uint64_t step = 1; step <= 10; ++step) {
      const OwnedProblem p = shaken(nominal, step, 1e-3);
      ASSERT_TRUE(solver.update(vectors_of(p)).has_value());
      last = solver.solve({.warm_start = &last}).value();
      ASSERT_EQ(last.status, Status::solved) << p.name << ": " << last.detail;
      const testing::Verdict verdict = testing::judge(p.view(), last);
      EXPECT_LE(verdict.infeasibility(), 1e-8) << p.name;
      EXPECT_LE(verdict.stationarity, 1e-7) << p.name;
      factorizations += last.factorizations;
    }
    EXPECT_LE(factorizations, 60) << nominal.name;
  }
}

TEST(WarmStart, FromAnotherProblemsAnswerIsStillAnAnswer) {
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    const OwnedProblem p = testing::random_problem({}, seed);
    const Solution other = solve_in_process(testing::random_problem({}, seed + 100).view()).value();
    const Solution warm = make(p).solve({.warm_start = &other}).value();
    ASSERT_EQ(warm.status, Status::solved) << p.name << ": " << warm.detail;
    EXPECT_LE(testing::judge(p.view(), warm).infeasibility(), 1e-8) << p.name;
  }
}

TEST(WarmStart, OfTheHopperFollowsItsHorizon) {
  examples::HopperParameters parameters{.steps = 20};
  OwnedProblem p = examples::hopper(parameters);
  Solver solver = make(p);
  Solution plan = solver.solve().value();
  int warm = 0;
  int cold = 0;
  for (int tick = 0; tick < 10; ++tick) {
    parameters = examples::advance(parameters, plan.z);
    p = examples::hopper(parameters);
    const Solution shifted = examples::shift_hopper(plan);
    ASSERT_TRUE(solver.update(vectors_of(p)).has_value());
    plan = solver.solve({.warm_start = &shifted}).value();
    ASSERT_EQ(plan.status, Status::solved) << plan.detail;
    EXPECT_LE(testing::judge(p.view(), plan).infeasibility(), 1e-8);
    warm += plan.factorizations;
    cold += solver.solve().value().factorizations;
  }
  EXPECT_LT(warm, cold / 2);
}

// The solutions of a closed loop over a session.
std::vector<Solution> hops(int control_steps) {
  examples::HopperParameters parameters{.steps = 10};
  OwnedProblem p = examples::hopper(parameters);
  WarmSolver session = WarmSolver::create(Problem::create(p.view()).value()).value();
  std::vector<Solution> solutions = {session.solve({}).value()};
  for (int step = 1; step <= control_steps; ++step) {
    parameters = examples::advance(parameters, solutions.back().z);
    p = examples::hopper(parameters);
    const Restart restart{.shift = Shift::by_stage(p.view(), parameters.steps).value()};
    solutions.push_back(session.solve(vectors_of(p), restart).value());
  }
  return solutions;
}

TEST(WarmStart, OfAControlStepFollowsTheChangeWithTwoFactorizationsAndSearchesFromTimeToTime) {
  const std::vector<Solution> solutions = hops(30);
  int followed = 0, searched = 0;
  for (std::size_t step = 1; step < solutions.size(); ++step) {
    const Solution& s = solutions[step];
    ASSERT_EQ(s.status, Status::solved) << s.detail;
    const bool keeps_reference = s.reference_objective == solutions[step - 1].reference_objective;
    EXPECT_TRUE(keeps_reference || s.reference_objective == s.objective) << step;
    (keeps_reference ? followed : searched) += 1;
    if (keeps_reference) {
      EXPECT_LE(s.objective, 1.2 * s.reference_objective) << step << ": a rise calls for a search";
      EXPECT_LE(s.factorizations, 100) << step << ": " << s.detail;
    }
  }
  EXPECT_GE(searched, 3);
  EXPECT_GE(followed, 15);
  EXPECT_GE(std::ranges::count_if(solutions, [](const Solution& s) { return s.factorizations == 2; }), 8);
}

TEST(WarmStart, OfALoopGivesTheSameBitsInEverySession) {
  const std::vector<Solution> one = hops(15), other = hops(15);
  for (std::size_t step = 0; step < one.size(); ++step) {
    EXPECT_EQ(one[step].z, other[step].z) << step;
    EXPECT_EQ(one[step].factorizations, other[step].factorizations) << step;
  }
}

TEST(WarmStart, OfOtherSizesIsAnErrorThatNamesTheField) {
  const OwnedProblem p = testing::random_problem({}, 4);
  Solver solver = make(p);
  Solution s = solver.solve().value();
  s.inequality_multipliers.pop_back();
  EXPECT_EQ(solver.solve({.warm_start = &s}).error().message(),
            "warm_start.inequality_multipliers = 4 entries: must have 5 entries");
  s = solver.solve().value();
  s.z[2] = std::numeric_limits<double>::infinity();
  EXPECT_EQ(solver.solve({.warm_start = &s}).error().message(), "warm_start.z[2] = inf: must be finite");
  s = solver.solve().value();
  s.reference_objective = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(solver.solve({.warm_start = &s}).error().message(),
            "warm_start.reference_objective = nan: must be a number");
}

TEST(WarmStart, HearsAStopAndKeepsLimits) {
  const OwnedProblem p = examples::hopper({.steps = 10});
  Solver solver = make(p);
  const Solution first = solver.solve().value();
  std::stop_source stop;
  stop.request_stop();
  EXPECT_EQ(solver.solve({.stop = stop.get_token(), .warm_start = &first}).value().status, Status::cancelled);
  Options options;
  options.time_limit_s = 0.0;
  EXPECT_EQ(make(p, options).solve({.warm_start = &first}).value().status, Status::time_limit);
}

}  // namespace
}  // namespace marble
