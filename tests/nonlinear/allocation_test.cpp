// An iteration allocates nothing but what its tick and the caller's functions do. In a program of its own,
// because it replaces malloc's front door.
#include <gtest/gtest.h>

#include <cmath>

#include "marble/nonlinear.h"
#include "support/allocation_guard.h"

namespace marble::testing {
namespace {

// Ticks whose allocations count as theirs.
class CountedTicks final : public nonlinear::Ticks {
 public:
  CountedTicks(std::unique_ptr<nonlinear::Ticks> ticks, std::int64_t& theirs)
      : ticks_(std::move(ticks)), theirs_(theirs) {}
  Expected<Solution> solve(const ProblemUpdate& update, const nonlinear::TickControls& controls) override {
    const std::int64_t before = allocations();
    auto answer = ticks_->solve(update, controls);
    theirs_ += allocations() - before;
    return answer;
  }

 private:
  std::unique_ptr<nonlinear::Ticks> ticks_;
  std::int64_t& theirs_;
};

// A particle that is pushed along a curve, against a floor: functions that allocate nothing.
class Slide {
 public:
  nonlinear::Problem problem() {
    nonlinear::Problem p;
    p.values = [this](std::span<const double> x) -> nonlinear::Values {
      c_[0] = x[1] - std::sin(x[0]) - x[2];
      G_[0] = x[1], H_[0] = x[2];
      return {
          .objective = std::pow(x[0] - 5, 4) + x[1] * x[1] + x[2] * x[2], .equalities = c_, .G = G_, .H = H_};
    };
    p.derivatives = [this](std::span<const double> x) -> nonlinear::Derivatives {
      gradient_[0] = 4 * std::pow(x[0] - 5, 3), gradient_[1] = 2 * x[1], gradient_[2] = 2 * x[2];
      row_.values[0] = -std::cos(x[0]);
      return {.gradient = gradient_, .equalities = row_.view(), .G = first_.view(), .H = second_.view()};
    };
    p.start = {0.5, 0.5, 0};
    return p;
  }

 private:
  double c_[1] = {}, G_[1] = {}, H_[1] = {}, gradient_[3] = {};
  SparseMatrix row_{1, 3, {0, 1, 2, 3}, {0, 0, 0}, {0, 1, -1}};
  SparseMatrix first_{1, 3, {0, 0, 1, 1}, {0}, {1}};
  SparseMatrix second_{1, 3, {0, 0, 0, 1}, {0}, {1}};
};

TEST(NonlinearAllocation, NoneAnIterationButTheTicks) {
  Slide slide;
  const auto problem = slide.problem();
  std::int64_t theirs = 0, first = 0, last = 0;
  int rows = 0;
  const nonlinear::OpenTicks open =
      [&](const ProblemView& view,
          const nonlinear::Settings& s) -> Expected<std::unique_ptr<nonlinear::Ticks>> {
    MARBLE_ASSIGN_OR_RETURN(auto ticks, nonlinear::open_ticks_in_process(view, s));
    return std::make_unique<CountedTicks>(std::move(ticks), theirs);
  };
  nonlinear::Settings settings;
  settings.iteration = [&](const nonlinear::Iteration& row) {
    const std::int64_t own = allocations() - theirs;
    if (row.iteration == 1) first = own;  // by then every vector has its size
    last = own;
    ++rows;
  };
  const auto answer = nonlinear::solve(problem, open, settings);
  ASSERT_TRUE(answer.has_value()) << answer.error().message();
  EXPECT_EQ(answer->status, Status::solved) << answer->detail;
  EXPECT_GT(rows, 5);
  EXPECT_EQ(last - first, 0) << "in " << rows << " iterations";
}

}  // namespace
}  // namespace marble::testing
