// How solves end on problems without an answer: with the right word, its proof, and after bounded work.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "marble/examples.h"
#include "marble/solver.h"
#include "support/independent_check.h"
#include "support/random_problem.h"

namespace marble {
namespace {

constexpr int kSeeds = 60;
constexpr int kMostFactorizations = 2000, kMostOfAContradiction = 200;

// Appends a row Σ value z_j + offset ≥ 0.
void add_inequality(OwnedProblem& p, const std::vector<double>& row, double offset) {
  Triplets entries;
  const SparseMatrix& C = p.C;
  for (Index j = 0; j < C.columns; ++j) {
    for (Index k = C.column_pointers[j]; k < C.column_pointers[j + 1]; ++k)
      entries.add(C.row_indices[k], j, C.values[k]);
  }
  const auto last = static_cast<Index>(p.d.size());
  for (std::size_t j = 0; j < row.size(); ++j) {
    if (row[j] != 0.0) entries.add(last, static_cast<Index>(j), row[j]);
  }
  p.C = compress(last + 1, static_cast<Index>(row.size()), entries, "C").value();
  p.d.push_back(offset);
}

std::vector<double> random_row(std::size_t size, std::uint64_t seed) {
  std::mt19937_64 engine(seed);
  std::vector<double> row(size);
  for (double& value : row) value = static_cast<double>(engine() >> 11) * 0x1p-52 - 1.0;
  return row;
}

std::vector<double> times_transposed(const SparseMatrix& m, const std::vector<double>& y, std::size_t offset,
                                     std::size_t columns) {
  std::vector<double> out(columns, 0.0);
  for (Index j = 0; j < m.columns; ++j) {
    for (Index k = m.column_pointers[j]; k < m.column_pointers[j + 1]; ++k)
      out[static_cast<std::size_t>(j)] +=
          m.values[k] * y[offset + static_cast<std::size_t>(m.row_indices[k])];
  }
  return out;
}

TEST(Ending, ContradictoryRowsAreInfeasibleWithAProof) {
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    OwnedProblem p = testing::random_problem({}, seed);
    // v ≥ 1 and v ≤ 0 for a random combination v.
    std::vector<double> row = random_row(p.g.size(), seed);
    add_inequality(p, row, -1.0);
    for (double& value : row) value = -value;
    add_inequality(p, row, 0.0);
    const Solution s = solve_in_process(p.view()).value();
    ASSERT_EQ(s.status, Status::infeasible) << p.name << ": " << s.detail;
    EXPECT_LE(s.factorizations, kMostOfAContradiction) << p.name;
    // Farkas: Aᵀy − Cᵀν − Lᵀξ − Rᵀη = 0 with ν, ξ, η ≥ 0 and bᵀy − dᵀν − lᵀξ − rᵀη > 0.
    const std::size_t n_e = p.b.size();
    const std::size_t n_i = p.d.size();
    const std::size_t n_c = p.l.size();
    ASSERT_EQ(s.certificate.size(), n_e + n_i + 2 * n_c);
    std::vector<double> combination = times_transposed(p.A, s.certificate, 0, p.g.size());
    double gap = 0.0;
    for (std::size_t i = 0; i < n_e; ++i) gap += p.b[i] * s.certificate[i];
    std::size_t offset = n_e;
    for (const auto& [matrix, vector] : {std::pair{&p.C, &p.d}, {&p.L, &p.l}, {&p.R, &p.r}}) {
      const auto part = times_transposed(*matrix, s.certificate, offset, p.g.size());
      for (std::size_t j = 0; j < part.size(); ++j) combination[j] -= part[j];
      for (std::size_t i = 0; i < vector->size(); ++i) {
        EXPECT_GE(s.certificate[offset + i], 0.0);
        gap -= (*vector)[i] * s.certificate[offset + i];
      }
      offset += vector->size();
    }
    EXPECT_GT(gap, 0.0) << p.name;
    for (const double entry : combination) EXPECT_NEAR(entry, 0.0, 1e-5 * gap) << p.name;
  }
}

// z₀ + z₁ ≥ 2 + apart and z₀ + z₁ ≤ 2, min z₀ + z₁, perhaps with 0 ≤ z₀ ⊥ z₁ ≥ 0.
OwnedProblem apart(double by, bool with_pair) {
  OwnedProblem p;
  p.g = {1.0, 1.0};
  add_inequality(p, {1.0, 1.0}, -2.0 - by);
  add_inequality(p, {-1.0, -1.0}, 2.0);
  if (!with_pair) return p;
  p.L = compress(1, 2, {{0}, {0}, {1.0}}, "L").value();
  p.R = compress(1, 2, {{0}, {1}, {1.0}}, "R").value();
  p.l = p.r = {0.0};
  return p;
}

TEST(Ending, RowsThatContradictEachOtherAreProvedSoAtOnce) {
  for (const bool with_pair : {false, true}) {
    const Solution s = solve_in_process(apart(2.0, with_pair).view()).value();
    EXPECT_EQ(s.status, Status::infeasible) << s.detail;
    EXPECT_FALSE(s.certificate.empty());
    EXPECT_LE(s.factorizations, 30) << with_pair;
  }
}

TEST(Ending, RowsApartByLessThanTheTolerancesAreNoContradiction) {
  for (const bool with_pair : {false, true}) {
    for (const double by : {1e-4, 3e-6}) {
      const Solution s = solve_in_process(apart(by, with_pair).view()).value();
      EXPECT_EQ(s.status, Status::almost_solved) << by << ": " << s.detail;
    }
    for (const double by : {5e-7, 1e-8}) {
      const Solution s = solve_in_process(apart(by, with_pair).view()).value();
      EXPECT_EQ(s.status, Status::solved) << by << ": " << s.detail;
    }
  }
}

TEST(Ending, PairsThatCannotBeMetAreProvedInfeasible) {
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    OwnedProblem p =
        testing::random_problem({.variables = 12, .equalities = 2, .inequalities = 2, .pairs = 4}, seed);
    // z₀ ≥ 1 and z₁ ≥ 1, but 0 ≤ z₀ ⊥ z₁ ≥ 0: feasible without complementarity only.
    p.A = {};
    p.b.clear();
    p.L = compress(1, 12, {{0}, {0}, {1.0}}, "L").value();
    p.R = compress(1, 12, {{0}, {1}, {1.0}}, "R").value();
    p.l = p.r = {0.0};
    p.C = {};
    p.d.clear();
    p.C.columns = 12;
    p.C.column_pointers.assign(13, 0);
    std::vector<double> row(12, 0.0);
    row[0] = 1.0;
    add_inequality(p, row, -1.0);
    std::swap(row[0], row[1]);
    add_inequality(p, row, -1.0);
    const Solution s = solve_in_process(p.view()).value();
    EXPECT_EQ(s.status, Status::infeasible) << p.name << ": " << s.detail;
    EXPECT_TRUE(s.certificate.empty()) << p.name;  // no single contradiction: one for each side
    EXPECT_LE(s.factorizations, kMostFactorizations) << p.name;
    EXPECT_GT(s.violations.complementarity + s.violations.inequality, 1e-3);
  }
}

