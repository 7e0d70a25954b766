// A server that keeps its jobs, as its clients see it, and jobs whose answers are known.
#pragma once

#include <httplib.h>

#include <cstdlib>
#include <memory>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "jobs_client.h"

namespace marble::testing {

class Node : public JobsClient {
 public:
  explicit Node(const std::vector<std::string>& flags) : process_(MARBLE_SERVER_BINARY, flags) {
    channel_ = connect(process_.address());
    static_cast<JobsClient&>(*this) = JobsClient(channel_);
    solver_ = v1::Solver::NewStub(channel_);
  }

  [[nodiscard]] ServerProcess& server() { return process_; }
  [[nodiscard]] bool solves() {
    grpc::ClientContext context;
    v1::SolveResponse response;
    return solver_->Solve(&context, example_request(), &response).ok() &&
           response.solution().status() == v1::STATUS_SOLVED;
  }
  [[nodiscard]] v1::Counters counters() {
    grpc::ClientContext context;
    v1::GetInfoResponse info;
    EXPECT_TRUE(v1::Server::NewStub(channel_)->GetInfo(&context, {}, &info).ok());
    return info.counters();
  }
  [[nodiscard]] v1::JobInfo job(const std::string& id) { return get(id).job(); }
  [[nodiscard]] std::set<std::string> list() {
    grpc::ClientContext context;
    v1::ListJobsResponse response;
    EXPECT_TRUE(jobs().List(&context, {}, &response).ok());
    std::set<std::string> ids;
    for (const v1::JobInfo& one : response.jobs()) ids.insert(one.job_id());
    return ids;
  }
  [[nodiscard]] std::string ready() {
    const auto answer = httplib::Client(process_.http()).Get("/readyz");
    return answer ? std::to_string(answer->status) + " " + answer->body : "";
  }
  void kill() {
    process_.send(SIGKILL);
    process_.wait();
  }
  void stop() {
    process_.terminate();
    EXPECT_EQ(process_.wait(), 0);
  }

 private:
  ServerProcess process_;
  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<v1::Solver::Stub> solver_;
};

/// A server that passes `fault` with MARBLE_FAULT_POINT; null if it ended before it answered.
[[nodiscard]] inline std::unique_ptr<Node> faulty_node(const std::vector<std::string>& flags,
                                                       const std::string& fault) {
  setenv("MARBLE_FAULT_POINT", fault.c_str(), 1);
  std::unique_ptr<Node> node;
  try {
    node = std::make_unique<Node>(flags);
  } catch (const std::runtime_error&) {  // a worker may be faster than the listener
  }
  unsetenv("MARBLE_FAULT_POINT");
  return node;
}

inline v1::SolveRequest numbered(int number, const std::string& prefix = "r") {
  v1::SolveRequest request = example_request();
  request.mutable_problem()->set_constant(number);
  request.set_request_id(prefix + std::to_string(number));
  return request;
}

// The optimum of example_request() is 3, by the independent reckoning of problems.h.
inline void expect_answer(Node& node, const std::string& id, int number) {
  v1::SolveResponse response;
  const grpc::Status status = node.result(id, true, &response);
  ASSERT_TRUE(status.ok()) << id << ": " << status.error_message();
  EXPECT_EQ(response.job_id(), id);
  EXPECT_EQ(response.solution().status(), v1::STATUS_SOLVED);
  EXPECT_NEAR(response.solution().objective(), 3.0 + number, 1e-9);
}

}  // namespace marble::testing
