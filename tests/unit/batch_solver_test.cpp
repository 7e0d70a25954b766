// Batches of numbers for one pattern: the same bits on any number of threads, answers no worse than cold
// solves, errors that name the element, and ends by time and by token.
#include "marble/batch_solver.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <set>

#include "lcs_systems.h"
#include "marble/examples.h"
#include "solver/batch_order.h"
#include "support/independent_check.h"
#include "support/random_problem.h"

namespace marble {
namespace {

using Values = std::vector<double>;

// Elements of one pattern, with what differs: vectors, or all parts.
struct Elements {
  OwnedProblem pattern;
  std::vector<OwnedProblem> problems;
  bool matrices = false;

  [[nodiscard]] Problem problem() const { return Problem::create(pattern.view()).value(); }
};

class Source {
 public:
  explicit Source(unsigned seed) : engine_(seed) {}
  double within(double size) { return size * (2.0 * static_cast<double>(engine_() >> 11) * 0x1p-53 - 1.0); }

 private:
  std::mt19937_64 engine_;
};

Elements random_elements(const testing::RandomSizes& sizes, std::size_t count, unsigned seed) {
  Source source(seed);
  Elements elements{testing::random_problem(sizes, seed), {}};
  for (std::size_t i = 0; i < count; ++i) {
    OwnedProblem p = elements.pattern;
    for (double& entry : p.g) entry += source.within(0.3);
    for (double& entry : p.d) entry += 0.1 + source.within(0.1);
    p.c0 += source.within(1.0);
    elements.problems.push_back(p);
  }
  return elements;
}

Elements hoppers(std::size_t count) {
  examples::HopperParameters parameters;
  parameters.steps = 5;
  Elements elements{examples::hopper(parameters), {}, true};
  for (std::size_t i = 0; i < count; ++i)
    elements.problems.push_back(examples::hopper(vary(parameters, 100 + i)));
  return elements;
}

Elements cart_poles(std::size_t count) {
  Source source(5);
  auto planner = LcsPlanner::create(testing::cart_pole().view(), testing::cart_pole_task(10)).value();
  const ProblemView view = planner.problem();
  const auto copy = [](std::span<const double> values) { return Values(values.begin(), values.end()); };
  const auto matrix = [&](const SparseMatrixView& m) {
    return SparseMatrix{m.rows,
                        m.columns,
                        {m.column_pointers.begin(), m.column_pointers.end()},
                        {m.row_indices.begin(), m.row_indices.end()},
                        copy(m.values)};
  };
  Elements elements;
  OwnedProblem& p = elements.pattern;
  p.Q = matrix(view.Q), p.A = matrix(view.A), p.L = matrix(view.L), p.R = matrix(view.R);
  p.hessian_form = view.hessian_form;
  p.g = copy(view.g), p.b = copy(view.b), p.l = copy(view.l), p.r = copy(view.r), p.c0 = view.c0;
  for (std::size_t i = 0; i < count; ++i) {
    const Values x0 = {source.within(0.4), source.within(0.3), source.within(1.0), source.within(1.0)};
    static_cast<void>(planner.begin({.x0 = x0, .shift = 0}).value());
    const ProblemView now = planner.problem();
    OwnedProblem next = p;
    next.b = copy(now.b), next.l = copy(now.l), next.r = copy(now.r), next.c0 = now.c0;
    elements.problems.push_back(next);
  }
  return elements;
}

struct Table {
  explicit Table(const Elements& elements) {
    const auto add = [](const Values& from, Values& to) { to.insert(to.end(), from.begin(), from.end()); };
    for (const OwnedProblem& p : elements.problems) {
      c0.push_back(p.c0);
      add(p.g, g), add(p.b, b), add(p.d, d), add(p.l, l), add(p.r, r);
      if (elements.matrices)
        add(p.Q.values, Q), add(p.A.values, A), add(p.C.values, C), add(p.L.values, L), add(p.R.values, R);
    }
    numbers = {elements.problems.size(), c0, g, b, d, l, r, Q, A, C, L, R};
  }
  Values c0, g, b, d, l, r, Q, A, C, L, R;
  BatchNumbers numbers;
};

bool same_bits(const Values& a, const Values& b) {
  return a.size() == b.size() &&
         (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(double)) == 0);
}

void expect_same_bits(const BatchResult& a, const BatchResult& b) {
  EXPECT_EQ(a.status, b.status);
  EXPECT_EQ(a.factorizations, b.factorizations);
  EXPECT_TRUE(same_bits(a.z, b.z));
  EXPECT_TRUE(same_bits(a.objective, b.objective));
  EXPECT_TRUE(same_bits(a.violations, b.violations));
  EXPECT_TRUE(same_bits(a.kkt_residual, b.kkt_residual));
  EXPECT_TRUE(same_bits(a.equality_multipliers, b.equality_multipliers));
  EXPECT_TRUE(same_bits(a.inequality_multipliers, b.inequality_multipliers));
  EXPECT_TRUE(same_bits(a.complementarity_multipliers_L, b.complementarity_multipliers_L));
  EXPECT_TRUE(same_bits(a.complementarity_multipliers_R, b.complementarity_multipliers_R));
}

Solution element(const BatchResult& result, std::size_t i) {
  const auto row = [&](const Values& values) {
    const std::size_t size = values.size() / result.count;
    const auto first = values.begin() + static_cast<std::ptrdiff_t>(i * size);
    return Values(first, first + static_cast<std::ptrdiff_t>(size));
  };
  Solution solution;
  solution.status = result.status[i];
  solution.objective = result.objective[i];
  solution.z = row(result.z);
  solution.equality_multipliers = row(result.equality_multipliers);
  solution.inequality_multipliers = row(result.inequality_multipliers);
  solution.complementarity_multipliers_L = row(result.complementarity_multipliers_L);
  solution.complementarity_multipliers_R = row(result.complementarity_multipliers_R);
  return solution;
}

// Solves with several numbers of threads, checks every element by itself, and returns how many end higher
// than a cold solve of their own.
int higher_than_cold(const Elements& elements) {
  const Table table(elements);
  BatchSolver solver = BatchSolver::create(elements.problem()).value();
  const BatchResult result = solver.solve(table.numbers, {.threads = 1, .multipliers = true}).value();
  for (const int threads : {2, 3}) {
    BatchSolver other = BatchSolver::create(elements.problem()).value();
    expect_same_bits(result, other.solve(table.numbers, {.threads = threads, .multipliers = true}).value());
    // Solvers that have solved something else before, and then the same again, give the same bits too.
    static_cast<void>(other.solve({.count = 3}, {.threads = 2}).value());
    expect_same_bits(result, other.solve(table.numbers, {.threads = threads, .multipliers = true}).value());
  }
  Solver cold = Solver::create(elements.problem()).value();
  int higher = 0;
  for (std::size_t i = 0; i < result.count; ++i) {
    const OwnedProblem& p = elements.problems[i];
    ProblemUpdate update{p.c0, p.g, p.b, p.d, p.l, p.r};
    if (elements.matrices)
      update.Q = p.Q.values, update.A = p.A.values, update.C = p.C.values, update.L = p.L.values,
      update.R = p.R.values;
    EXPECT_TRUE(cold.update(update).has_value());
    const Solution reference = cold.solve().value();
    const Solution own = element(result, i);
    if (!is_solved(own.status)) {
      higher += is_solved(reference.status);
      continue;
    }
    const testing::Verdict verdict = testing::judge(p.view(), own);
    EXPECT_LE(verdict.infeasibility(), 1e-6) << "element " << i;
    EXPECT_LE(verdict.stationarity, 1e-6) << "element " << i;
    EXPECT_LE(verdict.wrong_sign, 1e-6) << "element " << i;
    EXPECT_NEAR(verdict.objective, own.objective, 1e-8 * std::max(1.0, std::abs(own.objective)));
    const double* violations = &result.violations[3 * i];
    EXPECT_LE(*std::max_element(violations, violations + 3), 1e-6);
    if (is_solved(reference.status))
      higher += own.objective > reference.objective + 1e-6 * std::max(1.0, std::abs(reference.objective));
  }
  return higher;
}

TEST(BatchSolver, SolvesRandomElementsAsWellAsColdSolvesOnAnyNumberOfThreads) {
  EXPECT_LE(higher_than_cold(random_elements({}, 200, 3)), 2);
  EXPECT_LE(higher_than_cold(random_elements({.indefinite = true}, 100, 4)), 2);
  EXPECT_LE(higher_than_cold(random_elements({.pairs = 0}, 60, 5)), 0);
}

TEST(BatchSolver, SolvesCartPolesAndHoppersAsWellAsColdSolvesOnAnyNumberOfThreads) {
  EXPECT_LE(higher_than_cold(cart_poles(200)), 2);
  EXPECT_LE(higher_than_cold(hoppers(40)), 1);
}

TEST(BatchSolver, SolvesItsColdElementsToTheBitAsASolverThatIsGivenTheirNumbers) {
  const Elements elements = random_elements({}, 3, 8);
  BatchSolver solver = BatchSolver::create(elements.problem(), {.num_starts = 2}).value();  // each is cold
  const BatchResult result = solver.solve(Table(elements).numbers, {.threads = 2}).value();
  for (std::size_t i = 0; i < 3; ++i) {
    const OwnedProblem& p = elements.problems[i];
    Solver alone = Solver::create(elements.problem(), {.num_starts = 2}).value();
    ASSERT_TRUE(alone.update({p.c0, p.g, p.b, p.d, p.l, p.r}).has_value());
    const Solution own = alone.solve().value();
    EXPECT_TRUE(
        same_bits(own.z, Values(result.z.begin() + static_cast<std::ptrdiff_t>(i * own.z.size()),
                                result.z.begin() + static_cast<std::ptrdiff_t>((i + 1) * own.z.size()))));
    EXPECT_EQ(own.objective, result.objective[i]);
  }
}

TEST(BatchSolver, ForgetsTheScalingOfElementsInOtherUnits) {
  Elements elements = random_elements({}, 40, 6);
  for (std::size_t i = 0; i < 40; i += 3) {
    for (double& entry : elements.problems[i].g) entry *= 1e7;
  }
  const Table table(elements);
  BatchSolver one = BatchSolver::create(elements.problem()).value();
  const BatchResult result = one.solve(table.numbers, {.threads = 1}).value();
  EXPECT_EQ(result.solved(), 40u);
  for (const int threads : {2, 3}) {
    BatchSolver other = BatchSolver::create(elements.problem()).value();
    expect_same_bits(result, other.solve(table.numbers, {.threads = threads}).value());
  }
}

TEST(BatchSolver, KeepsThePatternsNumbersWhereNoneAreGiven) {
  const Elements elements = random_elements({}, 2, 9);
  BatchSolver solver = BatchSolver::create(elements.problem()).value();
  static_cast<void>(solver.solve(Table(elements).numbers).value());
  const BatchResult result = solver.solve({.count = 2}).value();
  const Solution own = solve_in_process(elements.pattern.view()).value();
  EXPECT_NEAR(result.objective[0], own.objective, 1e-9);
  EXPECT_NEAR(result.objective[1], own.objective, 1e-9);
}

TEST(BatchSolver, StartsFromAnotherResultOrFromGivenPoints) {
  const Elements elements = random_elements({}, 50, 10);
  const Table table(elements);
  BatchSolver solver = BatchSolver::create(elements.problem()).value();
  BatchResult first = solver.solve(table.numbers, {.multipliers = true}).value();
  const auto sum = [](const BatchResult& r) {
    std::int64_t all = 0;
    for (const std::int32_t count : r.factorizations) all += count;
    return all;
  };
  first.status[7] = Status::time_limit;  // not solved, so not a start: its numbers need not be finite
  first.z[7 * elements.pattern.g.size()] = std::numeric_limits<double>::quiet_NaN();
  const BatchResult again = solver.solve(table.numbers, {.start = &first}).value();
  EXPECT_EQ(again.solved(), 50u);
  EXPECT_LT(sum(again), sum(first));
  BatchNumbers numbers = table.numbers;
  Values points = first.z;
  points[7 * elements.pattern.g.size()] = 0.0;
  numbers.initial_z = points;
  const BatchResult from_points = solver.solve(numbers, {.threads = 1}).value();
  expect_same_bits(from_points, solver.solve(numbers, {.threads = 3}).value());
  for (std::size_t i = 0; i < 50; ++i) {
    EXPECT_LE(again.objective[i], first.objective[i] + 1e-9);
    EXPECT_TRUE(i == 7 || from_points.objective[i] <= first.objective[i] + 1e-9);
  }
}

TEST(BatchSolver, NamesTheFieldTheElementAndTheIndexOfWhatItRefuses) {
  const Elements elements = random_elements({}, 4, 11);
  BatchSolver solver = BatchSolver::create(elements.problem()).value();
  const auto message = [&](const BatchNumbers& numbers, const BatchSolverControls& controls = {}) {
    return solver.solve(numbers, controls).error().message();
  };
  Values g(48, 1.0);
  g[2 * 12 + 5] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(message({.count = 4, .g = g}), "g[2][5] = nan: must be finite");
  EXPECT_EQ(message({.count = 3, .g = g}),
            "g = 48 entries: must have none, or 3 x 12 (elements x entries of one)");
  EXPECT_EQ(message({.count = 0, .g = g}),
            "g = 48 entries: must have none, or 0 x 12 (elements x entries of one)");
  EXPECT_EQ(message({.count = 5, .Q = Values(7)}).substr(0, 8), "Q.values");
  EXPECT_EQ(message({.count = 4, .initial_z = Values(47)}).substr(0, 9), "initial_z");
  EXPECT_EQ(message({.count = std::numeric_limits<std::size_t>::max()}).substr(0, 5), "count");
  // A count whose product with 12 is 48 in 64 bits.
  EXPECT_EQ(message({.count = (std::size_t{1} << 62) + 4, .g = g}).substr(0, 5), "count");
  EXPECT_EQ(message({.count = 4}, {.threads = -1}), "threads = -1: must be in [0, 256]");
  EXPECT_EQ(message({.count = 4}, {.threads = 257}), "threads = 257: must be in [0, 256]");
  BatchResult start = solver.solve({.count = 4}).value();
  EXPECT_EQ(message({.count = 4}, {.start = &start}).substr(0, 26), "start.equality_multipliers");
  EXPECT_EQ(message({.count = 5}, {.start = &start}),
            "start = 4 elements: must have 5, as many as the batch");
  start.status.clear();
  EXPECT_EQ(message({.count = 4}, {.start = &start}).substr(0, 5), "start");
  EXPECT_EQ(solver.solve({.count = 4}).value().solved(), 4u);
  EXPECT_EQ(BatchSolver::create(elements.problem(), {.explain = true}).error().field, "explain");
  EXPECT_EQ(BatchSolver::create(elements.problem(), {}, {.most_bytes = 1}).error().code,
            ErrorCode::resource_exhausted);
}

TEST(BatchSolver, OfNoElementsIsEmpty) {
  BatchSolver solver = BatchSolver::create(random_elements({}, 0, 12).problem()).value();
  const BatchResult result = solver.solve({}, {.threads = 3, .multipliers = true}).value();
  EXPECT_EQ(result.count, 0u);
  EXPECT_TRUE(result.z.empty() && result.status.empty() && result.solved() == 0);
}

TEST(BatchSolver, SaysWhichElementsItDidNotReach) {
  const Elements elements = random_elements({}, 30, 13);
  const Table table(elements);
  std::stop_source source;
  source.request_stop();
  BatchSolver solver = BatchSolver::create(elements.problem()).value();
  const BatchResult stopped = solver.solve(table.numbers, {.threads = 2, .stop = source.get_token()}).value();
  EXPECT_EQ(std::ranges::count(stopped.status, Status::cancelled), 30);
  EXPECT_TRUE(std::ranges::all_of(stopped.z, [](double value) { return std::isnan(value); }));
  EXPECT_TRUE(std::ranges::all_of(stopped.factorizations, [](int count) { return count == 0; }));
  BatchSolver late = BatchSolver::create(elements.problem(), {.time_limit_s = 0.0}).value();
  const BatchResult result = late.solve(table.numbers, {.threads = 2}).value();
  EXPECT_EQ(std::ranges::count(result.status, Status::time_limit), 30);
  EXPECT_EQ(solver.solve(table.numbers).value().solved(), 30u);  // the token of a batch ends with it
}

TEST(BatchSolver, TellsInfeasibleElementsFromTheOthers) {
  OwnedProblem p;  // z >= bound, z <= 1, and a pair
  p.Q = {2, 2, {0, 1, 2}, {0, 1}, {1.0, 1.0}};
  p.g = {-2.0, -1.0};
  p.C = {2, 2, {0, 2, 2}, {0, 1}, {1.0, -1.0}}, p.d = {0.0, 1.0};
  p.L = {1, 2, {0, 1, 1}, {0}, {1.0}}, p.l = {0.0};
  p.R = {1, 2, {0, 0, 1}, {0}, {1.0}}, p.r = {0.0};
  BatchSolver solver = BatchSolver::create(Problem::create(p.view()).value()).value();
  Values d;
  for (int i = 0; i < 12; ++i) d.insert(d.end(), {i % 4 == 0 ? -2.0 : 0.0, 1.0});
  const BatchResult result = solver.solve({.count = 12, .d = d}).value();
  for (std::size_t i = 0; i < 12; ++i)
    EXPECT_EQ(result.status[i], i % 4 == 0 ? Status::infeasible : Status::solved) << "element " << i;
}

BatchOrder order_of(const Values& places) {
  const BatchPart part{places, 1};
  return BatchOrder(places.size(), {&part, 1});
}

TEST(BatchOrder, BeginsWithElementsFarFromEachOther) {
  const BatchOrder order = order_of({0.0, 0.1, 10.0, 5.0, 9.9, 0.2, -3e300, 3e300});
  EXPECT_EQ(order.elements()[0], 0u);
  const std::set<std::size_t> next(order.elements().begin() + 1, order.elements().begin() + 3);
  EXPECT_EQ(next, (std::set<std::size_t>{6, 7}));
  EXPECT_EQ(std::set<std::size_t>(order.elements().begin(), order.elements().end()).size(), 8u);
}

TEST(BatchOrder, FindsTheNearestThatAreUsable) {
  const BatchOrder order = order_of({0.0, 0.1, 10.0, 5.0, 9.9, 0.2});
  std::vector<std::uint8_t> usable(6, 1);
  std::vector<std::size_t> nearest;
  const auto elements = [&] {
    std::vector<std::size_t> found;
    for (const std::size_t position : nearest) found.push_back(order.elements()[position]);
    return found;
  };
  order.find_nearest(1, usable, 4, nearest);
  EXPECT_EQ(elements(), (std::vector<std::size_t>{1, 0, 5, 3}));
  usable[nearest.front()] = 0;
  order.find_nearest(1, usable, 4, nearest);
  EXPECT_EQ(elements(), (std::vector<std::size_t>{0, 5, 3, 4}));
  order.find_nearest(1, {}, 4, nearest);
  EXPECT_TRUE(nearest.empty());
}

TEST(BatchOrder, ProjectsManyNumbersAndKeepsEqualElementsTogether) {
  Source source(14);
  Values numbers(20 * 30);
  for (double& number : numbers) number = source.within(1.0);
  std::copy_n(numbers.begin() + 3 * 30, 30, numbers.begin() + 17 * 30);  // element 17 is element 3
  const BatchPart part{numbers, 30};
  const BatchOrder order(20, {&part, 1});
  const std::vector<std::uint8_t> usable(20, 1);
  std::vector<std::size_t> nearest;
  order.find_nearest(17, usable, 4, nearest);
  const std::set<std::size_t> first = {order.elements()[nearest[0]], order.elements()[nearest[1]]};
  EXPECT_EQ(first, (std::set<std::size_t>{3, 17}));
}

}  // namespace
}  // namespace marble
