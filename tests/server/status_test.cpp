#include "base/status.h"

#include <gtest/gtest.h>

#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "marble/v1/fault.pb.h"

namespace marble::server {
namespace {

google::rpc::Status details_of(const grpc::Status& status) {
  google::rpc::Status details;
  EXPECT_TRUE(details.ParseFromString(status.error_details()));
  return details;
}

TEST(ErrorStatus, ABadFieldComesWithPathIndexValueAndRule) {
  const Error error{ErrorCode::invalid_argument, "problem.gradient", 3, "nan", "must be finite"};
  const grpc::Status status = to_status(error);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(status.error_message(), error.message());
  const google::rpc::Status details = details_of(status);
  EXPECT_EQ(details.code(), static_cast<int>(grpc::StatusCode::INVALID_ARGUMENT));
  ASSERT_EQ(details.details_size(), 2);
  EXPECT_EQ(details.details(0).type_url(), "type.googleapis.com/google.rpc.BadRequest");
  google::rpc::BadRequest bad_request;
  ASSERT_TRUE(details.details(0).UnpackTo(&bad_request));
  EXPECT_EQ(bad_request.field_violations(0).field(), "problem.gradient[3]");
  EXPECT_EQ(bad_request.field_violations(0).description(), "is nan, must be finite");
  v1::Fault fault;
  ASSERT_TRUE(details.details(1).UnpackTo(&fault));
  EXPECT_EQ(fault.field(), "problem.gradient");
  EXPECT_EQ(fault.index(), 3);
  EXPECT_EQ(fault.value(), "nan");
  EXPECT_EQ(fault.bound(), "must be finite");
}

TEST(ErrorStatus, AFullQueueReportsWhenToRetry) {
  const grpc::Status status = to_status({ErrorCode::resource_exhausted, "queue_jobs", -1, "", "full"}, 2.25);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  google::rpc::RetryInfo retry;
  const google::rpc::Status details = details_of(status);
  ASSERT_EQ(details.details_size(), 2);
  v1::Fault fault;
  ASSERT_TRUE(details.details(0).UnpackTo(&fault));
  EXPECT_EQ(fault.field(), "queue_jobs");
  EXPECT_FALSE(fault.has_index());
  ASSERT_TRUE(details.details(1).UnpackTo(&retry));
  EXPECT_EQ(retry.retry_delay().seconds(), 2);
  EXPECT_EQ(retry.retry_delay().nanos(), 250'000'000);
}

TEST(ErrorStatus, EveryCodeHasItsOwnStatus) {
  std::vector<grpc::StatusCode> seen;
  for (int i = 0; i <= static_cast<int>(ErrorCode::internal); ++i) {
    const grpc::StatusCode code = to_status({static_cast<ErrorCode>(i), "", -1, "", ""}).error_code();
    EXPECT_NE(code, grpc::StatusCode::OK);
    EXPECT_NE(code, grpc::StatusCode::UNKNOWN);
    EXPECT_EQ(std::count(seen.begin(), seen.end(), code), 0);
    seen.push_back(code);
  }
}

}  // namespace
}  // namespace marble::server
