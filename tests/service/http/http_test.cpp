// The HTTP port of a real server, asked by a real HTTP client.
#include <httplib.h>

#include <nlohmann/json.hpp>
#include <thread>

#include "service_test.h"

namespace marble::testing {
namespace {

class Http : public ServiceTest {
 protected:
  void start(std::vector<std::string> flags = {}) {
    flags.insert(flags.end(), {"--http", "127.0.0.1:0"});
    ServiceTest::start(flags);
  }
  [[nodiscard]] httplib::Client client() { return httplib::Client(server().http()); }
};

TEST_F(Http, ProbesAreToldWhetherItLivesAndTakesWork) {
  start({"--drain-grace-s", "30"});
  auto http = client();
  EXPECT_EQ(http.Get("/healthz")->body, "ok\n");
  EXPECT_EQ(http.Get("/readyz")->status, 200);
  Stream stuck(solver(), long_request());
  ASSERT_TRUE(eventually([&] { return counters().running() == 1; }));
  server().terminate();
  EXPECT_TRUE(eventually([&] { return client().Get("/readyz")->status == 503; }));
  EXPECT_EQ(client().Get("/healthz")->status, 200) << "draining is no illness";
  server().terminate();
  EXPECT_EQ(server().wait(), 0);
}

TEST_F(Http, WhatIsNotThereIsAnErrorThatNamesIt) {
  start();
  const auto response = client().Get("/nothing");
  EXPECT_EQ(response->status, 404);
  const auto error = nlohmann::json::parse(response->body).at("error");
  EXPECT_EQ(error.at("code"), "not_found");
  EXPECT_EQ(error.at("value"), "/nothing");
}

TEST_F(Http, APortThatIsTakenIsRefused) {
  start();
  const std::string address = server().http().substr(std::string("http://").size());
  try {
    ServerProcess second(MARBLE_SERVER_BINARY, {"--http", address});
    FAIL() << "two servers on " << address;
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("cannot_listen"), std::string::npos) << error.what();
  }
}

TEST_F(Http, MoreConnectionsThanThreadsWaitTheirTurn) {
  start({"--http-connections", "8"});
  std::vector<std::jthread> clients;
  std::atomic<int> answered = 0;
  for (int i = 0; i < 32; ++i) {
    clients.emplace_back([&] {
      auto http = client();
      http.set_read_timeout(30);
      const auto response = http.Get("/healthz");
      if (response && response->status == 200) ++answered;
    });
  }
  clients.clear();
  EXPECT_EQ(answered, 32);
}

}  // namespace
}  // namespace marble::testing
