// A client that listed jobs "before" another client's job learned whether it exists: an empty page if it did,
// NOT_FOUND if it did not. The page was cut at any job of the board, whichever client's it was.
#include <gtest/gtest.h>

#include "service/job_requests.h"

namespace marble::server {
namespace {

TEST(JobIds, AnothersJobIsAnsweredLikeNoneWhenItIsThePagesEnd) {
  JobBoard board({});
  board.add(board.make({.id = "hers", .client = "alice"}, {}));
  board.add(board.make({.id = "his", .client = "bob"}, {}));
  const Identity bob{"bob", {Role::solve}};
  const auto list = [&](const std::string& before) {
    v1::ListJobsRequest request;
    request.set_before_job_id(before);
    v1::ListJobsResponse response;
    return list_jobs(board, bob, request, &response);
  };
  EXPECT_TRUE(list("his").has_value());
  ASSERT_FALSE(list("hers").has_value());
  const Error foreign = list("hers").error(), unknown = list("none").error();
  EXPECT_EQ(foreign.code, unknown.code);
  EXPECT_EQ(foreign.field, unknown.field);
  EXPECT_EQ(foreign.bound, unknown.bound);
  EXPECT_EQ(foreign.value, "hers");
}

}  // namespace
}  // namespace marble::server
