#include "marble/options.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "marble/report/option_scope.h"

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

TEST(Options, ThoseThatCountOnlyBesideOthersSaySo) {
  const std::set<std::string_view> printed_too = {"kappa_factor", "rho_initial", "rho_factor",
                                                  "inner_tolerance"};
  const std::set<std::string_view> solver_only = {"scaling_passes", "polish",
                                                  "max_local_search_factorizations", "num_starts"};
  std::set<std::string_view> others;
  for (const OptionInfo& option : option_table()) {
    const std::string_view scope = option_scope(option.name);
    if (printed_too.contains(option.name)) {
      EXPECT_EQ(scope, "path = paper or algorithm1") << option.name;
    } else if (solver_only.contains(option.name)) {
      EXPECT_EQ(scope, "path = fast or paper") << option.name;
    } else if (!scope.empty()) {
      others.insert(option.name);
    }
  }
  EXPECT_EQ(others, (std::set<std::string_view>{"node_limit", "max_feasibility_factorizations",
                                                "max_small_problem_nodes", "effort"}));
  EXPECT_EQ(option_scope("no_option"), "");
}

TEST(Options, CountOnlyWhereTheirScopeHolds) {
  Options options;
  EXPECT_FALSE(option_counts(options, "inner_tolerance"));
  EXPECT_TRUE(option_counts(options, "max_small_problem_nodes"));
  EXPECT_TRUE(option_counts(options, "num_starts"));
  EXPECT_TRUE(option_counts(options, "kappa_min"));
  options.global_search = true;
  EXPECT_TRUE(option_counts(options, "node_limit"));
  EXPECT_FALSE(option_counts(options, "max_small_problem_nodes"));
  options.path = Path::algorithm1;
  EXPECT_TRUE(option_counts(options, "inner_tolerance"));
  EXPECT_FALSE(option_counts(options, "num_starts"));
}

TEST(Options, BadTextSaysWhatWouldBeGood) {
  Options options;
  EXPECT_EQ(set_option_text(options, "path", "slow").error().message(),
            "path = slow: must be one of fast, paper, algorithm1");
  EXPECT_EQ(set_option_text(options, "max_iterations", "1.5").error().message(),
            "max_iterations = 1.5: must be a whole number");
  EXPECT_EQ(set_option_text(options, "kappa_factor", "half").error().message(),
            "kappa_factor = half: must be a number");
  EXPECT_EQ(set_option_text(options, "kapa_factor", "1").error().message(), "kapa_factor: is not an option");
  EXPECT_EQ(set_option_text(options, "kappa_factor", "1e999").error().field, "kappa_factor");
}

TEST(Options, TextThatIsNotWhollyTheValueIsRefusedAndChangesNothing) {
  Options options;
  for (const char* text : {"", " 1", "1 ", "1,5", "0x1", "+1", "--1", "1e", "nan", "inf", "-inf", "1e999"}) {
    EXPECT_FALSE(set_option_text(options, "rho_max", text).has_value()) << '"' << text << '"';
  }
  EXPECT_EQ(options.rho_max, Options{}.rho_max);
  EXPECT_EQ(set_option_text(options, "rho_max", "1e999").error().message(),
            "rho_max = 1e999: must be in [1e-06, 1e+12]");
  for (const char* text : {"", "2", "True", "yes"}) {
    EXPECT_EQ(set_option_text(options, "polish", text).error().bound, "must be true or false") << text;
  }
}

TEST(Options, EveryOneIsSetByItsOwnText) {
  for (const OptionInfo& option : option_table()) {
    Options options;
    const bool choice = option.type == OptionType::choice;
    EXPECT_EQ(choice, !option.choices.empty()) << option.name;
    if (choice) {
      EXPECT_EQ(option.choices.size(), static_cast<std::size_t>(option.high - option.low) + 1);
      for (std::size_t i = 0; i < option.choices.size(); ++i) {
        EXPECT_TRUE(set_option_text(options, option.name, option.choices[i]).has_value());
        EXPECT_EQ(get_option(options, option.name), static_cast<double>(i));
      }
    } else if (option.type == OptionType::boolean) {
      for (const auto& [text, value] : {std::pair{"false", 0.0}, {"true", 1.0}, {"0", 0.0}, {"1", 1.0}}) {
        EXPECT_TRUE(set_option_text(options, option.name, text).has_value());
        EXPECT_EQ(get_option(options, option.name), value) << option.name;
      }
    } else {
      EXPECT_TRUE(set_option_text(options, option.name, "1").has_value() || option.high < 1.0) << option.name;
    }
  }
}

TEST(Options, NamesAreUnique) {
  std::set<std::string_view> names;
  for (const OptionInfo& option : option_table())
    EXPECT_TRUE(names.insert(option.name).second) << option.name;
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
