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

TEST_F(Http, ProbesAreReportedWhetherItLivesAndTakesWork) {
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

TEST_F(Http, MetricsComePackedToWhoAsksForThat) {
  start();
  auto http = client();
  http.set_decompress(false);
  const auto plain = http.Get("/metrics", {{"Accept-Encoding", "identity"}});
  ASSERT_EQ(plain->status, 200);
  EXPECT_FALSE(plain->has_header("Content-Encoding"));
  EXPECT_EQ(plain->get_header_value("Vary"), "Accept-Encoding");
  using Fields = httplib::Headers;
  for (const Fields& fields :
       {Fields{{"Accept-Encoding", "gzip"}}, Fields{{"Accept-Encoding", "br;q=1, *;q=0.1"}},
        Fields{{"Accept-Encoding", "deflate"}, {"Accept-Encoding", "gzip;q=0.5"}}}) {
    const auto packed = http.Get("/metrics", fields);
    ASSERT_EQ(packed->status, 200);
    EXPECT_EQ(packed->get_header_value("Content-Encoding"), "gzip");
    EXPECT_EQ(packed->get_header_value("Content-Type"), plain->get_header_value("Content-Type"));
    EXPECT_EQ(packed->body.substr(0, 2), "\x1f\x8b");
    EXPECT_LT(5 * packed->body.size(), plain->body.size());
  }
  for (const std::string& field : {std::string("gzip;q=0"), std::string("identity"), std::string("gzip;q=9"),
                                   std::string("\"gzip\"; q"), std::string(8'000, ',') + "gzip;q"}) {
    const auto response = http.Get("/metrics", {{"Accept-Encoding", field}});
    ASSERT_EQ(response->status, 200) << field;
    EXPECT_FALSE(response->has_header("Content-Encoding")) << field;
    EXPECT_NE(response->body.find("marble_solves_total"), std::string::npos) << field;
  }
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
