// The macros that pass errors on: what they evaluate, what they return, and that they move.
#include "marble/error.h"

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

namespace marble {
namespace {

Error refused() { return invalid("A", 3, "nan", "must be finite"); }

Expected<std::unique_ptr<int>> number_or_error(bool fails, int& calls) {
  ++calls;
  if (fails) return unexpected(refused());
  return std::make_unique<int>(7);
}

TEST(ReturnIfError, ReturnsTheErrorWithAllItsFieldsAndOtherwiseGoesOn) {
  int calls = 0;
  bool went_on = false;
  const auto work = [&](bool fails) -> Expected<std::string> {
    MARBLE_RETURN_IF_ERROR(number_or_error(fails, calls));
    went_on = true;
    return "done";
  };
  const auto failed = work(true);
  ASSERT_FALSE(failed);
  EXPECT_EQ(failed.error().message(), refused().message());
  EXPECT_EQ(failed.error().code, ErrorCode::invalid_argument);
  EXPECT_FALSE(went_on);
  EXPECT_EQ(calls, 1);
  EXPECT_EQ(work(false), std::string("done"));
  EXPECT_TRUE(went_on);
  EXPECT_EQ(calls, 2);
}

TEST(ReturnIfError, IsOneStatement) {
  const auto work = [](bool first, bool asks) -> Expected<int> {
    if (asks)
      MARBLE_RETURN_IF_ERROR(first ? Expected<void>{} : unexpected(refused()));
    else
      return 1;
    return 2;
  };
  EXPECT_EQ(work(false, false), 1);
  EXPECT_EQ(work(true, true), 2);
  EXPECT_FALSE(work(false, true));
}

TEST(ReturnIfError, LeavesTheErrorOfAVariable) {
  const Expected<void> kept = unexpected(refused());
  const auto work = [&]() -> Expected<void> {
    MARBLE_RETURN_IF_ERROR(kept);
    return {};
  };
  EXPECT_EQ(work().error().field, "A");
  EXPECT_EQ(kept.error().field, "A");
}

TEST(AssignOrReturn, MovesTheValueOfATemporary) {
  int calls = 0;
  const auto work = [&](bool fails) -> Expected<int> {
    MARBLE_ASSIGN_OR_RETURN(const auto number, number_or_error(fails, calls));
    return *number;
  };
  EXPECT_EQ(work(false), 7);
  const auto failed = work(true);
  ASSERT_FALSE(failed);
  EXPECT_EQ(failed.error().message(), refused().message());
  EXPECT_EQ(calls, 2);
}

TEST(AssignOrReturn, AssignsOnlyAValueToWhatIsThere) {
  int calls = 0;
  std::vector<std::unique_ptr<int>> numbers(1);
  const auto work = [&](bool fails) -> Expected<void> {
    MARBLE_ASSIGN_OR_RETURN(numbers[0], number_or_error(fails, calls));
    return {};
  };
  EXPECT_FALSE(work(true));
  EXPECT_EQ(numbers[0], nullptr);
  EXPECT_TRUE(work(false));
  ASSERT_NE(numbers[0], nullptr);
  EXPECT_EQ(*numbers[0], 7);
  EXPECT_FALSE(work(true));
  EXPECT_EQ(*numbers[0], 7);
}

TEST(AssignOrReturn, CopiesTheValueOfAVariableUnlessItIsMoved) {
  Expected<std::string> kept = std::string(100, 'x');
  const auto copy = [&]() -> Expected<std::string> {
    MARBLE_ASSIGN_OR_RETURN(auto text, kept);
    return text;
  };
  const auto move = [&]() -> Expected<std::string> {
    MARBLE_ASSIGN_OR_RETURN(auto text, std::move(kept));
    return text;
  };
  const char* const place = kept->data();
  EXPECT_EQ(copy(), std::string(100, 'x'));
  EXPECT_EQ(kept, std::string(100, 'x'));
  const auto moved = move();
  EXPECT_EQ(moved->data(), place);
}

TEST(AssignOrReturn, TakesExpressionsWithCommas) {
  const auto work = []() -> Expected<std::size_t> {
    MARBLE_ASSIGN_OR_RETURN(const auto pair, Expected<std::vector<int>>(std::vector<int>{4, 5}));
    MARBLE_ASSIGN_OR_RETURN(const auto& text, Expected<std::string>("text"));
    return pair.size() + text.size();
  };
  EXPECT_EQ(work(), 6u);
}

}  // namespace
}  // namespace marble
