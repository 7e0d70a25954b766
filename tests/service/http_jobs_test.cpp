// The data of the HTTP port is what gRPC reports, under the same rules.
#include <gmock/gmock.h>
#include <google/protobuf/util/json_util.h>

#include <sstream>

#include "http_service_test.h"

namespace marble::testing {
namespace {

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

}  // namespace
}  // namespace marble::testing
