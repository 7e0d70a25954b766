// What holds for every answer, on thousands of small problems of every awkward kind.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>

#include "marble/solver.h"
#include "support/brute_force.h"
#include "support/independent_check.h"
#include "support/random_problem.h"

namespace marble {
namespace {

class Source {
 public:
  explicit Source(std::uint64_t seed) : engine_(seed) {}
  double unit() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }
  Index below(Index n) { return static_cast<Index>(engine_() % static_cast<std::uint64_t>(n)); }

 private:
  std::mt19937_64 engine_;
};

struct Kind {
  const char* name;
  testing::RandomSizes sizes;
  void (*spoil)(OwnedProblem&, Source&);
};

void scale_row(SparseMatrix& matrix, std::vector<double>& offsets, Index row, double factor) {
  for (std::size_t k = 0; k < matrix.values.size(); ++k) {
    if (matrix.row_indices[k] == row) matrix.values[k] *= factor;
  }
  offsets[static_cast<std::size_t>(row)] *= factor;
}

// Appends a copy of a row, times a factor.
void repeat_row(SparseMatrix& matrix, std::vector<double>& offsets, Index row, double factor) {
  Triplets entries;
  for (Index j = 0; j < matrix.columns; ++j) {
    for (Index k = matrix.column_pointers[j]; k < matrix.column_pointers[j + 1]; ++k) {
      entries.add(matrix.row_indices[k], j, matrix.values[k]);
      if (matrix.row_indices[k] == row)
        entries.add(static_cast<Index>(offsets.size()), j, factor * matrix.values[k]);
    }
  }
  offsets.push_back(factor * offsets[static_cast<std::size_t>(row)]);
  matrix = compress(static_cast<Index>(offsets.size()), matrix.columns, entries, "row").value();
}

void nothing(OwnedProblem&, Source&) {}

void duplicate_rows(OwnedProblem& p, Source& source) {
  if (!p.b.empty()) repeat_row(p.A, p.b, source.below(static_cast<Index>(p.b.size())), -2.0);
  if (!p.d.empty()) repeat_row(p.C, p.d, source.below(static_cast<Index>(p.d.size())), 3.0);
}

void zero_rows(OwnedProblem& p, Source& source) {
  if (!p.b.empty()) scale_row(p.A, p.b, source.below(static_cast<Index>(p.b.size())), 0.0);
  if (!p.d.empty()) scale_row(p.C, p.d, source.below(static_cast<Index>(p.d.size())), 0.0);
}

void bad_scales(OwnedProblem& p, Source& source) {
  const auto factor = [&] { return std::pow(10.0, 12.0 * source.unit() - 6.0); };
  for (Index i = 0; i < static_cast<Index>(p.b.size()); ++i) scale_row(p.A, p.b, i, factor());
  for (Index i = 0; i < static_cast<Index>(p.d.size()); ++i) scale_row(p.C, p.d, i, factor());
  for (Index i = 0; i < static_cast<Index>(p.l.size()); ++i) {
    scale_row(p.L, p.l, i, factor());
    scale_row(p.R, p.r, i, factor());
  }
}

// Variables in no pair and no row, with curvature only.
void free_variables(OwnedProblem& p, Source&) {
  const Index n = static_cast<Index>(p.g.size()) + 2;
  for (auto* matrix : {&p.A, &p.C, &p.L, &p.R}) {
    matrix->columns = n;
    matrix->column_pointers.resize(static_cast<std::size_t>(n) + 1, matrix->column_pointers.back());
  }
  for (Index j = n - 2; j < n; ++j) {
    p.g.push_back(1.0);
    p.Q.row_indices.push_back(j);
    p.Q.values.push_back(2.0);
    p.Q.column_pointers.push_back(static_cast<Index>(p.Q.values.size()));
  }
  p.Q.rows = p.Q.columns = n;
}

// A variable without curvature or cost, in the rows.
void singular_hessian(OwnedProblem& p, Source&) {
  Triplets entries;
  for (Index j = 1; j < p.Q.columns; ++j) {
    for (Index k = p.Q.column_pointers[j]; k < p.Q.column_pointers[j + 1]; ++k) {
      if (p.Q.row_indices[k] != 0) entries.add(p.Q.row_indices[k], j, p.Q.values[k]);
    }
  }
  p.Q = compress(p.Q.columns, p.Q.columns, entries, "Q").value();
  p.g[0] = 0.0;
}

const Kind kKinds[] = {
    {"plain", {}, nothing},
    {"equality_only", {.variables = 8, .equalities = 4, .inequalities = 0, .pairs = 0}, nothing},
    {"inequality_only", {.variables = 8, .equalities = 0, .inequalities = 10, .pairs = 0}, nothing},
    {"pairs_only", {.variables = 8, .equalities = 0, .inequalities = 0, .pairs = 6}, nothing},
    {"nothing_but_cost", {.variables = 5, .equalities = 0, .inequalities = 0, .pairs = 0}, nothing},
    {"many_pairs", {.variables = 16, .equalities = 2, .inequalities = 4, .pairs = 8}, nothing},
    {"duplicate_rows", {}, duplicate_rows},
    {"zero_rows", {}, zero_rows},
    {"bad_scales", {}, bad_scales},
    {"free_variables", {}, free_variables},
    {"singular_hessian", {}, singular_hessian},
};

class Properties : public ::testing::TestWithParam<Kind> {};

OwnedProblem make(const Kind& kind, std::uint64_t seed) {
  OwnedProblem p = testing::random_problem(kind.sizes, seed);
  Source source(seed);
  kind.spoil(p, source);
  p.name = std::string(kind.name) + " " + std::to_string(seed);
  return p;
}

double size_of(const OwnedProblem& p) {
  double size = 1.0;
  for (const auto* vector : {&p.b, &p.d, &p.l, &p.r}) {
    for (const double value : *vector) size = std::max(size, std::abs(value));
  }
  return size;
}

TEST_P(Properties, NoAnswerCalledSolvedIsRejectedByTheIndependentCheck) {
  constexpr int kProblems = 250;
  int solved = 0;
  for (std::uint64_t seed = 1; seed <= kProblems; ++seed) {
    const OwnedProblem p = make(GetParam(), seed);
    const Solution s = solve_in_process(p.view()).value();
    if (s.status != Status::solved) continue;
    ++solved;
    const testing::Verdict verdict = testing::judge(p.view(), s);
    EXPECT_LE(verdict.infeasibility(), 1e-6) << p.name << " " << s.detail;
    EXPECT_LE(verdict.stationarity, 1e-6) << p.name << " " << s.detail;
    EXPECT_LE(verdict.wrong_sign, 1e-6 * size_of(p)) << p.name << " " << s.detail;
    EXPECT_LE(verdict.slackness, 1e-6 * size_of(p)) << p.name << " " << s.detail;
  }
  EXPECT_GE(solved, kProblems * 98 / 100) << "all of them have a solution";
}

TEST_P(Properties, ObjectivesAreNeverBelowTheBestBranchAndMostlyAtIt) {
  constexpr int kProblems = 25;
  int global = 0;
  int solved = 0;
  for (std::uint64_t seed = 1; seed <= kProblems; ++seed) {
    const OwnedProblem p = make(GetParam(), seed);
    const auto best = testing::brute_force(p.view());
    ASSERT_TRUE(best.has_value()) << p.name;
    const Solution s = solve_in_process(p.view()).value();
    if (s.status != Status::solved) continue;
    ++solved;
    const double slack = 1e-5 * std::max(1.0, std::abs(best->objective));
    EXPECT_GE(s.objective, best->objective - slack) << p.name;
    global += s.objective <= best->objective + slack;
  }
  EXPECT_GE(solved, kProblems * 9 / 10);
  EXPECT_GE(global, solved * 8 / 10);
}

INSTANTIATE_TEST_SUITE_P(Kinds, Properties, ::testing::ValuesIn(kKinds),
                         [](const auto& kind) { return std::string(kind.param.name); });

}  // namespace
}  // namespace marble
