// A sequence's solves that are cut off: what they answer, and that the next one goes on from there.
#include <gtest/gtest.h>

#include "marble/examples.h"
#include "marble/warm_solver.h"
#include "support/independent_check.h"
#include "support/random_problem.h"

namespace marble {
namespace {

constexpr int kNoEnd = 1000000;
constexpr int kMostCuts = 400;
constexpr double kFeasible = 1e-6;

// Stops the solve after so many rows.
class StopAfter final : public ProgressSink {
 public:
  explicit StopAfter(int rows) : left_(rows) {}
  void report(const Progress& /*progress*/) override {
    if (--left_ == 0) stop_.request_stop();
  }
  [[nodiscard]] SolveControls controls() { return {.progress = this, .stop = stop_.get_token()}; }

 private:
  int left_;
  std::stop_source stop_;
};

WarmSolver solver_of(const OwnedProblem& p, const Options& options = {}) {
  WarmSolver solver = WarmSolver::create(Problem::create(p.view()).value(), options, p.initial_z).value();
  solver.set_most_misses(kNoEnd);
  return solver;
}

Solution cut_off(WarmSolver& solver, int rows, const ProblemUpdate& update = {},
                 const Restart& restart = {}) {
  StopAfter stop(rows);
  return solver.solve(update, restart, stop.controls()).value();
}

struct InPieces {
  Solution solution;
  int cuts = 0, factorizations = 0;
};

InPieces solve_interrupted(const OwnedProblem& p, int rows) {
  WarmSolver solver = solver_of(p);
  InPieces result;
  while (true) {
    result.solution = cut_off(solver, rows);
    result.factorizations += result.solution.factorizations;
    if (result.solution.status != Status::cancelled || result.cuts == kMostCuts) return result;
    ++result.cuts;
  }
}

void expect_solved_in_pieces(const OwnedProblem& p, const std::string& name) {
  const Solution whole = solve_in_process(p.view()).value();
  ASSERT_EQ(whole.status, Status::solved) << name;
  for (const int rows : {2, 3, 5}) {
    const InPieces parts = solve_interrupted(p, rows);
    ASSERT_EQ(parts.solution.status, Status::solved)
        << name << ", rows " << rows << ": " << parts.solution.detail;
    EXPECT_EQ(parts.solution.origin, PointOrigin::solve);
    const testing::Verdict verdict = testing::judge(p.view(), parts.solution);
    EXPECT_LE(verdict.infeasibility(), kFeasible) << name << ", rows " << rows;
    EXPECT_LE(verdict.stationarity, kFeasible) << name << ", rows " << rows;
    EXPECT_LE(parts.factorizations, 2 * whole.factorizations + 2 * parts.cuts) << name << ", rows " << rows;
  }
}

TEST(InterruptedSolve, GoesOnWhereItWasUntilItIsSolved) {
  expect_solved_in_pieces(examples::rocket(), "rocket");
  expect_solved_in_pieces(examples::hopper({.steps = 12}), "hopper");
  expect_solved_in_pieces(examples::hopper({.steps = 20}), "hopper 20");
}

TEST(InterruptedSolve, OfRandomProblemsEndsAsThatOfOnePiece) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed)
    expect_solved_in_pieces(
        testing::random_problem({.variables = 30, .equalities = 5, .inequalities = 12, .pairs = 9}, seed),
        "seed " + std::to_string(seed));
}

TEST(InterruptedSolve, WithoutPairsGoesOnInTheInteriorPointMethod) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const OwnedProblem p =
        testing::random_problem({.variables = 40, .equalities = 6, .inequalities = 30, .pairs = 0}, seed);
    const InPieces parts = solve_interrupted(p, 3);
    ASSERT_EQ(parts.solution.status, Status::solved) << "seed " << seed;
    EXPECT_GE(parts.cuts, 1) << "seed " << seed;
    const double objective = solve_in_process(p.view())->objective;
    EXPECT_NEAR(parts.solution.objective, objective, kFeasible * (1.0 + std::abs(objective)));
  }
}

// As a planner's are: no two of its problems are the same.
TEST(InterruptedSolve, GoesOnWithNewNumbers) {
  examples::HopperParameters parameters{.steps = 12};
  const OwnedProblem first = examples::hopper(parameters);
  WarmSolver solver = solver_of(first);
  std::vector<double> b = first.b;
  int cuts = 0;
  Solution solution;
  do {
    b[0] += 1e-4;
    solution = cut_off(solver, 4, {.b = b});
  } while (solution.status == Status::cancelled && ++cuts < kMostCuts);
  EXPECT_GE(cuts, 2);
  ASSERT_EQ(solution.status, Status::solved) << solution.detail;
  OwnedProblem now = first;
  now.b = b;
  EXPECT_LE(testing::judge(now.view(), solution).infeasibility(), kFeasible);
}

