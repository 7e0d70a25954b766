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

}  // namespace
}  // namespace marble