TEST(Ending, DirectionsOfUnboundedDescentAreFoundAndShown) {
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    // One more variable, without curvature or rows, that costs −1.
    OwnedProblem p = testing::random_problem({}, seed);
    const Index n = static_cast<Index>(p.g.size()) + 1;
    p.g.push_back(-1.0);
    for (auto* matrix : {&p.Q, &p.A, &p.C, &p.L, &p.R}) {
      matrix->columns = n;
      matrix->column_pointers.push_back(matrix->column_pointers.back());
    }
    p.Q.rows = n;
    const Solution s = solve_in_process(p.view()).value();
    ASSERT_EQ(s.status, Status::unbounded) << p.name << ": " << s.detail;
    EXPECT_LE(s.factorizations, kMostFactorizations) << p.name;
    ASSERT_EQ(s.certificate.size(), static_cast<std::size_t>(n));
    EXPECT_NEAR(s.certificate.back(), 1.0, 1e-6);
    for (std::size_t j = 0; j + 1 < s.certificate.size(); ++j) EXPECT_NEAR(s.certificate[j], 0.0, 1e-4);
  }
}

double dot(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0.0;
  for (std::size_t j = 0; j < a.size(); ++j) sum += a[j] * b[j];
  return sum;
}

// M d by columns.
std::vector<double> times(const SparseMatrix& m, const std::vector<double>& d) {
  std::vector<double> out(static_cast<std::size_t>(m.rows), 0.0);
  for (Index j = 0; j < m.columns; ++j) {
    for (Index k = m.column_pointers[j]; k < m.column_pointers[j + 1]; ++k)
      out[static_cast<std::size_t>(m.row_indices[k])] += m.values[k] * d[static_cast<std::size_t>(j)];
  }
  return out;
}

