// Whether a direction of the tangent cone descends, beside an enumeration of the cone's branches.
#include "global/tangent_cone.h"

#include <gtest/gtest.h>

#include <random>

#include "model/tuning.h"
#include "proof/stationarity.h"
#include "support/brute_force.h"
#include "workbench.h"

namespace marble {
namespace {

using testing::Workbench;

struct Searched {
  TangentCone::End end;
  WorkingSet branch;
  int factorizations;
};

Searched searched_at_zero(Workbench& bench, int most_nodes = 1000) {
  const Images images = bench.images(Iterate(bench.problem));
  TangentCone cone(bench.problem, images, biactive_pairs(images));
  const int before = bench.run.factorizations;
  const TangentCone::End end = cone.search(bench.run, most_nodes);
  WorkingSet set(bench.problem);
  if (end == TangentCone::End::descent) set = cone.branch(set);
  return {end, set, bench.run.factorizations - before};
}

// ½|z|² + gᵀz over pairs (z₀, z₁), (z₂, z₃), …, and rows C z ≥ 0.
OwnedProblem corner(std::vector<double> g, const SparseMatrix& C = {}) {
  OwnedProblem p;
  const auto n = static_cast<Index>(g.size());
  p.g = std::move(g);
  Triplets Q, L, R;
  for (Index j = 0; j < n; ++j) Q.add(j, j, 1.0);
  for (Index pair = 0; pair < n / 2; ++pair) L.add(pair, 2 * pair, 1.0), R.add(pair, 2 * pair + 1, 1.0);
  p.Q = compress(n, n, Q, "Q").value();
  p.L = compress(n / 2, n, L, "L").value();
  p.R = compress(n / 2, n, R, "R").value();
  p.l = p.r = std::vector<double>(static_cast<std::size_t>(n / 2), 0.0);
  p.C = C;
  p.d = std::vector<double>(static_cast<std::size_t>(C.rows), 0.0);
  return p;
}

TEST(TangentCone, OneProjectionShowsAStronglyStationaryPoint) {
  Workbench bench(corner({1, 1, 1, 1, 1, 1, 1, 1}));
  const Searched searched = searched_at_zero(bench, 1);
  EXPECT_EQ(searched.end, TangentCone::End::no_descent);
  EXPECT_EQ(searched.factorizations, 1);
}

TEST(TangentCone, ADirectionOfDescentNamesItsBranch) {
  Workbench bench(corner({1, -1, 1, 1, -1, 1, 1, 1}));
  const Searched searched = searched_at_zero(bench);
  ASSERT_EQ(searched.end, TangentCone::End::descent);
  EXPECT_EQ(searched.branch.s_fixed[0], 1) << "z₁ rises";
  EXPECT_EQ(searched.branch.s_fixed[2], 0) << "z₄ rises";
}

TEST(TangentCone, WhereOnlyBothSidesTogetherDescendNoBranchDoes) {
  // z₀ + z₁ gains, but only where both are positive: z₀ ≥ z₁ and z₁ ≥ z₀.
  const SparseMatrix together =
      compress(2, 2, {{0, 0, 1, 1}, {0, 1, 0, 1}, {1.0, -1.0, -1.0, 1.0}}, "C").value();
  Workbench bench(corner({-1, -1}, together));
  EXPECT_EQ(searched_at_zero(bench, 1).end, TangentCone::End::undecided) << "the root alone does not show it";
  EXPECT_EQ(searched_at_zero(bench).end, TangentCone::End::no_descent);
}

TEST(TangentCone, TooManyActiveRowsAreNotTried) {
  const std::vector<double> g(2 * static_cast<std::size_t>(tuning::dense_rows), 1.0);
  Workbench many(corner(g));
  const Images images = many.images(Iterate(many.problem));
  EXPECT_FALSE(TangentCone::applies(images, biactive_pairs(images)));
  Workbench few(corner({1, 1}));
  const Images few_images = few.images(Iterate(few.problem));
  EXPECT_TRUE(TangentCone::applies(few_images, biactive_pairs(few_images)));
}

// Up to six pairs in up to nine variables, with equalities and inequalities through 0, in small integers:
// many are degenerate.
OwnedProblem random_cone(std::uint64_t seed) {
  std::mt19937_64 engine(seed);
  const auto integer = [&engine](Index least, Index most) {
    return least + static_cast<Index>(engine() % static_cast<std::uint64_t>(most - least + 1));
  };
  OwnedProblem p;
  const Index n = integer(2, 9), pairs = integer(1, 6);
  const auto matrix = [&](Index rows, const char* name) {
    Triplets entries;
    for (Index i = 0; i < rows; ++i)
      for (Index j = 0; j < n; ++j)
        if (integer(0, 2) == 0) entries.add(i, j, static_cast<double>(integer(-2, 2)));
    return compress(rows, n, entries, name).value();
  };
  for (Index j = 0; j < n; ++j) p.g.push_back(static_cast<double>(integer(-2, 4)));
  Triplets identity;
  for (Index j = 0; j < n; ++j) identity.add(j, j, 1.0);
  p.Q = compress(n, n, identity, "Q").value();
  p.A = matrix(integer(0, 1), "A");
  p.C = matrix(integer(0, 5), "C");
  p.L = matrix(pairs, "L"), p.R = matrix(pairs, "R");
  p.b.assign(static_cast<std::size_t>(p.A.rows), 0.0), p.d.assign(static_cast<std::size_t>(p.C.rows), 0.0);
  p.l.assign(static_cast<std::size_t>(pairs), 0.0), p.r = p.l;
  return p;
}

TEST(TangentCone, DecidesAsTheEnumerationOfAllBranchesDoes) {
  int descents = 0, others = 0;
  for (std::uint64_t seed = 0; seed < 400; ++seed) {
    const OwnedProblem p = random_cone(seed);
    const auto optimum = testing::brute_force(p.view());
    ASSERT_TRUE(optimum.has_value()) << "0 is feasible";
    Workbench bench(p);
    const Searched searched = searched_at_zero(bench);
    const bool descends = optimum->objective < -1e-9;
    EXPECT_EQ(searched.end, descends ? TangentCone::End::descent : TangentCone::End::no_descent)
        << "seed " << seed << ", " << optimum->objective;
    ++(descends ? descents : others);
  }
  EXPECT_GE(descents, 80);
  EXPECT_GE(others, 80);
}

}  // namespace
}  // namespace marble
