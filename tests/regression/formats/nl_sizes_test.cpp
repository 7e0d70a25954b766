// An .nl file of a few lines took all memory before it was refused.
//
// The counts of its header were allocated as they stood; sums of them overflowed; and products of defined
// variables were expanded, however many terms that makes.
#include <gtest/gtest.h>

#include "formats/nl_writer.h"
#include "nl/nl_problem.h"

namespace marble::formats {
namespace {

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
  std::string text = "g3 1 1 0\n 1 0 1 0 0\n 0 1\n 0 0\n 0 2147483647 0\n 0 0 0 1\n";
  text += " 0 0 2147483647 2147483647 2147483647\n 0 0\n 0 0\n 0 0 0 0 0\n";
  const auto file = parse_nl(text, "integers");
  ASSERT_FALSE(file.has_value());
  EXPECT_NE(file.error().message().find("6442450941 integer variables"), std::string::npos)
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
