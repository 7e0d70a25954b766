#include "marble/error.h"

#include <gtest/gtest.h>

#include <set>
#include <string>

namespace marble {
namespace {

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

}  // namespace
}  // namespace marble
