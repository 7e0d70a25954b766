#include "marble/options.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <set>
#include <string>

#include "marble/error.h"
#include "marble/report/option_scope.h"
#include "path/termination.h"
#include "random_setting.h"

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

TEST(Error, MessageSaysWhereWhatAndWhy) {
  const Error error{ErrorCode::invalid_argument, "A.row_indices", 3, "12", "must be in [0, 12)"};
  EXPECT_EQ(error.message(), "A.row_indices[3] = 12: must be in [0, 12)");
}

TEST(Error, MessageLeavesOutWhatIsNotKnown) {
  const auto message = [](const char* field, std::int64_t index, const char* value, const char* bound) {
    return Error{ErrorCode::invalid_argument, field, index, value, bound}.message();
  };
  EXPECT_EQ(message("g", -1, "", "is missing"), "g: is missing");
  EXPECT_EQ(message("g", 0, "", "is missing"), "g[0]: is missing");
  EXPECT_EQ(message("g", 0, "nan", ""), "g[0] = nan");
  EXPECT_EQ(message("", -1, "", "must not be empty"), "must not be empty");
  EXPECT_EQ(message("", -1, "", ""), "invalid_argument");
}

TEST(Error, EveryCodeHasANameOfItsOwn) {
  std::set<std::string> names;
  int codes = 0;
  for (int code = 0; code <= static_cast<int>(ErrorCode::internal); ++code, ++codes)
    names.insert(to_string(static_cast<ErrorCode>(code)));
  EXPECT_EQ(static_cast<int>(names.size()), codes);
  EXPECT_FALSE(names.contains("unknown"));
}

TEST(Error, IsMadeWithWhatIsKnownAndNothingElse) {
  const Error error = invalid("A.row_indices", 3, "12", "must be in [0, 12)");
  EXPECT_EQ(error.code, ErrorCode::invalid_argument);
  EXPECT_EQ(error.message(), "A.row_indices[3] = 12: must be in [0, 12)");
  EXPECT_EQ(invalid("stages", "0", "must be >= 1").message(), "stages = 0: must be >= 1");
  EXPECT_EQ(invalid("stages", "is missing").message(), "stages: is missing");
  EXPECT_EQ(failure(ErrorCode::not_found, "job_id", "7", "is no job").message(), "job_id = 7: is no job");
  EXPECT_EQ(failure(ErrorCode::not_found, "job_id", "is no job").index, -1);
  EXPECT_EQ(failure(ErrorCode::internal, "failed").message(), "failed");
}

TEST(Error, IsReportedOnPathsOfWhoHoldsTheField) {
  const Error error = invalid("A.values", 3, "nan", "must be finite");
  EXPECT_EQ(inside("problem", error).message(), "problem.A.values[3] = nan: must be finite");
  EXPECT_EQ(of_field("gradient", error).message(), "gradient[3] = nan: must be finite");
  EXPECT_EQ(inside("problem", failure(ErrorCode::cancelled, "given up")).message(), "given up");
}

TEST(Error, ComesInPlaceOfAnExceptionWhenMemoryRunsOut) {
  const auto greedy = []() -> Expected<int> { throw std::bad_alloc(); };
  EXPECT_EQ(or_out_of_memory(greedy).error().code, ErrorCode::resource_exhausted);
  const auto own = [] { return failure(ErrorCode::resource_exhausted, "problem", "does not fit"); };
  EXPECT_EQ(or_out_of_memory(greedy, own).error().field, "problem");
  EXPECT_EQ(or_out_of_memory([]() -> Expected<int> { return 7; }).value(), 7);
}

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

TEST(WithinTolerances, AsksEachViolationItsOwnTolerance) {
  Options options;
  options.equality_tolerance = 1e-3;
  options.inequality_tolerance = 1e-4;
  options.complementarity_tolerance = 1e-5;
  EXPECT_TRUE(within_tolerances({1e-3, 1e-4, 1e-5}, options));
  EXPECT_FALSE(within_tolerances({2e-3, 0.0, 0.0}, options));
  EXPECT_FALSE(within_tolerances({0.0, 2e-4, 0.0}, options));
  EXPECT_FALSE(within_tolerances({0.0, 0.0, 2e-5}, options));
  EXPECT_TRUE(within_tolerances({2e-3, 2e-4, 2e-5}, options, 2.0));
  EXPECT_FALSE(within_tolerances({kNan, 0.0, 0.0}, options));
  EXPECT_FALSE(within_tolerances({0.0, kNan, 0.0}, options));
  EXPECT_FALSE(within_tolerances({0.0, 0.0, kNan}, options));
}

TEST(StallDetector, IsPatientWhileTheViolationFalls) {
  StallDetector stall;
  double violation = 1.0;
  for (int i = 0; i < 500; ++i) EXPECT_FALSE(stall.stalled(violation *= 0.85));
}

TEST(StallDetector, SpeaksUpWithinABoundedNumberOfRounds) {
  for (const double drift : {1.0, 0.9999, 1.01}) {
    StallDetector stall;
    double violation = 1.0;
    int rounds = 0;
    while (!stall.stalled(violation *= drift)) ASSERT_LT(++rounds, 200) << drift;
    EXPECT_GT(rounds, 3);
  }
  StallDetector stall;
  int rounds = 0;
  while (!stall.stalled(kNan)) ASSERT_LT(++rounds, 200);
}

class ExplainEnd : public ::testing::Test {
 protected:
  [[nodiscard]] Status status(const Violations& violations, double residual_norm, bool stalled) const {
    return explain_end(setting.problem, options, setting.x, violations, residual_norm, stalled).status;
  }
  testing::Setting setting{{}, 1};
  Options options;
};

TEST_F(ExplainEnd, CallsAnAlmostFeasiblePointSolvedToReducedAccuracy) {
  EXPECT_EQ(status({5e-5, 5e-5, 5e-5}, 1e-4, true), Status::almost_solved);
  EXPECT_EQ(status({5e-5, 5e-5, 5e-5}, 1e-4, false), Status::almost_solved);
}

TEST_F(ExplainEnd, CallsAStalledViolationLocallyInfeasible) {
  EXPECT_EQ(status({0.0, 0.0, 0.1}, 1e-9, true), Status::locally_infeasible);
}

TEST_F(ExplainEnd, CallsEverythingElseAFailure) {
  EXPECT_EQ(status({0.0, 0.0, 0.1}, 1e-9, false), Status::numerical_failure);
  EXPECT_EQ(status({0.0, 0.0, 0.0}, 1.0, false), Status::numerical_failure)
      << "feasible, far from stationary";
}

TEST_F(ExplainEnd, NeverCallsANumberlessPointSolved) {
  EXPECT_FALSE(is_solved(status({kNan, 0.0, 0.0}, 1e-9, true)));
  EXPECT_FALSE(is_solved(status({0.0, 0.0, 0.0}, kNan, true)));
}

TEST_F(ExplainEnd, GivesTheNumbers) {
  const Ending ending = explain_end(setting.problem, options, setting.x, {0.125, 0.25, 0.5}, 0.75, true);
  for (const char* number : {"1.25e-01", "2.50e-01", "5.00e-01", "7.50e-01"})
    EXPECT_NE(ending.detail.find(number), std::string::npos) << ending.detail;
  EXPECT_TRUE(ending.certificate.empty());
}

}  // namespace
}  // namespace marble
