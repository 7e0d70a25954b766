// What a tree does on its way: who expands its nodes, where a stop ends it, and what improves its answer.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>

#include "global/expansion.h"
#include "marble/examples.h"
#include "marble/solver.h"
#include "support/independent_check.h"
#include "workbench.h"

namespace marble {
namespace {

// No tree of it comes to an end in the time of a test.
OwnedProblem endless() { return examples::qpec({40, 80, 40, 40}, 0); }

Options global(int node_limit = 1000000) {
  Options options;
  options.global_search = true;
  options.node_limit = node_limit;
  return options;
}

// What a tree has reported last.
struct Reported final : ProgressSink {
  void report(const Progress& row) override {
    if (row.nodes > 0) last = without_vectors(row);
  }
  Progress last;
};

// Expands the nodes of a round one after the other, the last one first or last, and asks for a stop after
// some of those of one round.
class OneByOne final : public TaskRunner {
 public:
  explicit OneByOne(bool backwards) : backwards_(backwards) {}
  OneByOne(int round, std::size_t expansions) : round_(round), expansions_(expansions) {}
  void run(std::span<const std::function<void()>> tasks) override {
    const bool stops = ++rounds_ == round_;
    for (std::size_t i = 0; i < tasks.size(); ++i) {
      if (stops && i == expansions_) source.request_stop();
      tasks[backwards_ ? tasks.size() - 1 - i : i]();
    }
  }
  std::stop_source source;

 private:
  bool backwards_ = false;
  int round_ = 0, rounds_ = 0;
  std::size_t expansions_ = 0;
};

TEST(TreeRun, IsTheSameWhoeverExpandsItsNodesFactorizationsToo) {
  // One whose relaxations are solved from their parents', and one by an interior point method.
  for (const OwnedProblem& p : {examples::qpec({10, 40, 4, 4}, 3), examples::hopper({.steps = 10})}) {
    const Solution alone = solve_in_process(p.view(), global(300)).value();
    EXPECT_GT(alone.nodes, 10) << p.name;
    for (const bool backwards : {false, true}) {
      OneByOne runner(backwards);
      const Solution helped = solve_in_process(p.view(), global(300), {.runner = &runner}).value();
      EXPECT_EQ(helped.z, alone.z) << p.name;
      EXPECT_EQ(helped.bound, alone.bound) << p.name;
      EXPECT_EQ(helped.nodes, alone.nodes) << p.name;
      EXPECT_EQ(helped.factorizations, alone.factorizations) << p.name;
    }
  }
}

// Nodes of a round that were expanded before the stop count, none after it.
TEST(TreeRun, IsCancelledWithinOneNode) {
  const OwnedProblem p = endless();
  constexpr int kRound = 6;
  std::int64_t before = 0;
  for (std::size_t expansions = 0; expansions < 4; ++expansions) {
    OneByOne runner(kRound, expansions);
    Reported reported;
    const Solution s =
        solve_in_process(p.view(), global(),
                         {.progress = &reported, .stop = runner.source.get_token(), .runner = &runner})
            .value();
    EXPECT_EQ(s.status, Status::cancelled) << s.detail;
    EXPECT_FALSE(s.proved);
    EXPECT_LE(s.bound, s.objective);
    EXPECT_GE(s.bound, reported.last.bound);
    EXPECT_LE(testing::judge(p.view(), s).infeasibility(), 1e-6) << "the incumbent";
    if (expansions == 0) {
      EXPECT_EQ(s.nodes, reported.last.nodes) << "what was known when the round began";
      EXPECT_EQ(s.open_nodes, reported.last.open_nodes);
      EXPECT_EQ(s.bound, reported.last.bound);
    } else {
      EXPECT_GT(s.nodes, before) << expansions;
      EXPECT_LE(s.nodes, before + 2) << expansions << ": one node's children";
    }
    before = s.nodes;
  }
}

// Asks for a stop in the middle of one factorization, and goes on with it.
class StoppingKkt final : public testing::WrappedKkt {
 public:
  StoppingKkt(Kkt& inner, int last, std::stop_source& stop) : WrappedKkt(inner), left_(last), stop_(stop) {}
  [[nodiscard]] bool factorize(const RowWeights& weights) override {
    if (--left_ == 0) stop_.request_stop();
    return WrappedKkt::factorize(weights);
  }

