// A Pyomo model min (y - 60)^2 + (w + 5)^2 with complements(w >= 0, y >= 0) and y <= 50 was "solved" with 100
// at the infeasible w = -5; the best is 125 at w = 0. Conditions on variables with two bounds were counted
// twice besides.
//
// The reader of .nl files ignored the k of a row "5 k i" and took the row's sides from the variable's bounds:
// two of them made a mixed pair, which lets the row be negative at the upper one.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "formats/nl_writer.h"
#include "marble/solver.h"
#include "nl/nl_problem.h"

namespace marble::formats {
namespace {

using testing::NlWriter;

constexpr double kNone = std::numeric_limits<double>::infinity();

void write_bounds(NlWriter& nl, double low, double high) {
  if (low == high) {
    nl.equal(low);
  } else if (low > -kNone && high < kNone) {
    nl.between(low, high);
  } else if (low > -kNone) {
    nl.at_least(low);
  } else if (high < kNone) {
    nl.at_most(high);
  } else {
    nl.free();
  }
}

/// min (y - y_wanted)^2 + (w - w_wanted)^2 with the row w ⊥ low <= y <= high, of these sides.
struct Case {
  int k;
  double low, high, y_wanted, w_wanted;
  double y = 0.0, w = 0.0;  ///< the best
  std::size_t pairs = 0;

