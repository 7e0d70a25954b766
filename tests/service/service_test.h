// What end-to-end tests share: a real server process, stubs, and streams that are read event by event.
#pragma once

#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "google/rpc/error_details.pb.h"
#include "marble/v1/service.grpc.pb.h"
#include "problems.h"
#include "support/server_process.h"

namespace marble::testing {

using Event = v1::SolveStreamResponse;

/// Channel of its own to `address`, with messages of any size.
[[nodiscard]] std::shared_ptr<grpc::Channel> connect(const std::string& address);

/// Sends `bytes` to a method, with the token if there is one, and returns the status with the first message
/// that came back.
struct RawAnswer {
  grpc::Status status;
  std::string bytes;
};
[[nodiscard]] RawAnswer raw_call(const std::shared_ptr<grpc::Channel>& channel, const std::string& method,
                                 const std::string& bytes, const std::string& token = "");

/// The first BadRequest violation in the status' details; fields empty if there is none.
[[nodiscard]] google::rpc::BadRequest::FieldViolation bad_field(const grpc::Status& status);
/// The RetryInfo in the status' details.
[[nodiscard]] std::optional<google::rpc::RetryInfo> retry_info(const grpc::Status& status);

/// One SolveStream call. Reading is up to the test: a stream that is not read is a stalled reader.
class Stream {
 public:
  Stream(v1::Solver::Stub& stub, const v1::SolveRequest& request,
         std::optional<std::chrono::milliseconds> deadline = std::nullopt);
  Stream(v1::Solver::Stub& stub, const v1::SolveStreamRequest& request);
  ~Stream();

  /// The next event, or nothing at the stream's end.
  [[nodiscard]] std::optional<Event> next();
  /// Reads on to the first event of this kind; false if the stream ended before.
  bool read_until(Event::EventCase kind);
  /// Reads to the end and returns every event.
  [[nodiscard]] std::vector<Event> drain();
  /// The status, after the end.
  grpc::Status finish();
  void cancel() { context_.TryCancel(); }

 private:
  grpc::ClientContext context_;
  std::unique_ptr<grpc::ClientReader<Event>> reader_;
  bool finished_ = false;
};

class ServiceTest : public ::testing::Test {
 protected:
  /// Starts the server. Tests say only what matters to them; everything else has its default.
  void start(const std::vector<std::string>& flags = {});
  /// Whatever the test did to it, the server stops when asked to and exits with 0.
  void TearDown() override;

  /// One unary solve.
  grpc::Status solve(const v1::SolveRequest& request, v1::SolveResponse* response,
                     std::optional<std::chrono::milliseconds> deadline = std::nullopt);
  /// Whether the server still solves a small problem.
  [[nodiscard]] bool lives();
  [[nodiscard]] v1::Counters counters();
  [[nodiscard]] bool eventually_idle();
  /// "SERVING" or "NOT_SERVING", from grpc.health.v1; else the status' message.
  [[nodiscard]] std::string health();

  [[nodiscard]] ServerProcess& server() { return *server_; }
  [[nodiscard]] v1::Solver::Stub& solver() { return *solver_; }
  [[nodiscard]] const std::shared_ptr<grpc::Channel>& channel() { return channel_; }

 private:
  std::unique_ptr<ServerProcess> server_;
  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<v1::Solver::Stub> solver_;
  std::unique_ptr<v1::Server::Stub> info_;
};

}  // namespace marble::testing
