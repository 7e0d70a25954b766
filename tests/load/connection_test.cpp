// What a load tester asks of its connections: one each, and failures as they are.
#include <gtest/gtest.h>

#include <set>

#include "marble/client.h"
#include "scenario.h"
#include "support/server_process.h"

namespace marble::testing {
namespace {

OwnedProblem problem_of(const char* name) {
  return load::problems_of(load::single_entry(name)).value().front();
}

// Where the requests in the log came from: host and port.
std::set<std::string> peers(const ServerProcess& server) {
  std::set<std::string> result;
  for (const std::string& line : server.log_lines({"component=job"})) {
    const std::size_t begin = line.find("peer=");
    result.insert(line.substr(begin, line.find(' ', begin) - begin));
  }
  return result;
}

std::size_t peers_of_three_clients(bool own_connection) {
  ServerProcess server(MARBLE_SERVER_BINARY);
  ConnectOptions options;
  options.own_connection = own_connection;
  const OwnedProblem problem = problem_of("jr1");
  std::vector<Client> clients;
  for (int i = 0; i < 3; ++i) {
    clients.push_back(Client::connect(server.address(), options).value());
    EXPECT_TRUE(clients.back().solve(problem.view()));
  }
  server.terminate();
  EXPECT_EQ(server.wait(), 0);  // then all is logged
  return peers(server).size();
}

TEST(Connection, ClientsThatAskForItHaveOneEach) {
  EXPECT_EQ(peers_of_three_clients(true), 3U);
  EXPECT_EQ(peers_of_three_clients(false), 1U);
}

// A server that drains refuses with `unavailable`, which clients repeat elsewhere unless it says otherwise.
std::size_t refusals_of_one_call(bool retries) {
  ServerProcess server(MARBLE_SERVER_BINARY, {"--drain-grace-s", "3600"});
  ConnectOptions options;
  options.retries = retries;
  const Client client = Client::connect(server.address(), options).value();
  Options endless;
  endless.max_iterations = 1'000'000'000;
  endless.path = Path::paper;
  endless.complementarity_tolerance = endless.equality_tolerance = endless.stationarity_tolerance = 1e-14;
  const OwnedProblem large = problem_of("hopper");
  auto pending = client.solve_async(large.view(), endless).value();
  EXPECT_TRUE(eventually([&] { return client.info()->running == 1; }));
  server.terminate();
  EXPECT_TRUE(eventually([&] { return !client.healthy().value_or(false); }));
  const OwnedProblem tiny = problem_of("jr1");
  const auto answer = client.solve(tiny.view());
  EXPECT_FALSE(answer);
  if (!answer) {
    EXPECT_EQ(answer.error().code, ErrorCode::unavailable);
  }
  pending.cancel();
  EXPECT_EQ(server.wait(), 0);  // then all is logged
  return server.log_lines({"refused", "unavailable"}).size();
}

TEST(Connection, WithoutRetriesAFailureIsOneFailure) {
  EXPECT_EQ(refusals_of_one_call(false), 1U);
  EXPECT_GT(refusals_of_one_call(true), 1U);
}

}  // namespace
}  // namespace marble::testing
