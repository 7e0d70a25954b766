#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <limits>

#include "formats/nl_writer.h"
#include "marble/solver.h"
#include "matrix_market.h"
#include "nl/nl_problem.h"
#include "support/child_process.h"

namespace marble::formats {
namespace {

// A Pyomo model min (y - 60)^2 + (w + 5)^2 with complements(w >= 0, y >= 0) and y <= 50 was "solved" with 100
// at the infeasible w = -5; the best is 125 at w = 0. Conditions on variables with two bounds were counted
// twice besides.
//
// The reader of .nl files ignored the k of a row "5 k i" and took the row's sides from the variable's bounds:
// two of them made a mixed pair, which lets the row be negative at the upper one.
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

// One file that is too large among others ended `marble solve` with 3, "server unreachable", though no server
// was asked; a Matrix Market file of 60 bytes took 8.4 GB before it was refused.
//
// Memory that is not there could not be distinguished from a server's refusal; sizes in headers were
// allocated as they stood.
using marble::testing::ChildProcess;
using marble::testing::read_file;
using marble::testing::TemporaryDirectory;

constexpr const char* kTiny = R"({"n":1,"c0":0,"g":[-2],"Q":{"rows":1,"cols":1,"i":[0],"j":[0],"v":[2]}})";
constexpr const char* kBanner = "%%MatrixMarket matrix coordinate real general\n";

TEST(FileMemory, AHeaderCannotAskForMoreThanTheFilesLengthAllows) {
  for (const char* sizes : {"1 2147483647 0\n", "2147483647 1 0\n", "2147483647 2147483647 0\n"}) {
    const auto read = parse_matrix_market(
        {{"Q", std::string(kBanner) + sizes}, {"g", std::string(kBanner) + sizes}}, "header");
    ASSERT_FALSE(read.has_value());
    EXPECT_EQ(read.error().field, "Q");
    EXPECT_EQ(read.error().value, "line 2");
    EXPECT_NE(read.error().bound.find("must hold an integer in [0, 105"), std::string::npos)
        << read.error().bound;
  }
}

TEST(FileMemory, ATooLargeFileIsABadFileAndTheOthersAreSolved) {
  if (MARBLE_SANITIZED) GTEST_SKIP() << "a sanitizer needs the address space that is limited here";
  const TemporaryDirectory folder;
  std::ofstream(folder.file("first.json")) << kTiny;
  std::ofstream(folder.file("last.json")) << kTiny;
  {
    std::ofstream large(folder.file("large.json"));
    large << R"({"n":1,"g":[1],"A":{"rows":1,"cols":1,"i":[)";
    for (int i = 0; i < 60'000'000; ++i) large << "0,";  // 120 MB; as integers 240 MB, and copied as it grows
    large << "0]}}";
  }
  const std::string out = folder.file("out");
  ChildProcess marble({"/bin/sh", "-c",
                       "ulimit -v 500000; exec '" MARBLE_BINARY "' solve --local --quiet --output json '" +
                           folder.file("first.json") + "' '" + folder.file("large.json") + "' '" +
                           folder.file("last.json") + "'"},
                      out);
  EXPECT_EQ(marble.wait(), 2);
  const std::string reported = read_file(out);
  EXPECT_NE(reported.find("large.json: is too large for the memory there is"), std::string::npos) << reported;
  std::size_t solved = 0;
  for (std::size_t at = 0; (at = reported.find("\"status\":\"solved\"", at)) != std::string::npos; ++at)
    ++solved;
  EXPECT_EQ(solved, 2U) << reported;
}

// An .nl file of a few lines took all memory before it was refused.
//
// The counts of its header were allocated as they stood; sums of them overflowed; and products of defined
// variables were expanded, however many terms that makes.
using testing::NlWriter;

std::string refusal(NlWriter& nl) {
  const auto file = parse_nl(nl.content(), "large");
  return file ? "taken" : file.error().message();
}

TEST(NlSizes, CountsBeyondTheFilesOwnLengthAreRefusedBeforeAnythingIsAllocated) {
  constexpr int kMost = 0x7fffffff;
  for (const bool binary : {false, true}) {
    NlWriter variables(binary, kMost, 0, 1);
    EXPECT_NE(
        refusal(variables).find("header = 2147483647 variables, 0 constraints: must be no more than the file "
                                "has bytes"),
        std::string::npos)
        << refusal(variables);
    NlWriter constraints(binary, 1, kMost, 1);
    EXPECT_NE(refusal(constraints).find("must be no more than"), std::string::npos) << refusal(constraints);
  }
}

TEST(NlSizes, SumsOfCountsDoNotOverflow) {
  std::string text = "g3 1 1 0\n 1 0 1 0 0\n 0 1\n 2147483647 2147483647\n 0 1 0\n 0 0 0 1\n";
  text += " 2147483647 2147483647 2147483647 2147483647 2147483647\n 0 0\n 0 0\n 0 0 0 0 0\n";
  const auto file = parse_nl(text, "sums");
  ASSERT_FALSE(file.has_value());
  EXPECT_NE(file.error().message().find("10737418235 integer variables"), std::string::npos)
      << file.error().message();
}

TEST(NlSizes, IntegersThatContradictTheOtherCountsAreRefusedWithoutNamingAColumn) {
  std::string text = "g3 1 1 0\n 1 0 1 0 0\n 0 1\n 0 0\n 0 0 0\n 0 0 0 1\n";
  text += " 2147483647 2147483647 0 0 0\n 0 0\n 0 0\n 0 0 0 0 0\n";
  const auto file = parse_nl(text, "integers");
  ASSERT_FALSE(file.has_value());
  EXPECT_NE(file.error().message().find("4294967294 integer variables"), std::string::npos)
      << file.error().message();
  EXPECT_EQ(file.error().message().find("of variable"), std::string::npos) << file.error().message();
}

TEST(NlSizes, TermsAreBoundedByTheFilesLengthHoweverTheyAreMultiplied) {
  constexpr int kVariables = 6000;  // 36 million products in 100 kB
  NlWriter nl(false, kVariables, 0, 1);
  nl.key('V').integer(kVariables).integer(kVariables).integer(0);
  for (int i = 0; i < kVariables; ++i) nl.entry(i, 1.0);
  nl.constant(0.0);
  nl.key('O').integer(0).integer(0).operation(77).variable(kVariables);
  EXPECT_NE(refusal(nl).find("must have no more than"), std::string::npos) << refusal(nl);
}

}  // namespace
}  // namespace marble::formats