TEST(InterruptedSolve, IsAnsweredWithTheLastSolutionWhereOnlyThatIsFeasible) {
  const OwnedProblem p = examples::hopper({.steps = 12});
  WarmSolver solver = solver_of(p);
  const Solution before = solver.solve().value();
  ASSERT_EQ(before.status, Status::solved);
  std::stop_source stopped;
  stopped.request_stop();
  std::vector<double> g = p.g;
  for (double& value : g) value += 1e-3;
  const Solution late = solver.solve({.g = g}, {}, {.stop = stopped.get_token()}).value();
  EXPECT_EQ(late.status, Status::cancelled);
  EXPECT_EQ(late.origin, PointOrigin::previous);
  EXPECT_EQ(late.z, before.z);
  OwnedProblem now = p;
  now.g = g;
  const testing::Verdict verdict = testing::judge(now.view(), late);
  EXPECT_LE(verdict.infeasibility(), kFeasible);
  EXPECT_NEAR(verdict.objective, late.objective, 1e-9 * (1.0 + std::abs(late.objective)));
  EXPECT_EQ(solver.solve().value().origin, PointOrigin::solve);
}

TEST(InterruptedSolve, IsNotAnsweredWithALastSolutionThatIsNoMoreFeasible) {
  const OwnedProblem p = examples::hopper({.steps = 12});
  WarmSolver solver = solver_of(p);
  ASSERT_EQ(solver.solve().value().status, Status::solved);
  std::vector<double> b = p.b;
  b[0] += 0.1;
  std::stop_source stopped;
  stopped.request_stop();
  const Solution late = solver.solve({.b = b}, {}, {.stop = stopped.get_token()}).value();
  EXPECT_EQ(late.status, Status::cancelled);
  EXPECT_EQ(late.origin, PointOrigin::solve);
}

TEST(InterruptedSolve, BeginsAnewWhereItsRestartSaysSo) {
  const OwnedProblem p = examples::hopper({.steps = 12});
  const Solution whole = solver_of(p).solve().value();
  WarmSolver solver = solver_of(p);
  ASSERT_EQ(cut_off(solver, 4).status, Status::cancelled);
  const Solution cold = solver.solve({}, {.cold = true}).value();
  EXPECT_EQ(cold.z, whole.z);
  EXPECT_EQ(cold.factorizations, whole.factorizations);
  ASSERT_EQ(cut_off(solver, 4, {}, {.cold = true}).status, Status::cancelled);
  const Solution elsewhere =
      solver.solve({}, {.initial_z = p.initial_z.empty() ? whole.z : p.initial_z}).value();
  EXPECT_EQ(elsewhere.status, Status::solved);
}

TEST(InterruptedSolve, BeginsAnewWhereTheMethodIsAnother) {
  const OwnedProblem p = examples::rocket();
  Options paper;
  paper.path = Path::paper;
  const Solution whole = solver_of(p, paper).solve().value();
  WarmSolver solver = solver_of(p);
  ASSERT_EQ(cut_off(solver, 4).status, Status::cancelled);
  ASSERT_TRUE(solver.set_options(paper).has_value());
  const Solution solution = solver.solve().value();
  EXPECT_EQ(solution.z, whole.z);
  EXPECT_EQ(solution.iterations, whole.iterations);
}

TEST(InterruptedSolve, TooOftenInARowTheNextForgetsAllBeforeIt) {
  const OwnedProblem p = examples::hopper({.steps = 12});
  const Solution whole = solver_of(p).solve().value();
  WarmSolver solver = solver_of(p);
  solver.set_most_misses(3);
  for (int miss = 0; miss < 3; ++miss) {
    EXPECT_EQ(solver.restarts(), 0);
    ASSERT_EQ(cut_off(solver, 3).status, Status::cancelled);
  }
  EXPECT_EQ(solver.restarts(), 1);
  const Solution anew = solver.solve().value();
  EXPECT_EQ(anew.z, whole.z);
  EXPECT_EQ(anew.factorizations, whole.factorizations);
}

// Stops the solve at the first row of its tree.
class StopInTree final : public ProgressSink {
 public:
  void report(const Progress& progress) override {
    if (progress.nodes > 0) stop_.request_stop();
  }
  [[nodiscard]] SolveControls controls() { return {.progress = this, .stop = stop_.get_token()}; }

 private:
  std::stop_source stop_;
};

TEST(InterruptedSolve, OfATreeLeavesItsBestPointToStartFrom) {
  const OwnedProblem p = examples::hopper({.steps = 20});
  Options global;
  global.global_search = true;
  const Solution cold = solver_of(p).solve().value();
  WarmSolver solver = solver_of(p, global);
  StopInTree stop;
  const Solution cut = solver.solve({}, {}, stop.controls()).value();
  ASSERT_EQ(cut.status, Status::cancelled) << cut.detail;
  EXPECT_LE(testing::judge(p.view(), cut).infeasibility(), kFeasible);
  ASSERT_TRUE(solver.set_options({}).has_value());
  const Solution warm = solver.solve().value();
  EXPECT_EQ(warm.status, Status::solved);
  EXPECT_LT(2 * warm.factorizations, cold.factorizations);
}

TEST(InterruptedSolve, AFirstPartDoesNotDisturbIt) {
  const OwnedProblem p = examples::hopper({.steps = 12});
  WarmSolver parts = solver_of(p), whole = solver_of(p);
  for (WarmSolver* solver : {&parts, &whole}) {
    ASSERT_EQ(solver->solve().value().status, Status::solved);
    ASSERT_EQ(cut_off(*solver, 5, {}, {.cold = true}).status, Status::cancelled);
  }
  ASSERT_TRUE(parts.prepare({.g = p.g}).has_value());
  EXPECT_EQ(parts.solve().value().z, whole.solve().value().z);
}

}  // namespace
}  // namespace marble
