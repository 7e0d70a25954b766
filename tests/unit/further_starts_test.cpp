// Option num_starts: further searches from the best branch, at once or one after the other.
#include "search/further_starts.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <thread>

#include "marble/examples.h"
#include "marble/solver.h"
#include "support/independent_check.h"
#include "support/random_problem.h"
#include "workbench.h"

namespace marble {
namespace {

class ThreadPerTask final : public TaskRunner {
 public:
  void run(std::span<const std::function<void()>> tasks) override {
    std::vector<std::thread> threads;
    for (const auto& task : tasks) threads.emplace_back(task);
    for (std::thread& thread : threads) thread.join();
    most = std::max(most, tasks.size());
  }
  std::size_t most = 0;
};

class Backwards final : public TaskRunner {
 public:
  void run(std::span<const std::function<void()>> tasks) override {
    for (auto task = tasks.rbegin(); task != tasks.rend(); ++task) (*task)();
  }
};

Solution solved(const OwnedProblem& p, int starts, TaskRunner* runner) {
  Options options;
  options.num_starts = starts;
  Solver solver = Solver::create(Problem::create(p.view()).value(), options).value();
  return solver.solve({.runner = runner}).value();
}

TEST(FurtherStarts, GiveTheSameBitsWhoeverRunsThemAndInWhateverOrder) {
  const OwnedProblem p = examples::hopper({.steps = 16});
  for (const int starts : {2, 8}) {
    const Solution alone = solved(p, starts, nullptr);
    ThreadPerTask threads;
    Backwards backwards;
    for (TaskRunner* runner : {static_cast<TaskRunner*>(&threads), static_cast<TaskRunner*>(&backwards)}) {
      const Solution shared = solved(p, starts, runner);
      EXPECT_EQ(shared.z, alone.z) << starts;
      EXPECT_EQ(shared.factorizations, alone.factorizations) << starts;
      EXPECT_EQ(shared.iterations, alone.iterations) << starts;
    }
    EXPECT_EQ(threads.most > 1, starts > 2) << "one alone needs no other thread";
  }
}

TEST(FurtherStarts, MoreOfThemAreNeverWorse) {
  const OwnedProblem p = examples::hopper({.steps = 30});
  double best = solved(p, 1, nullptr).objective;
  for (const int starts : {2, 5, 9}) {
    const Solution s = solved(p, starts, nullptr);
    EXPECT_EQ(s.status, Status::solved);
    EXPECT_LE(s.objective, best + 1e-9 * std::abs(best));
    EXPECT_LE(testing::judge(p.view(), s).infeasibility(), 1e-9);
    best = s.objective;
  }
}

// Whatever a solve does between and after its starts.
TEST(FurtherStarts, MoreOfThemAreNeverWorseOnRandomProblemsConvexOrNot) {
  int better = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    for (const bool indefinite : {false, true}) {
      const OwnedProblem p = testing::random_problem(
          {.variables = 14, .equalities = 1, .inequalities = 28, .pairs = 6, .indefinite = indefinite}, seed);
      double before = std::numeric_limits<double>::infinity();
      for (const int starts : {1, 2, 4, 8}) {
        Options options;
        options.num_starts = starts;
        if (seed % 4 != 0) options.max_small_problem_nodes = 0;  // which leaves them something to find
        const Solution s = solve_in_process(p.view(), options).value();
        if (s.status != Status::solved) break;
        EXPECT_LE(s.objective, before + 1e-9 * (1.0 + std::abs(before))) << p.name << " " << starts;
        EXPECT_LE(testing::judge(p.view(), s).infeasibility(), 1e-6) << p.name << " " << starts;
        better += starts > 1 && s.objective < before - 1e-6 ? 1 : 0;
        before = s.objective;
      }
    }
  }
  EXPECT_GT(better, 0) << "where Q is not convex";
}

Solution within(double effort, const OwnedProblem& p) {
  return solve_in_process(p.view(), Options{.effort = effort}).value();
}

TEST(FurtherStarts, RunUnaskedWithinTheirBudget) {
  for (const int steps : {16, 24, 32}) {
    const OwnedProblem p = examples::hopper({.steps = steps});
    const Solution without = within(0.0, p);
    double before = without.objective;
    for (const double budget : {0.5, 1.0, 4.0}) {
      const Solution s = within(budget, p);
      ASSERT_EQ(s.status, Status::solved);
      EXPECT_LE(s.objective, before + 1e-9 * std::abs(before)) << steps << " " << budget;
      EXPECT_LE(testing::judge(p.view(), s).infeasibility(), 1e-9);
      // Beside the starts: the exact solution of the last one, and the tests of the result.
      EXPECT_LE(s.factorizations, (1.0 + budget) * without.factorizations + 150) << steps << " " << budget;
      before = s.objective;
    }
  }
}

// They were ended by the default limit, and what finishes an answer with them.
TEST(FurtherStarts, AreNotEndedByALimitOnIterationsThatThePathKeeps) {
  const OwnedProblem p = examples::hopper({.steps = 16});
  Options first;
  first.max_local_search_factorizations = 0;
  const int without_search = solve_in_process(p.view(), first).value().iterations;
  const Solution all = solved(p, 8, nullptr);
  ASSERT_GT(all.iterations, without_search + 1);
  Options options;
  options.num_starts = 8;
  options.max_iterations = without_search + 1;
  const Solution s = solve_in_process(p.view(), options).value();
  EXPECT_EQ(s.status, Status::solved);
  EXPECT_EQ(s.z, all.z);
  EXPECT_EQ(s.iterations, all.iterations);
  EXPECT_EQ(s.b_stationary, all.b_stationary);
}

TEST(FurtherStarts, StopWithTheRestOfTheSolve) {
  const OwnedProblem p = examples::hopper();
  std::stop_source source;
  class Stopper final : public TaskRunner {
   public:
    explicit Stopper(std::stop_source& stop) : source_(stop) {}
    void run(std::span<const std::function<void()>> tasks) override {
      ++rounds;
      source_.request_stop();
      for (const auto& task : tasks) task();
    }
    int rounds = 0;

   private:
    std::stop_source& source_;
  } stopper(source);
  Options options;
  options.num_starts = 50;
  Solver solver = Solver::create(Problem::create(p.view()).value(), options).value();
  const Solution s = solver.solve({.stop = source.get_token(), .runner = &stopper}).value();
  EXPECT_EQ(stopper.rounds, 1);
  EXPECT_LE(testing::judge(p.view(), s).infeasibility(), 1e-6) << "the best so far";
}

// One round by itself.
struct Round : testing::Workbench {
  explicit Round(const OwnedProblem& p, const Options& chosen = {}, testing::Rows* reported = nullptr)
      : Workbench(p, chosen, reported),
        branch(problem, *kkt),
        search(problem, *kkt, branch.elastic),
        interior(problem, *kkt),
        engine(problem, options, branch, search, interior),
        incumbent(problem, options, branch.exact) {
    branch.point.start_from_point(zero());
    begun = search.run(run, kPlan, 1000) &&
            incumbent.solve_branch(run, "a search", 100) == Incumbent::Outcome::kept;
  }
  static constexpr SearchPlan kPlan{.rho_first = 10.0,
                                    .rho_factor = 10.0,
                                    .rho_last = 1e8,
                                    .rho_soft = 2e3,
                                    .rho_exchange = 1e300,
                                    .from_exact = false,
                                    .first_patience = 5,
                                    .switch_patience = 5,
                                    .exchange_patience = 0};

