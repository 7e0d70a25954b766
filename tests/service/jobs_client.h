// Jobs' methods as calls.
#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "service_test.h"

namespace marble::testing {

class JobsClient {
 public:
  JobsClient() = default;
  explicit JobsClient(const std::shared_ptr<grpc::Channel>& channel) : jobs_(v1::Jobs::NewStub(channel)) {}
  [[nodiscard]] v1::Jobs::Stub& jobs() { return *jobs_; }

  grpc::Status submit(const v1::SolveRequest& request, std::string* id) {
    grpc::ClientContext context;
    v1::SubmitResponse response;
    grpc::Status status = jobs_->Submit(&context, request, &response);
    *id = response.job_id();
    return status;
  }
  /// One that is accepted.
  std::string submit(const v1::SolveRequest& request) {
    std::string id;
    const grpc::Status status = submit(request, &id);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return id;
  }
  grpc::Status result(const std::string& id, bool wait, v1::SolveResponse* response,
                      std::optional<std::chrono::milliseconds> deadline = std::nullopt) {
    grpc::ClientContext context;
    if (deadline) context.set_deadline(std::chrono::system_clock::now() + *deadline);
    v1::JobResultRequest request;
    request.set_job_id(id);
    request.set_wait(wait);
    return jobs_->Result(&context, request, response);
  }
  grpc::Status remove(const std::string& id) {
    grpc::ClientContext context;
    v1::DeleteJobRequest request;
    request.set_job_id(id);
    v1::DeleteJobResponse response;
    return jobs_->Delete(&context, request, &response);
  }
  grpc::Status cancel(const std::string& id, v1::CancelJobResponse* response) {
    grpc::ClientContext context;
    v1::CancelJobRequest request;
    request.set_job_id(id);
    return jobs_->Cancel(&context, request, response);
  }
  grpc::Status cancel(const std::string& id) {
    v1::CancelJobResponse response;
    return cancel(id, &response);
  }
  v1::GetJobResponse get(const std::string& id, grpc::StatusCode expected = grpc::StatusCode::OK) {
    grpc::ClientContext context;
    v1::GetJobRequest request;
    request.set_job_id(id);
    v1::GetJobResponse response;
    const grpc::Status status = jobs_->Get(&context, request, &response);
    EXPECT_EQ(status.error_code(), expected) << status.error_message();
    return response;
  }
  /// Reads a job's bundle to its end; its first message are the facts.
  grpc::Status bundle(const std::string& id, v1::JobBundle* facts = nullptr) {
    grpc::ClientContext context;
    v1::JobBundleRequest request;
    request.set_job_id(id);
    const auto reader = jobs_->Bundle(&context, request);
    v1::JobBundleResponse piece;
    while (reader->Read(&piece)) {
      if (piece.has_bundle() && facts != nullptr) *facts = piece.bundle();
    }
    return reader->Finish();
  }

 private:
  std::unique_ptr<v1::Jobs::Stub> jobs_;
};

// What tests of jobs share: Jobs' methods as calls, on a server of the test's own.
class JobsServiceTest : public ServiceTest, protected JobsClient {
 protected:
  void start(const std::vector<std::string>& flags = {}) {
    ServiceTest::start(flags);
    static_cast<JobsClient&>(*this) = JobsClient(channel());
  }
};

}  // namespace marble::testing
