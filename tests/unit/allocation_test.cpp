// The solve allocates nothing but its answer. In a program of its own, because it replaces malloc's front
// door.
#include <gtest/gtest.h>
#include <malloc.h>

#include <cstdlib>
#include <new>

#include "marble/examples.h"
#include "marble/research/methods.h"
#include "support/allocation_guard.h"
#include "support/random_problem.h"

namespace marble {
namespace {

using testing::allocations;

// Counts from the first report to the last: what lies between is the loop.
class CountingSink : public ProgressSink {
 public:
  void report(const Progress&) override {
    const std::int64_t now = allocations();
    if (rows++ == 0) first = now;
    last = now;
  }
  int rows = 0;
  std::int64_t first = 0;
  std::int64_t last = 0;
};

Solver make(const OwnedProblem& p, const Options& options) {
  return Solver::create(Problem::create(p.view()).value(), options,
                        {.reference_methods = &research::reference_methods()})
      .value();
}

void expect_none_in_loop(const OwnedProblem& p, Options options) {
  options.effort = 0.0;  // each further start allocates its plan
  for (const Path path : {Path::fast, Path::paper}) {
    options.path = path;
    Solver solver = make(p, options);
    CountingSink sink;
    const Solution s = solver.solve({.progress = &sink}).value();
    EXPECT_GT(sink.rows, 5) << p.name;
    EXPECT_EQ(sink.last - sink.first, 0) << p.name << " in " << s.iterations << " iterations";
  }
}

OwnedProblem dense_problem() {
  return testing::random_problem(
      {.variables = 40, .equalities = 5, .inequalities = 20, .pairs = 20, .density = 1.0}, 1);
}

void* volatile escaped;  // lest the compiler drops an allocation nobody looks at

TEST(AllocationGuard, CountsEveryWayToTheHeap) {
  const auto expect_one = [](auto&& allocate) {
    const std::int64_t before = allocations();
    escaped = allocate();
    EXPECT_EQ(allocations() - before, 1);
    return escaped;
  };
  std::free(expect_one([] { return std::malloc(17); }));
  std::free(expect_one([] { return std::calloc(3, 5); }));
  std::free(expect_one([] { return std::aligned_alloc(64, 128); }));
  std::free(expect_one([] {
    void* memory = nullptr;
    return posix_memalign(&memory, 32, 96) == 0 ? memory : nullptr;
  }));
  void* grown = std::malloc(8);
  std::free(expect_one([grown] { return std::realloc(grown, 4096); }));
  ::operator delete(expect_one([] { return ::operator new(24); }));
}

TEST(Allocation, NoneInTheLoopOfASparseProblem) {
  expect_none_in_loop(examples::rocket(), {});
  expect_none_in_loop(examples::hopper({.steps = 20}), {});
}

TEST(Allocation, NoneInTheLoopOfADenseProblem) { expect_none_in_loop(dense_problem(), {}); }

TEST(Allocation, NoneInTheLoopOfAProblemWhoseLinesSearchAndRetry) {
  OwnedProblem p = testing::random_problem(
      {.variables = 30, .equalities = 5, .inequalities = 60, .pairs = 8, .indefinite = true}, 3);
  Options options;
  options.max_iterations = 200;
  expect_none_in_loop(p, options);
}

TEST(Allocation, NoneInTheLoopOfAnyMethod) {
  for (const Method method :
       {Method::penalty_scp, Method::relaxation, Method::l1_penalty, Method::exterior, Method::alag,
        Method::aladin_beta, Method::l1_barrier, Method::l1_barrier_stepwise, Method::plain_barrier}) {
    for (const OwnedProblem& p : {examples::rocket(), dense_problem()}) {
      Solver solver = make(p, {.max_iterations = 60, .method = method});
      CountingSink sink;
      const Solution s = solver.solve({.progress = &sink}).value();
      EXPECT_GT(sink.rows, 2) << s.detail;
      EXPECT_EQ(sink.last - sink.first, 0) << s.detail;
    }
  }
}

TEST(Allocation, NoneInAnyFactorizationOfPolishAndLocalSearch) {
  // What a solve allocates beyond its loop is its answer: no more when it factorizes more.
  for (const OwnedProblem& p : {examples::hopper({.steps = 20}), dense_problem()}) {
    std::int64_t counts[2];
    int factorizations[2];
    for (const int searched : {0, 1}) {
      Options options;
      options.max_small_problem_nodes = 0;  // a tree has workspace of its own
      options.effort = 0.0;
      options.max_local_search_factorizations = searched == 0 ? 0 : 200;
      Solver solver = make(p, options);
      const std::int64_t before = allocations();
      const Solution s = solver.solve().value();
      counts[searched] = allocations() - before;
      factorizations[searched] = s.factorizations;
      EXPECT_EQ(s.status, Status::solved) << p.name;
    }
    EXPECT_GT(factorizations[1], factorizations[0]) << p.name << ": the search had nothing to do";
    EXPECT_EQ(counts[0], counts[1]) << p.name;
  }
}

TEST(Allocation, AProgressSinkAndAStopTokenAddNone) {
  const OwnedProblem p = examples::rocket();
  Solver solver = make(p, {});
  const auto count = [&solver](const SolveControls& controls) {
    const std::int64_t before = allocations();
    EXPECT_TRUE(solver.solve(controls).has_value());
    return allocations() - before;
  };
  CountingSink sink;
  const std::stop_source source;
  static_cast<void>(count({}));  // finds out, once for all solves, whether Q is convex
  const std::int64_t plain = count({});
  EXPECT_EQ(count({.progress = &sink, .stop = source.get_token()}), plain);
}

TEST(Allocation, IsWhatTheSolverSaysItTakes) {
  const auto in_use = [] {
    const struct mallinfo2 heap = mallinfo2();
    return static_cast<double>(heap.uordblks + heap.hblkhd);
  };
  for (const OwnedProblem& p : {examples::hopper(), examples::hopper({.steps = 150}), examples::rocket(),
                                examples::gates(), examples::qpec({}, 1)}) {
    const double before = in_use();
    const Solver solver = make(p, {});
    const double taken = in_use() - before;
    EXPECT_NEAR(static_cast<double>(solver.memory_bytes()) / taken, 1.0, 0.2) << p.name;
  }
}

}  // namespace
}  // namespace marble