  // Starts of both kinds in turn.
  FurtherStarts::Gains round() {
    using enum FurtherStarts::Kind;
    const FurtherStarts::Start starts[] = {{softened, 1}, {random, 0}, {softened, 2}, {random, 1}};
    static_assert(std::size(starts) == tuning::further_round);
    return engine.round(run, {kPlan, kPlan, 1000, 1, 0}, starts, incumbent);
  }

  BranchEngines branch;
  LocalSearch search;
  InteriorEngine interior;
  FurtherStarts engine;
  Incumbent incumbent;
  bool begun = false;
};

TEST(FurtherStarts, ARoundReplacesTheBestOnlyByWhatIsBetterExactAndFeasible) {
  int better = 0;
  int kept = 0;
  for (const int steps : {6, 8, 10, 12, 14, 16}) {
    Round r(examples::hopper({.steps = steps}));
    ASSERT_TRUE(r.begun) << steps;
    const ExactSolution before = r.incumbent.best();
    const FurtherStarts::Gains gains = r.round();
    if (gains.softened + gains.random > 0) {
      ++better;
      EXPECT_LT(r.incumbent.best().objective, before.objective) << steps;
      EXPECT_LE(r.judged(r.incumbent.best().x.z()).infeasibility(), 1e-8) << steps;
      EXPECT_NEAR(r.incumbent.best().objective, r.images(r.incumbent.best().x).objective,
                  1e-9 * (1.0 + std::abs(r.incumbent.best().objective)));
    } else {
      ++kept;
      EXPECT_EQ(r.incumbent.best().x.all, before.x.all) << "what is not better leaves no trace: " << steps;
      EXPECT_EQ(r.incumbent.best().objective, before.objective);
      EXPECT_TRUE(r.incumbent.best().set == before.set);
    }
  }
  EXPECT_GT(better, 0);
  EXPECT_GT(kept, 0);
}

TEST(FurtherStarts, ARoundCountsTheWorkOfAllItsSearchesAndReportsOneRowAtMost) {
  testing::Rows rows;
  Round r(examples::hopper({.steps = 10}), {}, &rows);
  ASSERT_TRUE(r.begun);
  const int factorizations = r.run.factorizations;
  const int iterations = r.run.iterations;
  const std::size_t reported = rows.rows.size();
  r.round();
  EXPECT_GE(r.run.factorizations - factorizations, tuning::further_round);
  EXPECT_GT(r.run.iterations, iterations);
  EXPECT_LE(rows.rows.size(), reported + 1) << "searches that may go on at once are silent";
}

TEST(FurtherStarts, ARoundForWhoIsToStopChangesNothing) {
  testing::Rows rows;
  Round r(examples::hopper({.steps = 8}), {}, &rows);
  ASSERT_TRUE(r.begun);
  const Vector before = r.incumbent.best().x.all;
  rows.source.request_stop();
  const int factorizations = r.run.factorizations;
  const FurtherStarts::Gains gains = r.round();
  EXPECT_EQ(gains.softened + gains.random, 0);
  EXPECT_EQ(r.run.factorizations, factorizations);
  EXPECT_EQ(r.incumbent.best().x.all, before);
}

}  // namespace
}  // namespace marble
