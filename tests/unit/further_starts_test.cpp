// Option starts: further searches from the best branch, at once or one after the other.
#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "marble/examples.h"
#include "marble/solver.h"
#include "support/independent_check.h"

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

}  // namespace
}  // namespace marble
