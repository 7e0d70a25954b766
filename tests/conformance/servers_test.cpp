#include <grpcpp/server_builder.h>
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <memory>

#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "marble/client.h"
#include "marble/convert.h"
#include "marble/examples.h"
#include "marble/solver.h"
#include "marble/v1/fault.pb.h"
#include "marble/v1/service.grpc.pb.h"
#include "problems.h"
#include "support/server_process.h"
#include "support/small_problems.h"

namespace marble::testing {
namespace {

// Several servers behind one address: calls take turns, and what is safe to repeat is repeated elsewhere.
class Several : public ::testing::Test {
 protected:
  static constexpr int kServers = 3;

  void SetUp() override {
    for (int i = 0; i < kServers; ++i) {
      servers_.push_back(std::make_unique<ServerProcess>(
          MARBLE_SERVER_BINARY, std::vector<std::string>{"--drain-grace-s", "3600"}));
      address_ += (i == 0 ? "" : ",") + servers_.back()->address();
      single_.push_back(Client::connect(servers_.back()->address()).value());
    }
  }

  [[nodiscard]] ServerInfo info(int server) const { return single_.at(server).info().value(); }

  // Calls until each has answered one: the channel connects to all of them before that.
  [[nodiscard]] bool all_take_turns(const Client& client) const {
    return eventually([&] {
      if (!client.solve(problem_.view()).has_value()) return false;
      for (int i = 0; i < kServers; ++i) {
        if (info(i).answered == 0) return false;
      }
      return true;
    });
  }

  [[nodiscard]] int server_of_the_session() const {
    for (int i = 0; i < kServers; ++i) {
      if (servers_[i]->running() && info(i).sessions == 1) return i;
    }
    return -1;
  }

