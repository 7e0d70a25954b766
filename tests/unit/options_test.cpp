#include "marble/options.h"

#include <gtest/gtest.h>

#include <cmath>

namespace marble {
namespace {

TEST(Options, DefaultsAreWithinTheirRanges) {
  EXPECT_TRUE(validate(Options{}).has_value());
  for (const OptionInfo& option : option_table()) {
    EXPECT_GE(option.default_value, option.low) << option.name;
    EXPECT_LE(option.default_value, option.high) << option.name;
    EXPECT_FALSE(option.doc.empty()) << option.name;
    EXPECT_EQ(get_option(Options{}, option.name), option.default_value) << option.name;
  }
}

TEST(Options, EveryOneCanBeSetToBothEndsOfItsRangeAndNoFurther) {
  for (const OptionInfo& option : option_table()) {
    Options options;
    for (const double end : {option.low, option.high}) {
      EXPECT_TRUE(set_option(options, option.name, end).has_value()) << option.name;
      EXPECT_EQ(get_option(options, option.name), end) << option.name;
    }
    const auto beyond = set_option(options, option.name, option.high + std::max(1.0, std::abs(option.high)));
    ASSERT_FALSE(beyond.has_value()) << option.name;
    EXPECT_EQ(beyond.error().field, option.name);
    EXPECT_EQ(get_option(options, option.name), option.high) << "a refused value changes nothing";
    EXPECT_FALSE(set_option(options, option.name, std::nan("")).has_value()) << option.name;
  }
}

TEST(Options, TextIsParsedByType) {
  Options options;
  EXPECT_TRUE(set_option_text(options, "path", "paper").has_value());
  EXPECT_EQ(options.path, Path::paper);
  EXPECT_TRUE(set_option_text(options, "max_iterations", "12").has_value());
  EXPECT_EQ(options.max_iterations, 12);
  EXPECT_TRUE(set_option_text(options, "kappa_factor", "2.5e-1").has_value());
  EXPECT_EQ(options.kappa_factor, 0.25);
  EXPECT_TRUE(set_option_text(options, "polish", "false").has_value());
  EXPECT_FALSE(options.polish);
}

TEST(Options, BadTextSaysWhatWouldBeGood) {
  Options options;
  EXPECT_EQ(set_option_text(options, "path", "slow").error().message(),
            "path = slow: must be one of fast, paper");
  EXPECT_EQ(set_option_text(options, "max_iterations", "1.5").error().message(),
            "max_iterations = 1.5: must be a whole number");
  EXPECT_EQ(set_option_text(options, "kappa_factor", "half").error().message(),
            "kappa_factor = half: must be a number");
  EXPECT_EQ(set_option_text(options, "kapa_factor", "1").error().message(), "kapa_factor: is not an option");
  EXPECT_EQ(set_option_text(options, "kappa_factor", "1e999").error().field, "kappa_factor");
}

TEST(Options, ValidateFindsWhatWasSetAroundTheChecks) {
  Options options;
  options.kappa_factor = 1.5;
  const auto valid = validate(options);
  ASSERT_FALSE(valid.has_value());
  EXPECT_EQ(valid.error().field, "kappa_factor");
}

}  // namespace
}  // namespace marble