  [[nodiscard]] Expected<ProblemFile> read(bool binary) const {
    NlWriter nl(binary, 2, 1, 1);
    nl.key('C').integer(0).constant(0.0);
    nl.key('O').integer(0).integer(0).operation(0);
    nl.operation(77).operation(1).variable(0).constant(y_wanted);
    nl.operation(77).operation(1).variable(1).constant(w_wanted);
    nl.key('r').complements(k, 0);
    nl.key('b');
    write_bounds(nl, low, high);
    nl.free();
    nl.key('J').integer(0).integer(1).entry(1, 1.0);
    return parse_nl(nl.content(), "sides");
  }
};

TEST(ComplementaritySides, AreThoseThatTheRowNamesAndOtherBoundsStayBounds) {
  const Case cases[] = {
      {1, 0.0, kNone, 60.0, -5.0, 60.0, 0.0, 1},     // w >= 0 ⊥ y >= 0
      {1, 0.0, 50.0, 60.0, -5.0, 50.0, 0.0, 1},      // y <= 50 is a row
      {1, 0.0, 50.0, 1.0, 5.0, 0.0, 5.0, 1},         //
      {1, 7.0, 7.0, 60.0, -5.0, 7.0, 0.0, 0},        // y stands still
      {1, 7.0, 7.0, 60.0, 5.0, 7.0, 5.0, 0},         //
      {2, -kNone, 50.0, 60.0, -5.0, 50.0, -5.0, 1},  // w <= 0 ⊥ y <= 50
      {2, 0.0, 50.0, 60.0, 5.0, 50.0, 0.0, 1},       //
      {2, 0.0, 50.0, 40.0, -5.0, 40.0, 0.0, 1},      //
      {2, 0.0, 50.0, -60.0, -5.0, 0.0, 0.0, 1},      // y >= 0 is a row
      {2, 7.0, 7.0, 60.0, 5.0, 7.0, 0.0, 0},         //
      {3, 0.0, 50.0, 60.0, -5.0, 50.0, -5.0, 2},     // w >= 0 at 0, w <= 0 at 50, w = 0 between
      {3, 0.0, 50.0, 60.0, 5.0, 50.0, 0.0, 2},       //
      {3, 0.0, 50.0, -60.0, 5.0, 0.0, 5.0, 2},       //
      {3, 7.0, 7.0, 60.0, -5.0, 7.0, -5.0, 0},       //
      {0, -kNone, kNone, 60.0, -5.0, 60.0, 0.0, 0},  // w = 0
  };
  for (const Case& c : cases) {
    for (const bool binary : {false, true}) {
      SCOPED_TRACE("k = " + std::to_string(c.k) + ", [" + std::to_string(c.low) + ", " +
                   std::to_string(c.high) + "], wanted " + std::to_string(c.y_wanted) + ", " +
                   std::to_string(c.w_wanted));
      const auto file = c.read(binary);
      ASSERT_TRUE(file.has_value()) << file.error().message();
      EXPECT_EQ(file->problem.l.size(), c.pairs);
      const Solution solution = solve_in_process(file->problem.view(), Options{.num_starts = 8}).value();
      ASSERT_EQ(solution.status, Status::solved);
      EXPECT_NEAR(solution.z[0], c.y, 1e-6);
      EXPECT_NEAR(solution.z[1], c.w, 1e-6);
    }
  }
}

TEST(ComplementaritySides, ThatTheVariableDoesNotHaveAreRefusedWithTheRow) {
  const struct {
    Case file;
    const char* reason;
  } cases[] = {
      {{1, -kNone, 50.0, 0.0, 0.0}, "r[0] = 5 1 1: must complement a variable with a lower bound"},
      {{1, -kNone, kNone, 0.0, 0.0}, "r[0] = 5 1 1: must complement a variable with a lower bound"},
      {{2, 0.0, kNone, 0.0, 0.0}, "r[0] = 5 2 1: must complement a variable with an upper bound"},
      {{3, 0.0, kNone, 0.0, 0.0}, "r[0] = 5 3 1: must complement a variable with an upper bound"},
      {{3, -kNone, 0.0, 0.0, 0.0}, "r[0] = 5 3 1: must complement a variable with a lower bound"},
      // Pyomo writes this of 0 <= w <= 5 complements y, and its 5 is lost.
      {{0, 0.0, 50.0, 0.0, 0.0}, "r[0] = 5 0 1: must complement a variable without bounds"},
      {{1, 50.0, 0.0, 0.0, 0.0}, "b[0] = [50.000000, 0.000000]: must be bounds with the lower one first"},
      {{2, 50.0, 0.0, 0.0, 0.0}, "b[0] = [50.000000, 0.000000]: must be bounds with the lower one first"},
      {{3, 50.0, 0.0, 0.0, 0.0}, "b[0] = [50.000000, 0.000000]: must be bounds with the lower one first"},
      {{4, 0.0, 50.0, 0.0, 0.0}, "r = 4: must be in [0, 3]"},
  };
  for (const auto& [file, reason] : cases) {
    for (const bool binary : {false, true}) {
      const auto read = file.read(binary);
      ASSERT_FALSE(read.has_value()) << reason;
      EXPECT_NE(read.error().message().find(reason), std::string::npos) << read.error().message();
    }
  }
}

TEST(ComplementaritySides, EightPairsOnVariablesWithTwoBoundsStayEight) {
  constexpr int kPairs = 8;
  NlWriter nl(false, 2 * kPairs, kPairs, 0);  // w_i >= 0 ⊥ y_i >= 0, y_i <= 50
  nl.key('r');
  for (int i = 0; i < kPairs; ++i) nl.complements(1, i);
  nl.key('b');
  for (int i = 0; i < kPairs; ++i) nl.between(0.0, 50.0);
  for (int i = 0; i < kPairs; ++i) nl.free();
  for (int i = 0; i < kPairs; ++i) nl.key('J').integer(i).integer(1).entry(kPairs + i, 1.0);
  const auto file = parse_nl(nl.content(), "qpec");
  ASSERT_TRUE(file.has_value()) << file.error().message();
  EXPECT_EQ(file->problem.l.size(), 8U);
  EXPECT_EQ(file->problem.g.size(), 16U) << "no variable of ours";
  EXPECT_EQ(file->problem.d.size(), 8U) << "the upper bounds";
}

TEST(ComplementaritySides, OneVariableMayComplementARowAtEitherBound) {
  NlWriter nl(false, 3, 2, 0);  // 0 <= v ⊥ y >= 0, 0 >= w ⊥ y <= 50; no bound is left for a row
  nl.key('r').complements(1, 0).complements(2, 0);
  nl.key('b').between(0.0, 50.0).free().free();
  nl.key('J').integer(0).integer(1).entry(1, 1.0);
  nl.key('J').integer(1).integer(1).entry(2, 1.0);
  const auto file = parse_nl(nl.content(), "both");
  ASSERT_TRUE(file.has_value()) << file.error().message();
  EXPECT_EQ(file->problem.l.size(), 2U);
  EXPECT_EQ(file->problem.d.size(), 0U);
}

}  // namespace
}  // namespace marble::formats
