// What the HTTP port reports about the servers that share a store, and to which clients.
#include <gtest/gtest.h>

#include "fleet_node.h"
#include "http_service_test.h"
#include "support/postgres_process.h"

namespace marble::testing {
namespace {

class HttpFleet : public ::testing::Test {
 protected:
  [[nodiscard]] std::unique_ptr<Node> start(std::vector<std::string> flags = {}) {
    flags.insert(flags.end(), {"--workers", "3", "--state-lease-s", "3", "--http", "127.0.0.1:0", "--state",
                               database_.uri()});
    return std::make_unique<Node>(flags);
  }
  [[nodiscard]] static Json list(Node& node) {
    const auto answer = httplib::Client(node.server().http()).Get("/api/servers");
    EXPECT_TRUE(answer);
    if (!answer) return nullptr;
    EXPECT_EQ(answer->status, 200) << answer->body;
    return Json::parse(answer->body);
  }
  /// The report of `other` in the list of `node`; null if there is none.
  [[nodiscard]] static Json listed(Node& node, Node& other) {
    const Json all = list(node);
    for (const Json& one : all.at("servers"))
      if (one.at("address") == other.server().address()) return one;
    return nullptr;
  }
  [[nodiscard]] static bool comes_to(Node& node, Node& other, const std::string& state) {
    return eventually([&] {
      const Json one = listed(node, other);
      return !one.is_null() && one.at("state") == state;
    });
  }

