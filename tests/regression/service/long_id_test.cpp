// Symptom: a job id of 9 kB and more got RESOURCE_EXHAUSTED "received metadata size exceeds" and not
// NOT_FOUND: the error contained the whole id, and did not fit into the trailers.
#include "service_test.h"

namespace marble::testing {
namespace {

class LongId : public ServiceTest {};

TEST_F(LongId, IsReportedByItsBeginningAndItsLength) {
  start();
  const auto jobs = v1::Jobs::NewStub(channel());
  v1::GetJobRequest get;
  get.set_job_id(std::string(63, 'x') + "\u00e4" + std::string(100'000, 'x'));  // cut within a character
  v1::GetJobResponse job;
  grpc::ClientContext context;
  const grpc::Status status = jobs->Get(&context, get, &job);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::NOT_FOUND) << status.error_message();
  EXPECT_EQ(status.error_message(),
            "job_id = " + std::string(63, 'x') + "... (100065 bytes): is no job that is remembered");
  v1::ListJobsRequest list;
  list.set_before_job_id(std::string(100'000, 'y'));
  v1::ListJobsResponse page;
  grpc::ClientContext another;
  EXPECT_EQ(jobs->List(&another, list, &page).error_code(), grpc::StatusCode::NOT_FOUND);
}

}  // namespace
}  // namespace marble::testing