  const OwnedProblem problem_ = examples::hopper({.steps = 12});
  std::vector<std::unique_ptr<ServerProcess>> servers_;
  std::vector<Client> single_;
  std::string address_;
};

TEST_F(Several, CallsGoRound) {
  const Client client = Client::connect(address_).value();
  ASSERT_TRUE(all_take_turns(client));
  std::array<std::int64_t, kServers> before = {};
  for (int i = 0; i < kServers; ++i) before[i] = info(i).answered;
  for (int i = 0; i < 4 * kServers; ++i) ASSERT_TRUE(client.solve(problem_.view()).has_value());
  for (int i = 0; i < kServers; ++i) EXPECT_GE(info(i).answered, before[i] + 3) << "server " << i;
}

TEST_F(Several, AfterAKillEveryCallIsAnsweredByTheOthers) {
  const Client client = Client::connect(address_).value();
  ASSERT_TRUE(all_take_turns(client));
  servers_[0]->send(SIGKILL);
  for (int i = 0; i < 20; ++i) {
    const auto answer = client.solve(problem_.view());
    EXPECT_TRUE(answer.has_value()) << answer.error().message();
  }
}

TEST_F(Several, WhatAKilledServerHadUnderWayIsAnsweredByTheOthers) {
  const Client client = Client::connect(address_).value();
  ASSERT_TRUE(all_take_turns(client));
  const v1::SolveRequest request = long_request(200);
  Options options = options_of(request.options()).value();
  std::vector<PendingSolution> pending;
  for (int i = 0; i < 2 * kServers; ++i)
    pending.push_back(client.solve_async(view_of(request.problem()), options).value());
  ASSERT_TRUE(eventually([&] { return info(0).running > 0; }));
  servers_[0]->send(SIGKILL);
  for (PendingSolution& one : pending) {
    const auto answer = one.get();
    ASSERT_TRUE(answer.has_value()) << answer.error().message();
    EXPECT_EQ(answer->status, Status::iteration_limit);
  }
}

TEST_F(Several, WhatWasReportedOfAlreadyIsNotRepeated) {
  const Client client = Client::connect(address_).value();
  const v1::SolveRequest request = long_request();
  int accepted = 0;
  const CallControls call = {.accepted = [&](const std::string&, int, double) { ++accepted; },
                             .started =
                                 [&](double) {
                                   for (int i = 0; i < kServers; ++i) {
                                     if (info(i).running > 0) servers_[i]->send(SIGKILL);
                                   }
                                 }};
  const auto answer =
      client.solve(view_of(request.problem()), options_of(request.options()).value(), {}, call);
  ASSERT_FALSE(answer.has_value());
  EXPECT_EQ(answer.error().code, ErrorCode::unavailable) << answer.error().message();
  EXPECT_EQ(accepted, 1);
}

TEST_F(Several, AServerThatDrainsGetsNoNewCalls) {
  const Client client = Client::connect(address_).value();
  ASSERT_TRUE(all_take_turns(client));
  const v1::SolveRequest request = long_request();  // keeps the first server from ending
  auto last =
      single_[0].solve_async(view_of(request.problem()), options_of(request.options()).value()).value();
  ASSERT_TRUE(eventually([&] { return info(0).running == 1; }));
  servers_[0]->terminate();
  ASSERT_TRUE(eventually([&] { return single_[0].healthy() == false; }));
  const auto others = [&] { return info(1).answered + info(2).answered; };
  const std::int64_t before = others();
  for (int i = 0; i < 12; ++i) {
    const auto answer = client.solve(problem_.view());
    EXPECT_TRUE(answer.has_value()) << answer.error().message();
  }
  EXPECT_EQ(others(), before + 12);
  EXPECT_TRUE(servers_[0]->running());
  last.cancel();
  EXPECT_EQ(servers_[0]->wait(), 0);
}

TEST_F(Several, ASessionWhoseServerDiesSaysSo) {
  const Client client = Client::connect(address_).value();
  auto session = client.open_session(problem_.view()).value();
  ASSERT_TRUE(session.solve().has_value());
  servers_.at(server_of_the_session())->send(SIGKILL);
  const auto answer = session.solve();
  ASSERT_FALSE(answer.has_value());
  EXPECT_EQ(answer.error().code, ErrorCode::unavailable);
  EXPECT_FALSE(session.is_open());
  auto another = client.open_session(problem_.view());
  ASSERT_TRUE(another.has_value()) << another.error().message();
  EXPECT_TRUE(another->solve().has_value());
}

TEST_F(Several, ASessionReopensElsewhereWithAllThatChangedAndSaysSo) {
  examples::HopperParameters parameters{.steps = 12};
  const Client client = Client::connect(address_).value();
  auto session = client.open_session(problem_.view(), {}, {.reopen = true}).value();
  const auto first = session.solve().value();
  EXPECT_FALSE(first.reopened);
  parameters = examples::advance(parameters, first.z);
  const OwnedProblem moved = examples::hopper(parameters);
  const auto second = session.solve({.g = moved.g, .b = moved.b}).value();
  const std::string job_id = session.job_id();
  servers_.at(server_of_the_session())->send(SIGKILL);

  OwnedProblem expected = moved;
  expected.c0 = 7.0;
  const auto third = session.solve({.c0 = 7.0});
  ASSERT_TRUE(third.has_value()) << third.error().message();
  EXPECT_TRUE(third->reopened);
  EXPECT_NE(session.job_id(), job_id);
  EXPECT_EQ(third->job_id, session.job_id());
  const Solution here = solve_in_process(expected.view(), {}, {.initial_z = second.z}).value();
  EXPECT_EQ(third->z, here.z);
  EXPECT_EQ(third->objective, here.objective);
  const auto fourth = session.solve();
  ASSERT_TRUE(fourth.has_value());
  EXPECT_FALSE(fourth->reopened);
  EXPECT_TRUE(session.close().has_value());
}

TEST_F(Several, ASessionLeavesAServerThatDrains) {
  const Client client = Client::connect(address_).value();
  auto session = client.open_session(problem_.view(), {}, {.reopen = true}).value();
  ASSERT_TRUE(session.solve().has_value());
  const int server = server_of_the_session();
  servers_.at(server)->terminate();
  EXPECT_EQ(servers_.at(server)->wait(), 0);
  const auto answer = session.solve();
  ASSERT_TRUE(answer.has_value()) << answer.error().message();
  EXPECT_TRUE(answer->reopened);
}

TEST_F(Several, ReopeningKeepsQSymmetricWhoseLowerTriangleIsNotRead) {
  OwnedProblem problem;
  problem.g = {1.0, -1.0};
  problem.Q = {2, 2, {0, 2, 4}, {0, 1, 0, 1}, {2.0, 0.5, 0.5, 2.0}};
  const Client client = Client::connect(address_).value();
  auto session = client.open_session(problem.view(), {}, {.reopen = true}).value();
  const std::vector<double> newer = {3.0, 99.0, 1.0, 3.0};
  ASSERT_TRUE(session.solve({.Q = newer}).has_value());
  servers_.at(server_of_the_session())->send(SIGKILL);
  const auto answer = session.solve();
  ASSERT_TRUE(answer.has_value()) << answer.error().message();
  EXPECT_TRUE(answer->reopened);
  EXPECT_NEAR(answer->z[0], -0.5, 1e-6);
  EXPECT_NEAR(answer->z[1], 0.5, 1e-6);
}

TEST_F(Several, ASessionThatFindsNoServerEndsWithTheReason) {
  const Client client = Client::connect(address_).value();
  auto session = client.open_session(problem_.view(), {}, {.reopen = true}).value();
  EXPECT_EQ(session.send().error().code, ErrorCode::failed_precondition);
  ASSERT_TRUE(session.solve().has_value());
  for (const auto& server : servers_) server->send(SIGKILL);
  EXPECT_EQ(session.solve().error().code, ErrorCode::unavailable);
  EXPECT_FALSE(session.is_open());
  EXPECT_EQ(session.solve().error().code, ErrorCode::unavailable);
}

TEST_F(Several, WithoutASharedStoreAJobIsKnownToItsServerOnly) {
  const auto submitted = Client::connect(address_)->jobs().submit(problem_.view());
  ASSERT_TRUE(submitted.has_value()) << submitted.error().message();
  int know = 0;
  for (const Client& one : single_) {
    const auto details = one.jobs().get(submitted->job_id);
    if (details) {
      ++know;
    } else {
      EXPECT_EQ(details.error().code, ErrorCode::not_found) << details.error().message();
    }
  }
  EXPECT_EQ(know, 1);
}

TEST(Addresses, ThatAreNoneAreRefusedByName) {
  EXPECT_EQ(Client::connect("127.0.0.1:1,nowhere").error().value, "\"nowhere\"");
  EXPECT_EQ(Client::connect("127.0.0.1:1,unix:/tmp/x").error().field, "address");
  EXPECT_EQ(Client::connect("127.0.0.1:1,").error().field, "address");
  EXPECT_EQ(Client::connect("dns:///nowhere").error().field, "address");
  EXPECT_EQ(Client::connect("127.0.0.1:1,[::1]:2").error().value, "\"[::1]:2\"");
  EXPECT_EQ(Client::connect("127.0.0.1:1,no-such-host.invalid:2").error().code, ErrorCode::unavailable);
  EXPECT_TRUE(Client::connect("unix:/tmp/with,comma").has_value());
}

TEST(Addresses, MayBeNamesAlsoThroughTheNameService) {
  const ServerProcess server(MARBLE_SERVER_BINARY);
  const std::string port = server.address().substr(server.address().rfind(':'));
  for (const std::string& address : {"dns:///localhost" + port, "localhost" + port + ", 127.0.0.1" + port}) {
    const auto client = Client::connect(address);
    ASSERT_TRUE(client.has_value()) << client.error().message();
    const auto healthy = client->healthy();
    EXPECT_TRUE(healthy.has_value()) << address << ": " << healthy.error().message();
  }
}

// What a client makes of errors that come without the Fault of today's servers: from an older one, or from a
// proxy.

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
