// Stages in a pattern: found where there are some, however the variables are numbered, and only there.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include "horizon/stages.h"
#include "marble/examples.h"
#include "model/entries.h"
#include "support/random_problem.h"

namespace marble {
namespace {

std::optional<Stages> stages_of(const OwnedProblem& p) {
  return find_stages(scale(Problem::create(p.view()).value(), 0));
}

SparseMatrix with_columns(const SparseMatrix& m, const std::vector<Index>& to, bool rows_too) {
  Triplets entries;
  for_entries(m.view(),
              [&](Index i, Index j, double v) { entries.add(rows_too ? to[at(i)] : i, to[at(j)], v); });
  return compress(m.rows, m.columns, entries, "").value();
}

OwnedProblem renumbered(const OwnedProblem& p, const std::vector<Index>& to) {
  OwnedProblem q = p;
  q.Q = with_columns(p.Q, to, true);
  for (auto matrix : {&OwnedProblem::A, &OwnedProblem::C, &OwnedProblem::L, &OwnedProblem::R})
    q.*matrix = with_columns(p.*matrix, to, false);
  for (std::size_t j = 0; j < to.size(); ++j) q.g[at(to[j])] = p.g[j];
  return q;
}

// Of each row of A the stages of its variables.
Index widest_row(const OwnedProblem& p, const Stages& stages) {
  std::vector<Index> first(p.b.size(), stages.count), last(p.b.size(), 0);
  for_entries(p.A.view(), [&](Index row, Index j, double) {
    first[at(row)] = std::min(first[at(row)], stages.of_variable[at(j)]);
    last[at(row)] = std::max(last[at(row)], stages.of_variable[at(j)]);
  });
  Index widest = 0;
  for (std::size_t row = 0; row < first.size(); ++row) widest = std::max(widest, last[row] - first[row]);
  return widest;
}

// Middle steps: the ends of a horizon have fewer neighbours.
void expect_one_stage_a_step(const Stages& stages, int steps, const std::vector<Index>& to) {
  for (int k = 20; k + 20 < steps; ++k) {
    for (int i = 0; i < examples::kHopperVariables; ++i) {
      const Index stage = stages.of_variable[at(to[at(examples::hopper_index(k, i))])];
      EXPECT_NEAR(stage, k, 4) << "step " << k << ", variable " << i;
    }
  }
}

TEST(Stages, AreTheStepsOfALongPlan) {
  const OwnedProblem p = examples::hopper({.steps = 200});
  const auto stages = stages_of(p);
  ASSERT_TRUE(stages);
  std::vector<Index> same(p.g.size());
  std::iota(same.begin(), same.end(), 0);
  EXPECT_NEAR(stages->count, 200, 10);
  EXPECT_LE(widest_row(p, *stages), 2);
  expect_one_stage_a_step(*stages, 200, same);
}

TEST(Stages, AreFoundHoweverTheVariablesAreNumbered) {
  const OwnedProblem p = examples::hopper({.steps = 200});
  std::vector<Index> to(p.g.size());
  std::iota(to.begin(), to.end(), 0);
  std::shuffle(to.begin(), to.end(), std::mt19937_64(7));
  const OwnedProblem q = renumbered(p, to);
  const auto stages = stages_of(q);
  ASSERT_TRUE(stages);
  EXPECT_LE(widest_row(q, *stages), 2);
  expect_one_stage_a_step(*stages, 200, to);
}

TEST(Stages, BeginWhereAStateIsGiven) {
  const OwnedProblem p = examples::hopper({.steps = 200});
  std::vector<Index> backwards(p.g.size());
  std::iota(backwards.rbegin(), backwards.rend(), 0);
  const auto stages = stages_of(renumbered(p, backwards));
  ASSERT_TRUE(stages);
  EXPECT_LT(stages->of_variable.back(), 10);
  EXPECT_GT(stages->of_variable.front(), 190);
}

TEST(Stages, AreNotSeenInARandomSparsePattern) {
  std::mt19937_64 random(11);
  OwnedProblem p;
  constexpr Index kSize = 4000;
  Triplets A;
  for (Index row = 0; row < kSize / 2; ++row)
    for (int k = 0; k < 4; ++k) A.add(row, static_cast<Index>(random() % kSize), 1.0);
  p.g.assign(kSize, 1.0);
  p.A = compress(kSize / 2, kSize, A, "A").value();
  p.b.assign(kSize / 2, 0.0);
  EXPECT_FALSE(stages_of(p));
}

TEST(Stages, AreNotSeenInAGrid) {
  constexpr Index kSide = 60;
  OwnedProblem p;
  Triplets Q;
  for (Index i = 0; i < kSide; ++i) {
    for (Index j = 0; j < kSide; ++j) {
      const Index here = kSide * i + j;
      Q.add(here, here, 4.0);
      if (j + 1 < kSide) Q.add(here, here + 1, -1.0);
      if (i + 1 < kSide) Q.add(here, here + kSide, -1.0);
    }
  }
  p.hessian_form = HessianForm::upper_triangle;
  p.g.assign(kSide * kSide, 1.0);
  p.Q = compress(kSide * kSide, kSide * kSide, Q, "Q").value();
  EXPECT_FALSE(stages_of(p));
}

TEST(Stages, AreNotLookedForAgainstAStop) {
  std::stop_source stop;
  stop.request_stop();
  const OwnedProblem p = examples::hopper({.steps = 20000});
  EXPECT_FALSE(find_stages(scale(Problem::create(p.view()).value(), 0), Interrupt(stop.get_token())));
}

}  // namespace
}  // namespace marble
