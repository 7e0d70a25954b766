// Option starts: further searches from the best branch, at once or one after the other.
#include "search/further_starts.h"

#include <gtest/gtest.h>

#include <cmath>
#include <thread>

#include "marble/examples.h"
#include "marble/solver.h"
#include "search/branch_search.h"
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
  options.starts = starts;
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
  options.starts = 50;
  Solver solver = Solver::create(Problem::create(p.view()).value(), options).value();
  const Solution s = solver.solve({.stop = source.get_token(), .runner = &stopper}).value();
  EXPECT_EQ(stopper.rounds, 1);
  EXPECT_LE(testing::judge(p.view(), s).infeasibility(), 1e-6) << "the best so far";
}

// One round by itself.
struct Round : testing::Workbench {
  explicit Round(const OwnedProblem& p, const Options& chosen = {}, testing::Rows* told = nullptr)
      : Workbench(p, chosen, told),
        branch(problem, *kkt),
        search(problem, *kkt, branch.elastic),
        engine(problem, options, branch, search),
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
                                    .flip_patience = 5,
                                    .exchange_patience = 0};

  BranchEngines branch;
  LocalSearch search;
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
    if (r.engine.round(r.run, Round::kPlan, 1, tuning::further_round, r.incumbent)) {
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

TEST(FurtherStarts, ARoundCountsTheWorkOfAllItsSearchesAndTellsOneRowAtMost) {
  testing::Rows rows;
  Round r(examples::hopper({.steps = 10}), {}, &rows);
  ASSERT_TRUE(r.begun);
  const int factorizations = r.run.factorizations;
  const int iterations = r.run.iterations;
  const std::size_t told = rows.rows.size();
  static_cast<void>(r.engine.round(r.run, Round::kPlan, 1, tuning::further_round, r.incumbent));
  EXPECT_GE(r.run.factorizations - factorizations, tuning::further_round);
  EXPECT_GT(r.run.iterations, iterations);
  EXPECT_LE(rows.rows.size(), told + 1) << "searches that may go on at once are silent";
}

TEST(FurtherStarts, ARoundForWhoIsToStopChangesNothing) {
  testing::Rows rows;
  Round r(examples::hopper({.steps = 8}), {}, &rows);
  ASSERT_TRUE(r.begun);
  const Vector before = r.incumbent.best().x.all;
  rows.source.request_stop();
  const int factorizations = r.run.factorizations;
  EXPECT_FALSE(r.engine.round(r.run, Round::kPlan, 1, tuning::further_round, r.incumbent));
  EXPECT_EQ(r.run.factorizations, factorizations);
  EXPECT_EQ(r.incumbent.best().x.all, before);
}

// Says when each further start begins: each is softer than all before it.
class NotingKkt final : public testing::WrappedKkt {
 public:
  NotingKkt(Kkt& inner, std::function<void()> begins) : WrappedKkt(inner), begins_(std::move(begins)) {}
  [[nodiscard]] bool factor(const RowWeights& weights) override {
    const double next = tuning::soft_rho * std::pow(tuning::further_softer, begun + 1);
    if (std::abs(weights.rho - next) <= 1e-12 * next) {
      ++begun;
      begins_();
    }
    return WrappedKkt::factor(weights);
  }
  int begun = 0;

 private:
  std::function<void()> begins_;
};

TEST(FurtherStarts, AreFreeAfterACheapSoftStartWhileTheyGain) {
  int by_count = 0;
  int by_uselessness = 0;
  int by_cost = 0;
  std::vector<OwnedProblem> problems;
  for (const int steps : {8, 18, 21}) problems.push_back(examples::hopper({.steps = steps}));
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    problems.push_back(
        testing::random_problem({.variables = 20, .equalities = 1, .inequalities = 0, .pairs = 20}, seed));
    problems.push_back(examples::qpec(
        {.upper_variables = 4, .lower_variables = 12, .constraints = 2, .degenerate_pairs = 2}, seed));
  }
  for (const OwnedProblem& problem : problems) {
    for (const bool after_soft_start : {true, false}) {
      testing::Workbench w(problem);
      const Incumbent* found = nullptr;
      std::vector<double> objectives;  // of the incumbent as each start begins, then at the end
      std::vector<int> factorizations;
      NotingKkt kkt(*w.kkt, [&] {
        objectives.push_back(found->best().objective);
        factorizations.push_back(w.run.factorizations - 1);
      });
      PathEngine path(w.problem, kkt, w.options);
      BranchEngines branch(w.problem, kkt);
      Incumbent incumbent(w.problem, w.options, branch.exact);
      found = &incumbent;
      BranchSearch search(w.problem, kkt, w.options, path, branch, incumbent);
      search.find(w.run, w.zero());
      if (!incumbent.exists()) continue;
      search.start_further(w.run, after_soft_start);
      if (!after_soft_start) {
        EXPECT_EQ(kkt.begun, 0) << "nobody asked for any";
        continue;
      }
      objectives.push_back(incumbent.best().objective);
      factorizations.push_back(w.run.factorizations);
      int useless = 0;  // in a row
      for (int i = 0; i < kkt.begun; ++i) {
        const auto start = static_cast<std::size_t>(i);
        EXPECT_LT(i + 1, tuning::further_round);
        EXPECT_LT(useless, tuning::useless_starts);
        EXPECT_LT(factorizations[start], tuning::cheap_search);
        useless = objectives[start + 1] < objectives[start] ? 0 : useless + 1;
      }
      const bool count = kkt.begun + 1 == tuning::further_round;
      const bool gave_up = useless == tuning::useless_starts;
      const bool cost = factorizations.back() >= tuning::cheap_search;
      EXPECT_TRUE(count || gave_up || cost) << "why did it end? ";
      by_count += count && !cost ? 1 : 0;
      by_uselessness += gave_up && !count ? 1 : 0;
      by_cost += cost && !count && !gave_up ? 1 : 0;
    }
  }
  EXPECT_GT(by_count, 0);
  EXPECT_GT(by_uselessness, 0);
  EXPECT_GT(by_cost, 0);
}

}  // namespace
}  // namespace marble