  PostgresProcess database_{MARBLE_POSTGRES_DIR};
};

TEST_F(HttpFleet, EachServerListsAllOfThemWithTheirLoad) {
  const auto a = start(), b = start();
  ASSERT_TRUE(comes_to(*a, *b, "serving") && comes_to(*b, *a, "serving"));
  EXPECT_TRUE(b->solves());
  ASSERT_TRUE(eventually([&] { return listed(*a, *b).at("answered_last_minute") == 1; }));
  const Json other = listed(*a, *b), own = listed(*a, *a);
  EXPECT_EQ(other.at("this"), false);
  EXPECT_EQ(own.at("this"), true);
  EXPECT_EQ(other.at("workers"), 3);
  EXPECT_EQ(other.at("page"), b->server().http());
  EXPECT_EQ(other.at("version"), own.at("version"));
  EXPECT_GT(other.at("p99_last_minute_s"), 0.0);
  EXPECT_TRUE(own.at("p99_last_minute_s").is_null()) << "it has no results";
  const std::string running = b->submit(long_request());
  ASSERT_TRUE(
      eventually([&] { return listed(*a, *a).at("running") == 1 || listed(*a, *b).at("running") == 1; }));
  const EventReader page(a->server().http(), "/api/events");
  ASSERT_TRUE(page.eventually_has("servers"));
  EXPECT_EQ(page.events("servers").front().data.at("servers").size(), 2U);
  EXPECT_TRUE(b->cancel(running).ok());
}

TEST_F(HttpFleet, AKilledServerIsLostAndAStoppedOneIsGone) {
  const auto a = start(), b = start(), c = start();
  ASSERT_TRUE(comes_to(*a, *b, "serving") && comes_to(*a, *c, "serving"));
  b->kill();
  c->stop();
  EXPECT_TRUE(eventually([&] { return listed(*a, *c).is_null(); }));
  ASSERT_TRUE(comes_to(*a, *b, "lost"));
  const double seen = listed(*a, *b).at("seen_s");
  EXPECT_GT(seen, 3.0);
  EXPECT_TRUE(eventually([&] { return listed(*a, *b).at("seen_s") > seen; })) << "it stays listed";
}

TEST_F(HttpFleet, AServerThatComesBackAtItsAddressReplacesItsReport) {
  auto a = start();
  auto b = start();
  const std::string address = b->server().address();
  ASSERT_TRUE(comes_to(*a, *b, "serving"));
  b->kill();
  b = start({"--listen", address});
  ASSERT_TRUE(comes_to(*a, *b, "serving"));
  EXPECT_TRUE(eventually([&] { return list(*a).at("servers").size() == 2; })) << list(*a);
}

TEST_F(HttpFleet, ADrainingServerIsListedAsSuch) {
  const auto a = start(), b = start({"--drain-grace-s", "300"});
  b->submit(long_request());
  const auto runs_on = [&](Node& node) { return node.counters().running() == 1; };
  ASSERT_TRUE(eventually([&] { return runs_on(*a) || runs_on(*b); }));
  Node& busy = runs_on(*a) ? *a : *b;
  Node& other = runs_on(*a) ? *b : *a;
  ASSERT_TRUE(comes_to(other, busy, "serving"));
  busy.server().terminate();
  EXPECT_TRUE(comes_to(other, busy, "draining"));
  busy.server().terminate();  // no grace
  EXPECT_EQ(busy.server().wait(), 0);
}

TEST_F(HttpFleet, ThePublicUrlIsTheLinkToAServer) {
  const auto a = start(), b = start({"--public-url", "https://solver-b.example:8443"});
  ASSERT_TRUE(comes_to(*a, *b, "serving"));
  EXPECT_EQ(listed(*a, *b).at("page"), "https://solver-b.example:8443");
  EXPECT_EQ(listed(*a, *a).at("page"), a->server().http());
}

TEST_F(HttpFleet, WhenTheStoreIsLostTheListIsOldAndSaysWhy) {
  const auto a = start(), b = start();
  ASSERT_TRUE(comes_to(*a, *b, "serving"));
  EXPECT_EQ(list(*a).at("error"), "");
  database_.kill();
  EXPECT_TRUE(eventually([&] { return list(*a).at("error") != ""; }));
  EXPECT_EQ(list(*a).at("servers").size(), 2U);
  EXPECT_TRUE(a->solves());
  database_.start();
  EXPECT_TRUE(eventually([&] { return list(*a).at("error") == "" && list(*a).at("servers").size() == 2; }));
}

TEST_F(HttpFleet, RowsOfOthersAreReadWithinTheirLimits) {
  const auto a = start();
  ASSERT_TRUE(comes_to(*a, *a, "serving"));
  const std::string values = "now(), -5, 9223372036854775807, -1, 0, 0, 0, 'Infinity', 'NaN'";
  const std::string row = "INSERT INTO marble_servers VALUES ";
  static_cast<void>(database_.ask(row +
                                  "('1', repeat('n', 100000), E'\\x1b[31m', 'javascript:alert(1)', 'v', "
                                  "'serving', 'infinity', " +
                                  values + ")"));
  static_cast<void>(database_.ask(
      row + "('2', 'two', 'b', 'http://user@host/path', 'v', 'odd', '-infinity', " + values + ")"));
  static_cast<void>(
      database_.ask(row + "('3', 'old', 'c', '', '', '', now(), '-infinity', 0, 0, 0, 0, 0, 0, 0, 0)"));
  ASSERT_TRUE(eventually([&] { return list(*a).at("servers").size() == 3; })) << list(*a);
  const Json all = list(*a);
  EXPECT_EQ(all.at("error"), "");
  for (const Json& one : all.at("servers")) {
    EXPECT_NE(one.at("name"), "old") << "a report of long ago is deleted";
    if (one.at("this") == true) continue;
    EXPECT_LE(one.at("name").get<std::string>().size(), 256U);
    EXPECT_EQ(one.at("page"), "") << one;
    EXPECT_EQ(one.at("workers"), 0) << one;
    EXPECT_LE(one.at("running"), std::int64_t{1} << 40) << one;
    EXPECT_TRUE(one.at("p99_last_minute_s").is_null()) << one;
    EXPECT_TRUE(one.at("state") == "serving" || one.at("state") == "lost") << one;
  }
}

class HttpFleetAccess : public HttpServiceTest {};

TEST_F(HttpFleetAccess, OnlyObserversAndAdminsLearnOfOtherServers) {
  const PostgresProcess database{MARBLE_POSTGRES_DIR};
  const Token planner = new_token("planner:solve"), viewer = new_token("viewer:observe"),
              chief = new_token("chief:admin");
  start({"--tokens", write("tokens", planner.line + viewer.line + chief.line), "--state", database.uri()});
  EXPECT_EQ(get("/api/servers")->status, 401);
  EXPECT_EQ(get("/api/servers", bearer_header(planner.secret))->status, 403);
  EXPECT_EQ(get("/api/servers", bearer_header(viewer.secret))->status, 200);
  EXPECT_EQ(get("/api/servers", bearer_header(chief.secret))->status, 200);
  EXPECT_EQ(get("/api/servers?all=1", bearer_header(viewer.secret))->status, 400);
  const EventReader seen(server().http(), "/api/events", bearer_header(viewer.secret));
  const EventReader unseen(server().http(), "/api/events", bearer_header(planner.secret));
  ASSERT_TRUE(seen.eventually_has("servers"));
  ASSERT_TRUE(eventually([&] { return unseen.events("clients").size() > 1; }));
  EXPECT_TRUE(unseen.events("servers").empty());
}

TEST_F(HttpFleetAccess, AServerWithAStoreOfItsOwnListsNone) {
  start();
  EXPECT_EQ(Json::parse(get("/api/servers")->body), Json({{"shared", false}}));
}

}  // namespace
}  // namespace marble::testing
