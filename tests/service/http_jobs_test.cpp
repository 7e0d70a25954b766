#include <gmock/gmock.h>
#include <google/protobuf/util/json_util.h>
#include <httplib.h>

#include <array>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>

#include "http_service_test.h"
#include "service_test.h"

namespace marble::testing {
namespace {

// The data of the HTTP port is what gRPC reports, under the same rules.
using HttpJobs = HttpServiceTest;

TEST_F(HttpJobs, OneJobIsWhatGrpcSays) {
  start();
  const std::string id = submit(example_request());
  ASSERT_TRUE(eventually_finished(id));
  const auto answer = get("/api/jobs/" + id);
  ASSERT_EQ(answer->status, 200) << answer->body;
  v1::GetJobResponse reported;
  ASSERT_TRUE(google::protobuf::util::JsonStringToMessage(answer->body, &reported).ok());
  EXPECT_EQ(reported.SerializeAsString(), job(id).SerializeAsString());
}

TEST_F(HttpJobs, TheListIsFilteredAndPaged) {
  start();
  const std::string first = submit(example_request());
  ASSERT_TRUE(eventually_finished(first));
  const std::string second = submit(long_request());
  ASSERT_TRUE(eventually([&] { return job(second).job().state() == v1::JOB_STATE_RUNNING; }));
  const auto ids = [&](const std::string& query) {
    std::vector<std::string> result;
    const auto answer = get("/api/jobs" + query);
    EXPECT_EQ(answer->status, 200) << answer->body;
    const Json list = Json::parse(answer->body);
    for (const Json& one : list.at("jobs")) result.push_back(one.at("job_id"));
    return result;
  };
  EXPECT_THAT(ids(""), ::testing::ElementsAre(second, first));
  EXPECT_THAT(ids("?state=finished"), ::testing::ElementsAre(first));
  EXPECT_THAT(ids("?state=running&state=queued"), ::testing::ElementsAre(second));
  EXPECT_THAT(ids("?limit=1"), ::testing::ElementsAre(second));
  EXPECT_THAT(ids("?before=" + second), ::testing::ElementsAre(first));
  EXPECT_THAT(ids("?client=nobody"), ::testing::IsEmpty());
  EXPECT_EQ(cancel(second)->status, 200);
}

TEST_F(HttpJobs, AWrongParameterIsNamed) {
  start();
  struct Case {
    const char *query, *field, *value;
    int status;
  };
  for (const Case& wrong :
       {Case{"state=late", "state", "late", 400}, Case{"limit=many", "limit", "many", 400},
        Case{"limit=10001", "limit", "10001", 400}, Case{"limit=-1", "limit", "-1", 400},
        Case{"before=none", "before_job_id", "none", 404}, Case{"stat=running", "stat", "running", 400}}) {
    const auto answer = get(std::string("/api/jobs?") + wrong.query);
    EXPECT_EQ(answer->status, wrong.status) << wrong.query;
    EXPECT_EQ(error_of(answer).at("field"), wrong.field);
    EXPECT_EQ(error_of(answer).at("value"), wrong.value);
    EXPECT_FALSE(error_of(answer).at("bound").get<std::string>().empty());
  }
}

TEST_F(HttpJobs, TheTraceAsCsvIsTheTrace) {
  start();
  const std::string id = submit(long_request(500));
  ASSERT_TRUE(eventually_finished(id));
  const auto answer = get("/api/jobs/" + id + "/trace.csv");
  ASSERT_EQ(answer->status, 200) << answer->body;
  EXPECT_EQ(answer->get_header_value("Content-Disposition"),
            "attachment; filename=\"marble-" + id + ".csv\"");
  std::istringstream lines(answer->body);
  std::string line;
  std::getline(lines, line);
  EXPECT_EQ(line.rfind("iteration,outer_iteration,objective,", 0), 0U);
  EXPECT_EQ(line.substr(line.size() - 12), ",open_nodes\r");
  const v1::GetJobResponse reported = job(id);
  ASSERT_GT(reported.trace().rows_size(), 0);
  for (const v1::Progress& row : reported.trace().rows()) {
    ASSERT_TRUE(std::getline(lines, line));
    std::istringstream cells(line);
    std::vector<double> values;
    for (std::string cell; std::getline(cells, cell, ',');)
      values.push_back(std::strtod(cell.c_str(), nullptr));
    EXPECT_THAT(values, ::testing::ElementsAre(row.iteration(), row.outer_iteration(), row.objective(),
                                               row.violations().equality(), row.violations().inequality(),
                                               row.violations().complementarity(), row.kkt_residual(),
                                               row.kappa(), row.rho(), row.step_length(),
                                               row.regularization(), row.factorizations(), row.elapsed_s(),
                                               HUGE_VAL, -HUGE_VAL, HUGE_VAL, row.nodes(), row.open_nodes()));
  }
  EXPECT_FALSE(std::getline(lines, line));
}

TEST_F(HttpJobs, AnotherMethodIsReportedWhichThereAre) {
  start();
  const auto answer = client().Delete("/api/jobs");
  EXPECT_EQ(answer->status, 405);
  EXPECT_EQ(answer->get_header_value("Allow"), "GET, HEAD, POST");
  EXPECT_EQ(error_of(answer).at("value"), "DELETE");
  EXPECT_EQ(client().Get("/api/jobs/x/cancel")->get_header_value("Allow"), "POST");
}

TEST_F(HttpJobs, RolesAreThoseOfGrpc) {
  const Token owner = new_token("owner:solve"), other = new_token("other:solve"),
              viewer = new_token("viewer:observe"), chief = new_token("chief:admin");
  start({"--tokens", write("tokens", owner.line + other.line + viewer.line + chief.line)});
  const std::string id = submit(long_request(), bearer(owner.secret));
  const std::string path = "/api/jobs/" + id;
  EXPECT_EQ(get(path)->status, 401);
  EXPECT_EQ(get(path)->get_header_value("WWW-Authenticate"), "Bearer");
  EXPECT_EQ(get(path, bearer_header(owner.secret))->status, 200);
  EXPECT_EQ(get(path, bearer_header(other.secret))->status, 404) << "not its own";
  EXPECT_EQ(get(path, bearer_header(viewer.secret))->status, 200);
  EXPECT_EQ(get("/api/events")->status, 401);
  EXPECT_EQ(get(path + "/events", bearer_header(other.secret))->status, 404);
  const Json info = Json::parse(get("/api/info", bearer_header(viewer.secret))->body);
  EXPECT_EQ(info.at("client"), "viewer");
  EXPECT_EQ(info.at("roles"), Json({"observe"}));
  EXPECT_EQ(cancel(id, bearer_header(other.secret))->status, 404);
  EXPECT_EQ(cancel(id, bearer_header(viewer.secret))->status, 403);
  EXPECT_EQ(cancel(id, bearer_header(chief.secret))->status, 200);
  EXPECT_TRUE(eventually([&] {
    const auto answer = get(path, bearer_header(owner.secret));
    return Json::parse(answer->body).at("job").at("state") == "JOB_STATE_FINISHED";
  }));
  EXPECT_TRUE(eventually_logged({"refused", "unauthenticated"}));
  EXPECT_TRUE(server().log_lines({owner.secret}).empty());
}

// What the HTTP port reports about the last minutes, and to which clients.
constexpr std::array kHistoryColumns = {"time_s", "queued", "running", "done",
                                        "busy_s", "cpu_s",  "p50_s",   "p99_s"};

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
  for (const char* column : kHistoryColumns)
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

// The HTTP port of a real server, asked by a real HTTP client.
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
