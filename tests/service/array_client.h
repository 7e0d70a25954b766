// Arrays as calls.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "jobs_client.h"

namespace marble::testing {

/// Element `index` of the example with z1 = index.
[[nodiscard]] inline v1::ArrayElement numbered_element(std::int64_t index) {
  v1::ArrayElement element;
  *element.mutable_solve()->mutable_problem() = example_request().problem();
  element.mutable_solve()->mutable_problem()->set_equality_offset(0, -static_cast<double>(index));
  return element;
}

/// The same as new numbers for the example.
[[nodiscard]] inline v1::ArrayElement numbers_of_element(std::int64_t index) {
  v1::ArrayElement element;
  element.mutable_update()->add_equality_offset(-static_cast<double>(index));
  return element;
}

/// One that no test sees end.
[[nodiscard]] inline v1::ArrayElement long_element() {
  v1::ArrayElement element;
  *element.mutable_solve() = long_request();
  return element;
}

/// One SubmitArray call, message by message.
class ArraySubmission {
 public:
  explicit ArraySubmission(v1::Jobs::Stub& jobs) : writer_(jobs.SubmitArray(&context_, &response_)) {}
  ~ArraySubmission() {
    context_.TryCancel();
    (void)finish();
  }
  ArraySubmission(const ArraySubmission&) = delete;
  ArraySubmission& operator=(const ArraySubmission&) = delete;

  bool write(const v1::SubmitArrayRequest& request) { return writer_->Write(request); }
  bool setup(const v1::ArraySetup& setup) {
    v1::SubmitArrayRequest request;
    *request.mutable_setup() = setup;
    return write(request);
  }
  bool element(const v1::ArrayElement& element) {
    v1::SubmitArrayRequest request;
    *request.mutable_element() = element;
    return write(request);
  }
  bool end(std::int64_t elements) {
    v1::SubmitArrayRequest request;
    request.mutable_end()->set_elements(elements);
    return write(request);
  }
  grpc::Status finish() {
    if (!finished_) {
      writer_->WritesDone();
      status_ = writer_->Finish();
    }
    finished_ = true;
    return status_;
  }
  void cancel() { context_.TryCancel(); }
  [[nodiscard]] const v1::SubmitArrayResponse& response() const { return response_; }

 private:
  grpc::ClientContext context_;
  v1::SubmitArrayResponse response_;
  std::unique_ptr<grpc::ClientWriter<v1::SubmitArrayRequest>> writer_;
  grpc::Status status_;
  bool finished_ = false;
};

/// One ArrayResults call, answer by answer.
class ArrayReader {
 public:
  ArrayReader(v1::Jobs::Stub& jobs, const std::string& id, std::int64_t after = 0) {
    v1::ArrayResultsRequest request;
    request.set_job_id(id);
    request.set_after(after);
    reader_ = jobs.ArrayResults(&context_, request);
  }
  ~ArrayReader() {
    context_.TryCancel();
    (void)finish();
  }
  ArrayReader(const ArrayReader&) = delete;
  ArrayReader& operator=(const ArrayReader&) = delete;

  [[nodiscard]] std::optional<v1::ArrayResultsResponse> next() {
    v1::ArrayResultsResponse response;
    if (!reader_->Read(&response)) return std::nullopt;
    return response;
  }
  [[nodiscard]] std::vector<v1::ArrayResultsResponse> drain() {
    std::vector<v1::ArrayResultsResponse> all;
    while (auto response = next()) all.push_back(std::move(*response));
    return all;
  }
  grpc::Status finish() {
    if (!finished_) {
      while (next()) {
      }
      status_ = reader_->Finish();
    }
    finished_ = true;
    return status_;
  }

 private:
  grpc::ClientContext context_;
  std::unique_ptr<grpc::ClientReader<v1::ArrayResultsResponse>> reader_;
  grpc::Status status_;
  bool finished_ = false;
};

[[nodiscard]] inline grpc::Status submit_array(v1::Jobs::Stub& jobs, const v1::ArraySetup& setup,
                                               const std::vector<v1::ArrayElement>& elements,
                                               std::string* id) {
  ArraySubmission submission(jobs);
  bool going = submission.setup(setup);
  for (const v1::ArrayElement& element : elements) going = going && submission.element(element);
  if (going) (void)submission.end(static_cast<std::int64_t>(elements.size()));
  grpc::Status status = submission.finish();
  *id = submission.response().job_id();
  return status;
}
/// One that is accepted.
inline std::string submit_array(v1::Jobs::Stub& jobs, const std::vector<v1::ArrayElement>& elements,
                                const v1::ArraySetup& setup = {}) {
  std::string id;
  const grpc::Status status = submit_array(jobs, setup, elements, &id);
  EXPECT_TRUE(status.ok()) << status.error_message();
  return id;
}

/// `count` elements, made by their number.
[[nodiscard]] inline std::vector<v1::ArrayElement> elements_of(
    std::int64_t count, const std::function<v1::ArrayElement(std::int64_t)>& make = numbered_element) {
  std::vector<v1::ArrayElement> elements;
  for (std::int64_t index = 0; index < count; ++index) elements.push_back(make(index));
  return elements;
}

/// Each of `count` numbered elements has its answer once, under the numbers from `after` + 1.
inline void expect_numbered(const std::vector<v1::ArrayResultsResponse>& answers, std::int64_t count,
                            std::int64_t after = 0) {
  std::vector<int> times(static_cast<std::size_t>(count), 0);
  for (const v1::ArrayResultsResponse& answer : answers) {
    EXPECT_EQ(answer.sequence(), ++after);
    ASSERT_GE(answer.index(), 0);
    ASSERT_LT(answer.index(), count);
    ++times[static_cast<std::size_t>(answer.index())];
    ASSERT_TRUE(answer.has_result()) << answer.error().message();
    EXPECT_NEAR(answer.result().solution().z(0), static_cast<double>(answer.index()), 1e-6);
  }
  for (const int once : times) EXPECT_LE(once, 1);
  EXPECT_EQ(after, count);
}

/// Of `count` elements one stopped its server twice and was set aside; all others have their results.
inline void expect_set_aside(v1::Jobs::Stub& jobs, const std::string& id, std::int64_t element,
                             std::int64_t count) {
  ArrayReader reader(jobs, id);
  std::int64_t answered = 0;
  for (const v1::ArrayResultsResponse& answer : reader.drain()) {
    if (answer.index() != element) {
      ++answered;
      EXPECT_TRUE(answer.has_result()) << answer.error().message();
    } else {
      EXPECT_EQ(answer.error().code(), static_cast<int>(grpc::StatusCode::INTERNAL));
      EXPECT_NE(answer.error().message().find("the server stopped twice while it ran this job"),
                std::string::npos)
          << answer.error().message();
    }
  }
  EXPECT_EQ(answered, count - 1);
  EXPECT_TRUE(reader.finish().ok());
}

}  // namespace marble::testing