 private:
  int left_;
  std::stop_source& stop_;
};

// However many factorizations a node would take (24 of this one), hardly one is made.
TEST(TreeRun, AStopWithinANodeIsHeardAtTheNextFactorization) {
  const OwnedProblem p = examples::hopper({.steps = 10});
  constexpr int kSetUp = 1;
  for (const int last : {1, 4, 12, 20}) {
    testing::Rows rows;
    testing::Workbench w(p, {}, &rows);
    Gram gram(w.problem);
    Expander expander(w.problem, std::make_unique<StoppingKkt>(*w.kkt, last + kSetUp, rows.source), gram);
    ASSERT_TRUE(expander.relaxation().is_convex(w.run));
    const Box box(w.problem, 1e4);
    const PseudoCosts costs(w.problem.pairs());
    const std::vector<Clause> clauses;
    ASSERT_TRUE(expander.relaxation().start(w.zero()));
    const NodeEngine::Center center = expander.relaxation().center();
    Expansion e;
    e.node = Node(w.problem.layout, Fixings(static_cast<std::size_t>(w.problem.pairs())), {});
    e.center = &center;
    e.box = &box;
    e.costs = &costs;
    e.clauses = &clauses;
    e.cutoff = std::numeric_limits<double>::infinity();
    expander.expand(e, w.run.interrupt());
    EXPECT_EQ(e.outcome, Expansion::Outcome::interrupted) << last;
    EXPECT_LE(e.factorizations, last + 1) << last;
  }
}

// The tree would not close for long, and its own nodes suggest nothing better than the first local answer.
TEST(TreeRun, AnswersNoWorseThanFurtherStartsDo) {
  const OwnedProblem p = examples::hopper(examples::vary(examples::HopperParameters{.steps = 22}, 3));
  Options options;
  const Solution one = solve_in_process(p.view(), options).value();
  options.num_starts = 8;
  const Solution eight = solve_in_process(p.view(), options).value();
  ASSERT_LT(eight.objective, 0.98 * one.objective) << "what there is to be found";
  const Solution s = solve_in_process(p.view(), global(200)).value();
  EXPECT_LE(s.objective, eight.objective * (1.0 + 1e-9)) << s.detail;
  EXPECT_EQ(s.status, Status::iteration_limit) << s.detail;
  EXPECT_LE(testing::judge(p.view(), s).infeasibility(), 1e-9);
  EXPECT_NE(s.detail.find("further start"), std::string::npos) << "not the local answer's: " << s.detail;
  EXPECT_FALSE(s.b_stationary.has_value()) << "as that was not decided of this one";
}

// Most of them is probing: sides that are zero together where the relaxation is at its least are not tried
// one by one.
TEST(TreeRun, ProbesOnlySidesThatMayGain) {
  const Solution s = solve_in_process(examples::hopper({.steps = 10}).view(), global()).value();
  EXPECT_TRUE(s.proved) << s.detail;
  EXPECT_LE(s.nodes, 30) << s.detail;
  EXPECT_LE(s.factorizations, 4500) << "of 6742 where each side is tried";
}

// What a controller meets as its target moves away from where the leg can be; z = 0 is no start at all.
TEST(TreeRun, ProvesShortHoppersFromNothingByFewNodes) {
  for (const Index steps : {3, 5}) {
    examples::HopperParameters parameters{.steps = steps};
    std::int64_t nodes = 0;
    for (int tick = 0; tick < 24; ++tick) {
      const OwnedProblem p = examples::hopper(parameters);
      const Solution s = solve_in_process(p.view(), global()).value();
      EXPECT_TRUE(s.proved) << steps << " " << tick << " " << s.detail;
      nodes += s.nodes;
      parameters = examples::advance(parameters, s.z);
    }
    EXPECT_LE(nodes, steps == 3 ? 24 : 600) << steps;
  }
}

}  // namespace
}  // namespace marble
