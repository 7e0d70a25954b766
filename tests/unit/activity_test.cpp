// What a solve is doing, as other threads see it.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "marble/examples.h"
#include "marble/progress.h"
#include "marble/solver.h"
#include "support/random_problem.h"

namespace marble {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(Activity, IsDescribedInWords) {
  EXPECT_EQ(describe({.phase = Phase::setup}), "set-up");
  EXPECT_EQ(describe({.phase = Phase::starts, .done = 3, .total = 16, .incumbent = 12.5}),
            "further starts: 3 of 16, best 12.5");
  EXPECT_EQ(describe({.phase = Phase::tree, .done = 120, .incumbent = -1.0, .gap = 0.013}),
            "branch and bound: 120 nodes, best -1, gap 1.3e-02");
  EXPECT_EQ(describe({.phase = Phase::coupled, .done = 4, .total = 60}),
            "coupled blocks: 4 of 60 iterations");
}

TEST(Activity, TheOutermostPhaseIsShown) {
  ActivityMonitor monitor;
  {
    const PhaseScope outer(&monitor, Phase::tree);
    monitor.set_done(Phase::tree, 7, 0);
    const PhaseScope inner(&monitor, Phase::starts, 4);
    monitor.set_done(Phase::starts, 2, 4);
    EXPECT_EQ(monitor.read(), (Activity{.phase = Phase::tree, .done = 7}));
  }
  const PhaseScope next(&monitor, Phase::starts, 4);
  monitor.set_done(Phase::starts, 2, 4);
  EXPECT_EQ(monitor.read(), (Activity{.phase = Phase::starts, .done = 2, .total = 4}));
}

TEST(Activity, EachChangeIsCounted) {
  ActivityMonitor monitor;
  const std::int64_t before = monitor.changes();
  monitor.add_incumbent(3.0);
  EXPECT_GT(monitor.changes(), before);
  monitor.add_incumbent(4.0);
  EXPECT_EQ(monitor.read().incumbent, 3.0) << "the least one";
  monitor.begin();
  EXPECT_EQ(monitor.read(), Activity{});
}

// Looks at the monitor whenever pieces of the solve are handed out.
class Looking final : public TaskRunner {
 public:
  explicit Looking(const ActivityMonitor& monitor) : monitor_(monitor) {}
  void run(std::span<const std::function<void()>> tasks) override {
    seen.push_back(monitor_.read());
    for (const auto& task : tasks) task();
  }
  std::vector<Activity> seen;

 private:
  const ActivityMonitor& monitor_;
};

TEST(Activity, FurtherStartsAreCounted) {
  const OwnedProblem p = examples::hopper({.steps = 16});
  Options options;
  options.num_starts = 9;
  ActivityMonitor monitor;
  Looking looking(monitor);
  const Solution s = solve_in_process(p.view(), options, {.runner = &looking, .activity = &monitor}).value();
  std::vector<std::int64_t> done;
  for (const Activity& seen : looking.seen) {
    if (seen.phase != Phase::starts) continue;
    EXPECT_EQ(seen.total, 9);
    EXPECT_GE(seen.incumbent, s.objective - 1e-9 * (1.0 + std::abs(s.objective)));
    EXPECT_LT(seen.incumbent, kInfinity);
    done.push_back(seen.done);
  }
  ASSERT_GE(done.size(), 2U);
  EXPECT_GE(done.front(), 1);
  EXPECT_EQ(done.back(), done.front() + 4 * static_cast<std::int64_t>(done.size() - 1)) << "four at a time";
}

TEST(Activity, ATreeShowsItsNodesIncumbentAndGap) {
  class Rows final : public ProgressSink {
   public:
    explicit Rows(const ActivityMonitor& monitor) : monitor_(monitor) {}
    void report(const Progress& row) override {
      if (row.nodes == 0) return;
      ++of_the_tree;
      const Activity now = monitor_.read();
      EXPECT_EQ(now.phase, Phase::tree);
      EXPECT_EQ(now.done, row.nodes);
      EXPECT_EQ(now.gap, row.gap);
      EXPECT_EQ(now.incumbent, row.incumbent);
    }
    int of_the_tree = 0;

   private:
    const ActivityMonitor& monitor_;
  };
  Options options;
  options.global_search = true;
  options.node_limit = 300;
  ActivityMonitor monitor;
  Rows rows(monitor);
  const Solution s = solve_in_process(examples::hopper({.steps = 10}).view(), options,
                                      {.progress = &rows, .activity = &monitor})
                         .value();
  EXPECT_GT(rows.of_the_tree, 3);
  EXPECT_GT(s.times.tree_s, 0.0);
  EXPECT_LE(s.times.factorization_s + s.times.line_search_s + s.times.polish_s + s.times.tree_s,
            s.times.solve_s);
}

TEST(Activity, ToShowItChangesNoBitOfTheAnswer) {
  for (const std::uint64_t seed : {1, 2, 3, 4}) {
    const OwnedProblem p = testing::random_problem({}, seed);
    ActivityMonitor monitor;
    const Solution shown = solve_in_process(p.view(), {}, {.activity = &monitor}).value();
    const Solution alone = solve_in_process(p.view()).value();
    EXPECT_EQ(shown.z, alone.z) << seed;
    EXPECT_EQ(shown.factorizations, alone.factorizations) << seed;
    EXPECT_EQ(shown.detail, alone.detail) << seed;
  }
}

}  // namespace
}  // namespace marble
