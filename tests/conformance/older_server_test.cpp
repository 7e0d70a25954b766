// What a client makes of errors that come without the Fault of today's servers: from an older one, or from a
// proxy.
#include <grpcpp/server_builder.h>
#include <gtest/gtest.h>

#include <atomic>

#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "marble/client.h"
#include "marble/v1/fault.pb.h"
#include "marble/v1/service.grpc.pb.h"
#include "support/small_problems.h"

namespace marble::testing {
namespace {

/// Refuses every solve with the same status.
class Refusing final : public v1::Solver::Service {
 public:
  explicit Refusing(grpc::Status status) : status_(std::move(status)) {
    grpc::ServerBuilder builder;
    builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port_);
    builder.RegisterService(this);
    server_ = builder.BuildAndStart();
  }
  /// What the client says of it.
  [[nodiscard]] Error error() const {
    const auto client = Client::connect("127.0.0.1:" + std::to_string(port_));
    return client->solve(public_example().problem.view()).error();
  }

 private:
  grpc::Status Solve(grpc::ServerContext*, const v1::SolveRequest*, v1::SolveResponse*) override {
    return status_;
  }

  grpc::Status status_;
  int port_ = 0;
  std::unique_ptr<grpc::Server> server_;
};

template <class... Details>
Error refused(grpc::StatusCode code, const Details&... details) {
  google::rpc::Status status;
  (status.add_details()->PackFrom(details), ...);
  return Refusing({code, "in words", status.SerializeAsString()}).error();
}

google::rpc::BadRequest bad_request(const std::string& path) {
  google::rpc::BadRequest message;
  auto* violation = message.add_field_violations();
  violation->set_field(path);
  violation->set_description("is nan, must be finite");
  return message;
}

TEST(OlderServer, AnErrorHasItsPlaceInTheCallersTermsAndTheServersWords) {
  struct Place {
    std::string path, field;
    std::int64_t index;
  };
  for (const auto& [path, field, index] :
       {Place{"problem.gradient[3]", "g", 3}, Place{"solve.problem.equality_matrix.values[7]", "A.values", 7},
        Place{"update.problem.hessian_values[2]", "Q.values", 2},
        Place{"setup.options.max_iterations", "max_iterations", -1},
        Place{"initial_point.z[1]", "initial_z", 1},
        Place{"warm_start.complementarity_multipliers_l[5]", "warm_start.complementarity_multipliers_L", 5},
        Place{"update.shift.pairs[2].by", "shift.pairs[2].by", -1}}) {
    const Error error = refused(grpc::StatusCode::INVALID_ARGUMENT, bad_request(path));
    EXPECT_EQ(error.code, ErrorCode::invalid_argument) << path;
    EXPECT_EQ(error.field, field) << path;
    EXPECT_EQ(error.index, index) << path;
    EXPECT_EQ(error.value, "") << path;
    EXPECT_EQ(error.bound, "is nan, must be finite") << path;
  }
}

TEST(OlderServer, OfOneThatSendsBothTheStructuredOneIsTaken) {
  v1::Fault fault;
  fault.set_field("problem.gradient");
  fault.set_index(3);
  fault.set_value("is this, or that");
  fault.set_bound("must be, well, finite");
  for (const Error& error :
       {refused(grpc::StatusCode::INVALID_ARGUMENT, bad_request("problem.gradient[3]"), fault),
        refused(grpc::StatusCode::INVALID_ARGUMENT, fault, bad_request("b[1]"))}) {
    EXPECT_EQ(error.field, "g");
    EXPECT_EQ(error.index, 3);
    EXPECT_EQ(error.value, "is this, or that");
    EXPECT_EQ(error.bound, "must be, well, finite");
  }
}

TEST(OlderServer, AnErrorWithoutDetailsHasItsCodeAndItsWords) {
  google::rpc::RetryInfo retry;
  for (const Error& error :
       {refused(grpc::StatusCode::RESOURCE_EXHAUSTED), refused(grpc::StatusCode::RESOURCE_EXHAUSTED, retry),
        Refusing({grpc::StatusCode::RESOURCE_EXHAUSTED, "in words", "no message"}).error()}) {
    EXPECT_EQ(error.code, ErrorCode::resource_exhausted);
    EXPECT_EQ(error.field, "");
    EXPECT_EQ(error.index, -1);
    EXPECT_EQ(error.bound, "in words");
  }
}

/// Answers every update with its number as z, a first part too, as one that has never heard of parts. Of
/// those it refuses, it says so.
class Answering final : public v1::Solver::Service {
 public:
  Answering() {
    grpc::ServerBuilder builder;
    builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port_);
    builder.RegisterService(this);
    server_ = builder.BuildAndStart();
  }
  [[nodiscard]] std::string address() const { return "127.0.0.1:" + std::to_string(port_); }
  std::atomic<std::int64_t> refuses = 0;

 private:
  grpc::Status Session(grpc::ServerContext*,
                       grpc::ServerReaderWriter<v1::SessionResponse, v1::SessionRequest>* stream) override {
    v1::SessionRequest request;
    while (stream->Read(&request)) {
      v1::SessionResponse response;
      const std::int64_t number = request.update().sequence();
      if (request.has_setup()) {
        response.mutable_ready();
      } else if (number == refuses) {
        response.mutable_error()->set_sequence(number);
        response.mutable_error()->mutable_status()->set_code(grpc::StatusCode::RESOURCE_EXHAUSTED);
      } else {
        v1::SessionAnswer* answer = response.mutable_answer();
        answer->set_sequence(number);
        answer->mutable_solution()->set_status(v1::STATUS_SOLVED);
        answer->mutable_solution()->add_z(static_cast<double>(number));
      }
      stream->Write(response);
    }
    return grpc::Status::OK;
  }

  int port_ = 0;
  std::unique_ptr<grpc::Server> server_;
};

TEST(OlderServer, WhatItAnswersToAFirstPartIsLetGo) {
  Answering server;
  const auto client = Client::connect(server.address());
  auto session = client->open_session(public_example().problem.view());
  ASSERT_TRUE(session.has_value()) << session.error().message();
  for (int tick = 0; tick < 3; ++tick) {
    const auto part = session->prepare({});
    ASSERT_TRUE(part.has_value()) << part.error().message();
    const auto answer = session->solve();
    ASSERT_TRUE(answer.has_value()) << answer.error().message();
    EXPECT_EQ(answer->z, std::vector<double>{static_cast<double>(*part + 1)});
  }
  EXPECT_TRUE(session->close().has_value());
  EXPECT_FALSE(session->next()->has_value());
}

TEST(OlderServer, AFirstPartThatItRefusesIsTheErrorOfTheSecond) {
  Answering server;
  const auto client = Client::connect(server.address());
  auto session = client->open_session(public_example().problem.view());
  ASSERT_TRUE(session.has_value());
  server.refuses = 1;
  ASSERT_TRUE(session->prepare({}).has_value());
  const auto refused = session->solve();
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().code, ErrorCode::resource_exhausted);
  EXPECT_TRUE(session->solve().has_value());
}

}  // namespace
}  // namespace marble::testing
