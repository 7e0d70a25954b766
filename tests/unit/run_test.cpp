// What a run counts, and why it ends.
#include "path/run.h"

#include <gtest/gtest.h>

#include "support/random_problem.h"
#include "workbench.h"

namespace marble {
namespace {

using testing::Rows;
using testing::Workbench;
using Polishing = Run::Polishing;  // in a test, Run is a function of gtest

TEST(Run, TakesOverWhatItsPartsHaveCountedOnce) {
  Workbench w(testing::random_problem({}, 1));
  w.run.iterations = 5;
  w.run.factorizations = 8;
  w.run.times.factorization_s = 1.0;
  auto a = w.run.part(true);
  auto b = w.run.part(true);
  a.iterations += 2;
  a.factorizations += 3;
  a.times.factorization_s += 0.25;
  b.factorizations += 4;
  b.nonconvex = true;
  b.times.line_search_s += 0.5;
  w.run.add_part(a);
  w.run.add_part(b);
  EXPECT_EQ(w.run.iterations, 7);
  EXPECT_EQ(w.run.factorizations, 15);
  EXPECT_TRUE(w.run.nonconvex);
  EXPECT_EQ(w.run.times.factorization_s, 1.25);
  EXPECT_EQ(w.run.times.line_search_s, 0.5);
}

TEST(Run, AStopComesBeforeTheLimitOfIterationsAndThatBeforeTheTime) {
  Options options;
  options.max_iterations = 3;
  options.time_limit_s = 0.0;
  Rows rows;
  Workbench w(testing::random_problem({}, 1), options, &rows);
  EXPECT_EQ(w.run.interrupted(), Status::time_limit);
  w.run.iterations = 3;
  EXPECT_EQ(w.run.interrupted(), Status::iteration_limit);
  rows.source.request_stop();
  EXPECT_EQ(w.run.interrupted(), Status::cancelled);
  EXPECT_FALSE(Workbench(testing::random_problem({}, 1)).run.interrupted().has_value());
}

TEST(Run, PolishingCountsOnceHoweverDeepAndNotWhatIsCountedElsewhere) {
  Workbench w(testing::random_problem({}, 1));
  {
    const Polishing outer(w.run);
    {
      const Polishing inner(w.run);
      w.run.times.factorization_s += 1000.0;
    }
    EXPECT_EQ(w.run.times.polish_s, 0.0) << "the outermost one counts";
  }
  EXPECT_EQ(w.run.times.polish_s, 0.0) << "longer factored than it lasted: nothing is left";
  { const Polishing again(w.run); }
  EXPECT_GE(w.run.times.polish_s, 0.0);
  EXPECT_LT(w.run.times.polish_s, 1000.0);
}

}  // namespace
}  // namespace marble
