// What a solve records of its proofs. Whether the proofs hold is seen elsewhere
// (tests/cli/proof_files_test.py), by a program that shares nothing with the solver.
#include <gtest/gtest.h>

#include "marble/examples.h"
#include "marble/solver.h"
#include "support/problem_builder.h"
#include "support/random_problem.h"

namespace marble {
namespace {

using testing::ProblemBuilder;

Options global(int node_limit = 1000000) {
  Options options;
  options.global_search = true;
  options.node_limit = node_limit;
  return options;
}

Solution solve(const OwnedProblem& p, Proof* proof, TaskRunner* runner = nullptr, int node_limit = 1000000) {
  SolveControls controls;
  controls.proof = proof;
  controls.runner = runner;
  return solve_in_process(p.view(), global(node_limit), controls).value();
}

// One after the other, the last one first.
class Backwards final : public TaskRunner {
 public:
  void run(std::span<const std::function<void()>> tasks) override {
    for (std::size_t i = tasks.size(); i-- > 0;) tasks[i]();
  }
};

// How many of all choices of a zero side, a bit a pair, no leaf is about.
std::uint32_t uncovered(const std::vector<ProofLeaf>& leaves, Index pairs) {
  std::uint32_t count = 0;
  for (std::uint32_t branch = 0; branch < 1U << static_cast<unsigned>(pairs); ++branch) {
    const auto s_is_zero = [branch](Index pair) { return (branch >> static_cast<unsigned>(pair) & 1U) != 0; };
    bool covered = false;
    for (const ProofLeaf& leaf : leaves) {
      bool in = true;
      for (const Index pair : leaf.s_zero) in = in && s_is_zero(pair);
      for (const Index pair : leaf.t_zero) in = in && !s_is_zero(pair);
      covered = covered || in;
    }
    count += covered ? 0 : 1;
  }
  return count;
}

TEST(ProofRecord, ChangesNothingOfTheAnswerOrItsWork) {
  for (const OwnedProblem& p : {examples::qpec({10, 40, 4, 4}, 3), examples::hopper({.steps = 10})}) {
    const Solution without = solve(p, nullptr, nullptr, 300);
    Proof proof;
    const Solution with = solve(p, &proof, nullptr, 300);
    EXPECT_EQ(with.z, without.z) << p.name;
    EXPECT_EQ(with.bound, without.bound) << p.name;
    EXPECT_EQ(with.nodes, without.nodes) << p.name;
    EXPECT_EQ(with.factorizations, without.factorizations) << p.name;
    EXPECT_EQ(proof.claim, Proof::Claim::bound) << p.name << proof.reason;
    EXPECT_EQ(proof.bound, with.bound) << p.name;
  }
}

TEST(ProofRecord, IsTheSameWhoeverExpandsTheNodes) {
  const OwnedProblem p = examples::qpec({10, 40, 4, 4}, 3);
  Proof alone, helped;
  Backwards runner;
  static_cast<void>(solve(p, &alone));
  static_cast<void>(solve(p, &helped, &runner));
  ASSERT_EQ(alone.leaves.size(), helped.leaves.size());
  for (std::size_t i = 0; i < alone.leaves.size(); ++i) {
    EXPECT_EQ(alone.leaves[i].s_zero, helped.leaves[i].s_zero);
    EXPECT_EQ(alone.leaves[i].t_zero, helped.leaves[i].t_zero);
    EXPECT_EQ(alone.leaves[i].y, helped.leaves[i].y);
    EXPECT_EQ(alone.leaves[i].xi, helped.leaves[i].xi);
  }
}

TEST(ProofRecord, CoversEveryBranchAlsoWhereALimitEndsTheTree) {
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    testing::RandomSizes sizes;
    sizes.pairs = 8;
    const OwnedProblem p = testing::random_problem(sizes, seed);
    for (const int node_limit : {1, 3, 7, 1000000}) {
      Proof proof;
      const Solution s = solve(p, &proof, nullptr, node_limit);
      if (proof.claim == Proof::Claim::none) continue;
      EXPECT_EQ(uncovered(proof.leaves, sizes.pairs), 0U) << seed << " " << node_limit << " " << s.detail;
    }
  }
}

TEST(ProofRecord, IsNoneWhereItTakesMoreThanItMay) {
  const OwnedProblem p = examples::qpec({10, 20, 4, 2}, 1);
  Proof proof;
  proof.most_bytes = 1000;
  const Solution s = solve(p, &proof);
  EXPECT_TRUE(s.proved);
  EXPECT_EQ(proof.claim, Proof::Claim::none);
  EXPECT_EQ(proof.reason, "its leaves take more than 1000 bytes");
  EXPECT_TRUE(proof.leaves.empty());
}

TEST(ProofRecord, OfRowsThatContradictEachOtherIsTheCertificate) {
  // z >= 3 and z <= 1.
  const OwnedProblem p = ProblemBuilder("clash", {1.0})
                             .at_least({1.0, -3.0})
                             .at_least({-1.0, 1.0})
                             .pair({1.0, 0.0}, {0.0, 1.0})
                             .optimum(0.0)
                             .problem;
  Proof proof;
  const Solution s = solve(p, &proof);
  ASSERT_EQ(s.status, Status::infeasible);
  ASSERT_EQ(proof.claim, Proof::Claim::infeasible) << proof.reason;
  ASSERT_EQ(proof.leaves.size(), 1U);
  EXPECT_TRUE(proof.leaves[0].contradiction);
  EXPECT_EQ(proof.leaves[0].nu, (SparseNumbers{{0, 1}, {s.certificate[0], s.certificate[1]}}));
}

TEST(ProofRecord, IsNoneOfAnUnboundedProblemAndSaysSo) {
  const OwnedProblem p =
      ProblemBuilder("runaway", {0.0, -1.0}).pair({1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}).optimum(0.0).problem;
  Proof proof;
  EXPECT_EQ(solve(p, &proof).status, Status::unbounded);
  EXPECT_EQ(proof.claim, Proof::Claim::none);
  EXPECT_FALSE(proof.reason.empty());
}

TEST(ProofRecord, OfTheSolveBeforeIsForgotten) {
  Proof proof;
  static_cast<void>(solve(examples::qpec({10, 20, 4, 2}, 1), &proof));
  ASSERT_GT(proof.leaves.size(), 1U);
  const OwnedProblem p =
      ProblemBuilder("runaway", {0.0, -1.0}).pair({1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}).optimum(0.0).problem;
  static_cast<void>(solve(p, &proof));
  EXPECT_TRUE(proof.leaves.empty());
  EXPECT_EQ(proof.bytes, 0);
}

}  // namespace
}  // namespace marble
