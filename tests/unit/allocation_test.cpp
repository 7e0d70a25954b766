// The loop allocates nothing after set-up. In a program of its own, because it replaces malloc's front door.
#include <dlfcn.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>

#include "marble/examples.h"
#include "marble/solver.h"
#include "support/random_problem.h"

namespace {

std::atomic<bool> counting = false;
std::atomic<int> allocations = 0;

void count() {
  if (counting.load(std::memory_order_relaxed)) allocations.fetch_add(1, std::memory_order_relaxed);
}

}  // namespace

// Every C++ allocation, Eigen's included, ends in malloc.
extern "C" void* malloc(std::size_t size) {
  static auto* const real = reinterpret_cast<void* (*)(std::size_t)>(dlsym(RTLD_NEXT, "malloc"));
  count();
  return real(size);
}

namespace marble {
namespace {

// Counts from the first report to the last: what lies between is the loop.
class CountingSink : public ProgressSink {
 public:
  void report(const Progress&) override {
    if (rows++ == 0) {
      allocations = 0;
      counting = true;
    }
    until_last = allocations;
  }
  int rows = 0;
  int until_last = 0;
};

void expect_none(const OwnedProblem& p, Path path) {
  Options options;
  options.path = path;
  Solver solver = Solver::create(Problem::create(p.view()).value(), options).value();
  CountingSink sink;
  const Solution s = solver.solve({.progress = &sink}).value();
  counting = false;
  EXPECT_GT(sink.rows, 5) << p.name;
  EXPECT_EQ(sink.until_last, 0) << p.name << " in " << s.iterations << " iterations";
}

TEST(Allocation, TheCounterCounts) {
  allocations = 0;
  counting = true;
  free(malloc(17));
  counting = false;
  EXPECT_EQ(allocations, 1);
}

TEST(Allocation, NoneInTheLoopOfASparseProblem) {
  expect_none(examples::rocket(), Path::fast);
  expect_none(examples::hopper({.steps = 20}), Path::paper);
}

TEST(Allocation, NoneInTheLoopOfADenseProblem) {
  const OwnedProblem p = testing::random_problem(
      {.variables = 40, .equalities = 5, .inequalities = 20, .pairs = 20, .density = 1.0}, 1);
  expect_none(p, Path::fast);
  expect_none(p, Path::paper);
}

}  // namespace
}  // namespace marble
