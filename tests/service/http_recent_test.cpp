// What the HTTP port reports about the last minutes, and to which clients.
#include <gmock/gmock.h>

#include <array>

#include "http_service_test.h"

namespace marble::testing {
namespace {

constexpr std::array kColumns = {"time_s", "queued", "running", "done", "busy_s", "cpu_s", "p50_s", "p99_s"};

class HttpRecent : public HttpServiceTest {
 protected:
  [[nodiscard]] Json json(const std::string& path, const httplib::Headers& headers = {}) {
    const auto answer = get(path, headers);
    EXPECT_EQ(answer->status, 200) << answer->body;
    return Json::parse(answer->body);
  }
  [[nodiscard]] static Metadata named(const std::string& name) { return {{"marble-client", name}}; }
  /// The share of this client; null if it is not reported.
  [[nodiscard]] static Json share_of(const Json& clients, const std::string& name) {
    for (const Json& share : clients.at("clients"))
      if (share.at("client") == name) return share;
    return nullptr;
  }
};

TEST_F(HttpRecent, ANewPageGetsWhatTheServerDidBeforeItCame) {
  start();
  ASSERT_TRUE(eventually_finished(submit(example_request())));
  Json history;
  ASSERT_TRUE(eventually([&] {
    history = json("/api/history");
    return history.at("done").size() > 2 && history.at("done").back() == 1.0 &&
           !history.at("p99_s").back().is_null();
  }));
  for (const char* column : kColumns)
    EXPECT_EQ(history.at(column).size(), history.at("time_s").size()) << column;
  for (std::size_t at = 1; at < history.at("time_s").size(); ++at)
    EXPECT_GT(history.at("time_s").at(at), history.at("time_s").at(at - 1));
  EXPECT_LE(history.at("p50_s").back(), history.at("p99_s").back());
  const EventReader page(server().http(), "/api/events");
  ASSERT_TRUE(page.eventually_has("server"));
  const Json now = page.events("server").front().data;
  EXPECT_GE(now.at("uptime_s"), history.at("time_s").back()) << "the stream goes on where it ends";
  EXPECT_FALSE(now.at("p99_last_minute_s").is_null());
}

TEST_F(HttpRecent, WhoTakesTheWorkersIsReportedWhileTheyAreTaken) {
  start({"--workers", "1"});
  const std::string hog = submit(long_request(), named("hog"));
  ASSERT_TRUE(eventually([&] { return counters().running() == 1; }));
  static_cast<void>(submit(long_request(), named("patient")));
  Json clients = json("/api/clients");
  EXPECT_EQ(share_of(clients, "hog").at("running"), 1) << clients;
  EXPECT_EQ(share_of(clients, "hog").at("done"), 0) << clients;
  EXPECT_EQ(share_of(clients, "patient").at("queued"), 1) << clients;
  EXPECT_EQ(share_of(clients, "patient").at("busy_s"), 0.0) << clients;
  ASSERT_TRUE(eventually([&] {
    clients = json("/api/clients");
    return share_of(clients, "hog").at("busy_s") > 0.0;
  }));
  EXPECT_EQ(clients.at("clients").at(0).at("client"), "hog") << "who took most comes first";
  const EventReader page(server().http(), "/api/events");
  ASSERT_TRUE(page.eventually_has("clients"));
  EXPECT_EQ(share_of(page.events("clients").front().data, "hog").at("running"), 1);
  ASSERT_EQ(cancel(hog)->status, 200);
  EXPECT_TRUE(eventually([&] { return share_of(json("/api/clients"), "patient").at("running") == 1; }));
}

TEST_F(HttpRecent, WhoeverInventsNamesFillsNoList) {
  start();
  constexpr int kNames = 100;
  for (int i = 0; i < kNames; ++i)
    static_cast<void>(submit(example_request(), named("name " + std::to_string(i))));
  Json clients;
  EXPECT_TRUE(eventually([&] {
    clients = json("/api/clients");
    std::int64_t done = clients.at("others").at("done");
    for (const Json& share : clients.at("clients")) done += share.at("done").get<std::int64_t>();
    return done == kNames;
  })) << clients;
  EXPECT_LE(clients.at("clients").size(), 64U);
  EXPECT_GT(clients.at("others").at("done"), 0);
}

TEST_F(HttpRecent, NobodyHearsOfOtherClientsWithoutTheRole) {
  const Token planner = new_token("planner:solve"), other = new_token("other:solve"),
              viewer = new_token("viewer:observe");
  start({"--tokens", write("tokens", planner.line + other.line + viewer.line)});
  for (const Token& token : {planner, other})
    static_cast<void>(submit(example_request(), bearer(token.secret)));
  Json all;
  ASSERT_TRUE(eventually([&] {
    all = json("/api/clients", bearer_header(viewer.secret));
    return all.at("clients").size() == 2;
  }));
  const Json own = json("/api/clients", bearer_header(planner.secret));
  ASSERT_EQ(own.at("clients").size(), 1U) << own;
  EXPECT_FALSE(share_of(own, "planner").is_null());
  EXPECT_EQ(own.at("others").at("running"), 0);
  const EventReader page(server().http(), "/api/events", bearer_header(planner.secret));
  ASSERT_TRUE(page.eventually_has("clients"));
  EXPECT_TRUE(share_of(page.events("clients").front().data, "other").is_null());
}

TEST_F(HttpRecent, UnauthenticatedOtherMethodsAndUnknownParametersAreRefused) {
  const Token planner = new_token("planner:solve");
  start({"--tokens", write("tokens", planner.line)});
  const auto known = bearer_header(planner.secret);
  for (const std::string path : {"/api/history", "/api/clients"}) {
    EXPECT_EQ(get(path)->status, 401) << path;
    EXPECT_EQ(get(path, bearer_header("wrong"))->status, 401) << path;
    EXPECT_EQ(get(path, known)->status, 200) << path;
    EXPECT_EQ(get(path + "?client=other", known)->status, 400) << path;
    EXPECT_EQ(error_of(get(path + "?client=other", known)).at("field"), "client") << path;
    EXPECT_EQ(get(path + "/more", known)->status, 404) << path;
    httplib::Headers headers = known;
    headers.emplace("Marble-Request", "1");
    EXPECT_EQ(client().Post(path, headers, "{}", "application/json")->status, 405) << path;
    headers.emplace("Sec-Fetch-Site", "cross-site");
    EXPECT_EQ(get(path, headers)->status, 403) << path << " for another site's page";
  }
}

}  // namespace
}  // namespace marble::testing
