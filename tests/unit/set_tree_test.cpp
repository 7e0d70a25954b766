// Whether places can be visited in time, each at one of the steps: feasible or refuted, as all orders say.
#include "global/set_tree.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "marble/solver.h"
#include "support/random_problem.h"
#include "workbench.h"

namespace marble {
namespace {

using testing::Workbench;

// On a line, from 0 to `goal`, at most 1 a step.
struct Visits {
  int steps;
  double goal;
  std::vector<double> places;
};

// x_k; of each place and step: whether it is visited, c ≥ 0, and how far it is above and below, e⁺ and e⁻.
// Σ_k c = 1, and 0 ≤ c ⊥ e⁺ + e⁻ ≥ 0 with x_k − place = e⁺ − e⁻.
OwnedProblem visits(const Visits& v) {
  const auto places = static_cast<Index>(v.places.size());
  const Index per_step = 1 + 3 * places, n = per_step * v.steps;
  OwnedProblem p;
  p.name = "visits";
  p.g.assign(static_cast<std::size_t>(n), 0.0);
  Triplets A, C, L, R, Q;
  const auto x = [&](Index k) { return per_step * k; };
  const auto of = [&](Index k, Index place, Index i) { return per_step * k + 1 + 3 * place + i; };
  const auto row = [](const std::vector<double>& offsets) { return static_cast<Index>(offsets.size()); };
  for (Index k = 0; k < v.steps; ++k) {
    Q.add(x(k), x(k), 1.0);
    if (k == 0 || k + 1 == v.steps) {
      A.add(row(p.b), x(k), 1.0);
      p.b.push_back(k == 0 ? 0.0 : -v.goal);
    }
    for (const double sign : {1.0, -1.0}) {
      if (k == 0) continue;
      C.add(row(p.d), x(k), sign);
      C.add(row(p.d), x(k - 1), -sign);
      p.d.push_back(1.0);
    }
    for (Index place = 0; place < places; ++place) {
      A.add(row(p.b), x(k), 1.0);
      A.add(row(p.b), of(k, place, 1), -1.0);
      A.add(row(p.b), of(k, place, 2), 1.0);
      p.b.push_back(-v.places[static_cast<std::size_t>(place)]);
      for (const Index i : {1, 2}) {
        C.add(row(p.d), of(k, place, i), 1.0);
        p.d.push_back(0.0);
        R.add(row(p.r), of(k, place, i), 1.0);
      }
      L.add(row(p.l), of(k, place, 0), 1.0);
      p.l.push_back(0.0);
      p.r.push_back(0.0);
    }
  }
  for (Index place = 0; place < places; ++place) {
    for (Index k = 0; k < v.steps; ++k) A.add(row(p.b), of(k, place, 0), 1.0);
    p.b.push_back(-1.0);
  }
  p.Q = compress(n, n, Q, "Q").value();
  p.A = compress(row(p.b), n, A, "A").value();
  p.C = compress(row(p.d), n, C, "C").value();
  p.L = compress(row(p.l), n, L, "L").value();
  p.R = compress(row(p.r), n, R, "R").value();
  return p;
}

// Each way from place to place takes whole steps.
bool can_be_visited(const Visits& v) {
  std::vector<double> order = v.places;
  std::ranges::sort(order);
  int least = std::numeric_limits<int>::max();
  do {
    int steps = 0;
    double at = 0.0;
    for (const double place : order) {
      steps += static_cast<int>(std::ceil(std::abs(place - at)));
      at = place;
    }
    least = std::min(least, steps + static_cast<int>(std::ceil(std::abs(v.goal - at))));
  } while (std::ranges::next_permutation(order).found);
  return least <= v.steps - 1;
}

Visits random_visits(std::uint64_t seed, int steps) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> place(-0.3 * steps, 0.4 * steps);
  Visits v{steps, place(random), {}};
  for (int i = 0; i < 3; ++i) v.places.push_back(place(random));
  return v;
}

constexpr auto kAny = [](ConstVectorRef, const WorkingSet&) { return true; };

TEST(SetTree, FindsABranchOrProvesThatThereIsNone) {
  int feasible = 0, infeasible = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    const Visits v = random_visits(seed, 12);
    Workbench bench(visits(v));
    SetTree tree(bench.problem);
    const bool can = can_be_visited(v);
    const SetTree::End end = tree.run(bench.run, bench.zero(), 20000, kAny);
    EXPECT_EQ(end, can ? SetTree::End::found : SetTree::End::refuted) << seed;
    (can ? feasible : infeasible) += 1;
  }
  EXPECT_GE(feasible, 5);
  EXPECT_GE(infeasible, 5);
}