// From z the objective falls along d for ever, and every row stays feasible.
void expect_ray(const OwnedProblem& p, const Solution& s) {
  constexpr double kSmall = 1e-9;
  const std::vector<double>& d = s.certificate;
  ASSERT_EQ(d.size(), p.g.size()) << p.name;
  EXPECT_LE(testing::judge(p.view(), s).infeasibility(), 1e-6) << p.name;
  const double curvature = dot(d, times(p.Q, d));
  EXPECT_TRUE(curvature < 0.0 || (curvature < kSmall && dot(p.g, d) < 0.0)) << p.name << " " << curvature;
  for (const double change : times(p.A, d)) EXPECT_NEAR(change, 0.0, kSmall) << p.name;
  for (const double change : times(p.C, d)) EXPECT_GE(change, -kSmall) << p.name;
  const std::vector<double> left = times(p.L, d);
  const std::vector<double> right = times(p.R, d);
  for (std::size_t i = 0; i < left.size(); ++i)
    EXPECT_NEAR(std::min(left[i], right[i]), 0.0, kSmall) << p.name << " pair " << i;
}

TEST(Ending, IndefiniteProblemsWithoutABoundEndAtALocalSolutionOrWithARay) {
  int decided = 0;
  constexpr int kProblems = 40;
  for (std::uint64_t seed = 1; seed <= kProblems; ++seed) {
    const OwnedProblem p = testing::random_problem({.indefinite = true}, seed);
    const Solution s = solve_in_process(p.view()).value();
    EXPECT_LE(s.factorizations, 2 * kMostFactorizations) << p.name << " " << to_string(s.status);
    EXPECT_NE(s.status, Status::infeasible) << p.name << ": it is feasible by construction";
    if (s.status == Status::unbounded) expect_ray(p, s);
    if (s.status == Status::solved) {
      const testing::Verdict verdict = testing::judge(p.view(), s);
      EXPECT_LE(verdict.infeasibility(), 1e-6) << p.name;
      EXPECT_LE(verdict.stationarity, 1e-6) << p.name;
      EXPECT_NE(s.second_order, SecondOrder::saddle) << p.name;
    }
    decided += s.status == Status::unbounded || s.status == Status::solved ? 1 : 0;
  }
  EXPECT_GE(decided, kProblems * 9 / 10);
}

// Wherever a solve is stopped, in whichever engine, it says so and gives the best point the path had.
TEST(Ending, ATimeLimitIsSaidWhereverItStrikes) {
  const OwnedProblem p = examples::gates();  // its path ends infeasible, other engines take over
  const Options options{.effort = 0.0};      // further starts begin with a solution
  const Solution whole = solve_in_process(p.view(), options).value();
  ASSERT_EQ(whole.status, Status::solved);
  class StopAfter : public ProgressSink {
   public:
    explicit StopAfter(int rows) : rows_(rows) {}
    void report(const Progress&) override {
      if (--rows_ == 0) source.request_stop();
    }
    std::stop_source source;

   private:
    int rows_;
  };
  for (int rows = 1; rows < whole.iterations; rows += 7) {
    StopAfter stopper(rows);
    const Solution s =
        solve_in_process(p.view(), options, {.progress = &stopper, .stop = stopper.source.get_token()})
            .value();
    EXPECT_EQ(s.status, Status::cancelled) << rows << ": " << s.detail;
    EXPECT_EQ(s.detail.rfind("stopped early", 0), 0U) << s.detail;
    const testing::Verdict verdict = testing::judge(p.view(), s);
    EXPECT_NEAR(verdict.equality, s.violations.equality, 1e-9 * (1.0 + verdict.equality)) << rows;
  }
}

// Gates with a limit of 41 iterations gave the start of a path that had just begun again.
TEST(Ending, MoreIterationsNeverGiveAWorseIterate) {
  const OwnedProblem problem = examples::gates();
  double before = std::numeric_limits<double>::infinity();
  for (int limit = 1; limit <= 60; ++limit) {
    Options options;
    options.max_iterations = limit;
    const Solution s = solve_in_process(problem.view(), options).value();
    if (s.status != Status::iteration_limit) break;
    const Violations& v = s.violations;
    const double now = std::max({v.equality, v.inequality, v.complementarity});
    EXPECT_LE(now, before * (1.0 + 1e-9)) << limit;
    before = now;
  }
}

}  // namespace
}  // namespace marble