TEST(SetTree, WhatItFindsIsFeasible) {
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    const Visits v = random_visits(seed, 12);
    if (!can_be_visited(v)) continue;
    Workbench bench(visits(v));
    SetTree tree(bench.problem);
    double infeasibility = 1.0;
    static_cast<void>(tree.run(bench.run, bench.zero(), 20000, [&](ConstVectorRef z, const WorkingSet&) {
      infeasibility = bench.judged(z).infeasibility();
      return true;
    }));
    EXPECT_LE(infeasibility, 1e-6) << seed;
  }
}

TEST(SetTree, ARefutationIsTheStatusOfASolve) {
  const Visits v{18, 0.0, {5.5, -4.5}};  // 20 steps there and back
  ASSERT_FALSE(can_be_visited(v));
  const Solution s = solve_in_process(visits(v).view()).value();
  EXPECT_EQ(s.status, Status::infeasible) << s.detail;
  EXPECT_NE(s.detail.find("every branch"), std::string::npos) << s.detail;
}

// Its leaves are those of a tree: no two have a branch in common, and none is left out.
TEST(SetTree, ARecordedProofIsDisjointAndComplete) {
  const Visits v{7, 0.0, {2.5, -1.5}};
  ASSERT_FALSE(can_be_visited(v));
  Workbench bench(visits(v));
  Proof proof;
  SolveControls controls;
  controls.proof = &proof;
  marble::Run run(bench.options, controls);
  SetTree tree(bench.problem);
  ASSERT_EQ(tree.run(run, bench.zero(), 20000, kAny), SetTree::End::refuted);
  double covered = 0.0;
  for (const ProofLeaf& leaf : proof.leaves) {
    EXPECT_TRUE(leaf.contradiction);
    covered += std::exp2(-static_cast<double>(leaf.s_zero.size() + leaf.t_zero.size()));
  }
  EXPECT_EQ(covered, 1.0);
}

TEST(SetTree, ARecordThatTakesTooMuchIsDropped) {
  Workbench bench(visits({7, 0.0, {2.5, -1.5}}));
  Proof proof;
  proof.most_bytes = 1000;
  SolveControls controls;
  controls.proof = &proof;
  marble::Run run(bench.options, controls);
  SetTree tree(bench.problem);
  EXPECT_EQ(tree.run(run, bench.zero(), 20000, kAny), SetTree::End::refuted);
  EXPECT_TRUE(proof.leaves.empty());
  EXPECT_GT(proof.bytes, proof.most_bytes);
}

TEST(SetTree, IsStoppedByItsBudgetAndByItsCaller) {
  const Visits v = {12, 0.0, {5.5, -4.5}};
  Workbench bench(visits(v));
  EXPECT_EQ(SetTree(bench.problem).run(bench.run, bench.zero(), 3, kAny), SetTree::End::stopped);
  std::stop_source source;
  source.request_stop();
  SolveControls controls;
  controls.stop = source.get_token();
  marble::Run run(bench.options, controls);
  EXPECT_EQ(SetTree(bench.problem).run(run, bench.zero(), 20000, kAny), SetTree::End::stopped);
}

TEST(SetTree, AFeasibleProblemIsNeverRefuted) {
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    Workbench bench(testing::random_problem({}, seed));
    EXPECT_NE(SetTree(bench.problem).run(bench.run, bench.zero(), 2000, kAny), SetTree::End::refuted) << seed;
  }
}

}  // namespace
}  // namespace marble
