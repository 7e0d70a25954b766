#include <gmock/gmock.h>
#include <google/protobuf/util/json_util.h>
#include <sys/socket.h>

#include <future>
#include <nlohmann/json.hpp>
#include <sstream>

#include "array_client.h"
#include "fleet_node.h"
#include "http_service_test.h"

namespace marble::testing {
namespace {

// Jobs over plain HTTP: problems as JSON in, answers as JSON out, under the rules that gRPC has.
Json triplets(const v1::SparseMatrix& matrix) {
  Json made = {{"rows", matrix.rows()},
               {"cols", matrix.columns()},
               {"i", Json::array()},
               {"j", Json::array()},
               {"v", Json::array()}};
  for (int column = 0; column < matrix.columns(); ++column) {
    for (int k = matrix.column_pointers(column); k < matrix.column_pointers(column + 1); ++k) {
      made["i"].push_back(matrix.row_indices(k));
      made["j"].push_back(column);
      made["v"].push_back(matrix.values(k));
    }
  }
  return made;
}

/// A message's problem as problem files have it.
Json as_json(const v1::Problem& problem) {
  Json made = {{"name", problem.name()},         {"n", problem.gradient_size()},
               {"c0", problem.constant()},       {"g", problem.gradient()},
               {"b", problem.equality_offset()}, {"d", problem.inequality_offset()},
               {"l", problem.left_offset()},     {"r", problem.right_offset()}};
  const std::pair<const char*, const v1::SparseMatrix*> matrices[] = {{"Q", &problem.hessian()},
                                                                      {"A", &problem.equality_matrix()},
                                                                      {"C", &problem.inequality_matrix()},
                                                                      {"L", &problem.left_matrix()},
                                                                      {"R", &problem.right_matrix()}};
  for (const auto& [key, matrix] : matrices) {
    if (matrix->columns() > 0) made[key] = triplets(*matrix);
  }
  return made;
}

/// By protobuf, with all fields or with those that are set.
std::string text_of(const google::protobuf::Message& message, bool all = true) {
  std::string text;
  google::protobuf::util::JsonPrintOptions options;
  options.preserve_proto_field_names = true;
  options.always_print_primitive_fields = all;
  EXPECT_TRUE(google::protobuf::util::MessageToJsonString(message, &text, options).ok());
  return text;
}

/// A request that gRPC takes, as one that HTTP takes.
Json as_json(const v1::SolveRequest& request) {
  v1::SolveRequest others = request;
  others.clear_problem();
  Json made = Json::parse(text_of(others, false));
  made["problem"] = as_json(request.problem());
  return made;
}

class HttpSubmit : public HttpServiceTest {
 protected:
  [[nodiscard]] httplib::Result result_of(const std::string& id, const std::string& query = "?wait=60",
                                          const httplib::Headers& headers = {}) {
    httplib::Client patient = client();
    patient.set_read_timeout(120);
    return patient.Get("/api/jobs/" + id + "/result" + query, headers);
  }
  /// What comes back on a POST of which no more is sent.
  [[nodiscard]] std::string answer_to_head(const std::string& rest) {
    const int one = connected_to(server().http());
    const std::string head =
        "POST /api/jobs HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n" + rest;
    EXPECT_EQ(send(one, head.data(), head.size(), MSG_NOSIGNAL), static_cast<ssize_t>(head.size()));
    std::string answer(4096, '\0');
    answer.resize(static_cast<std::size_t>(std::max<ssize_t>(recv(one, answer.data(), answer.size(), 0), 0)));
    close(one);
    return answer;
  }
  [[nodiscard]] v1::SolveResponse answer_by_grpc(const std::string& id) {
    grpc::ClientContext context;
    v1::JobResultRequest request;
    request.set_job_id(id);
    request.set_wait(true);
    v1::SolveResponse response;
    EXPECT_TRUE(v1::Jobs::NewStub(channel())->Result(&context, request, &response).ok());
    return response;
  }
};

TEST_F(HttpSubmit, AnAnswerIsThatOfGrpcToTheLastBit) {
  start();
  v1::SolveRequest request = example_request();
  request.set_request_id("by http");
  const auto answer = post(as_json(request).dump());
  ASSERT_EQ(answer->status, 202) << answer->body;
  const std::string id = Json::parse(answer->body).at("job_id");
  EXPECT_EQ(answer->get_header_value("Location"), "/api/jobs/" + id);
  const auto result = result_of(id);
  ASSERT_EQ(result->status, 200) << result->body;
  const v1::SolveResponse by_grpc = answer_by_grpc(id);
  EXPECT_EQ(result->body, text_of(by_grpc));
  v1::SolveResponse direct;
  ASSERT_TRUE(solve(request, &direct).ok());
  EXPECT_THAT(by_grpc.solution().z(), ::testing::ElementsAreArray(direct.solution().z()));
  EXPECT_EQ(job(id).job().kind(), v1::JOB_KIND_SUBMITTED);
}

TEST_F(HttpSubmit, AProblemByItselfIsTakenToo) {
  start();
  const std::string id = posted(as_json(example_request().problem()));
  const auto result = result_of(id);
  ASSERT_EQ(result->status, 200) << result->body;
  EXPECT_DOUBLE_EQ(Json::parse(result->body).at("solution").at("objective"), 3.0);
}

TEST_F(HttpSubmit, EveryMemberOfTheRequestCounts) {
  start({"--client-priority", "interactive"});
  Json request = {{"problem", as_json(example_request().problem())},
                  {"options", {{"num_starts", 7}, {"path", "PATH_PAPER"}}},
                  {"priority", "PRIORITY_BATCH"},
                  {"request_id", "mine"}};
  request["problem"]["x0"] = {1, 2, 3, 4};
  const std::string id =
      posted(request, {{"traceparent", "00-" + std::string(32, 'a') + "-" + std::string(16, 'b') + "-01"}});
  ASSERT_TRUE(eventually_finished(id));
  const v1::GetJobResponse reported = job(id);
  EXPECT_EQ(reported.options().num_starts(), 7);
  EXPECT_EQ(reported.options().path(), v1::PATH_PAPER);
  EXPECT_EQ(reported.job().priority(), v1::PRIORITY_BATCH);
  EXPECT_EQ(reported.job().request_id(), "mine");
  EXPECT_EQ(reported.job().trace_id(), std::string(32, 'a'));
  request["priority"] = "PRIORITY_REALTIME";
  const auto above = post(request.dump());
  EXPECT_EQ(above->status, 403) << "a priority above the client's";
  EXPECT_EQ(error_of(above).at("field"), "priority");
  request["priority"] = "PRIORITY_BATCH";
  request["initial_point"] = {{"z", {1, 2, 3, 4}}};
  EXPECT_EQ(error_of(post(request.dump())).at("field"), "initial_point") << "x0 is there";
}

TEST_F(HttpSubmit, TheSameRequestByItsIdIsTheSameJob) {
  start();
  Json request = {{"problem", as_json(example_request().problem())}, {"request_id", "once"}};
  const std::string id = posted(request);
  EXPECT_EQ(posted(request), id);
  request["options"]["num_starts"] = 2;
  const auto other = post(request.dump());
  EXPECT_EQ(other->status, 400);
  EXPECT_EQ(error_of(other).at("field"), "request_id");
}

TEST_F(HttpSubmit, WhatIsWrongIsNamedByFieldAndIndex) {
  start();
  struct Case {
    const char *text, *field;
    int index;
  };
  for (const Case& wrong : {
           Case{R"({"problem":{"n":2,"g":[1,NaN]}})", "problem.g", 1},
           Case{R"({"n":2,"g":[1,1e999]})", "g", 1},
           Case{R"({"n":2,"g":[1,2],"L":{"rows":1,"cols":2,"i":[1],"j":[0],"v":[1]},"l":[0],"r":[0]})", "L.i",
                0},
           Case{R"({"problem":{"n":2,"g":[1]}})", "problem.g", -1},
           Case{R"({"problem":7})", "problem", -1},
           Case{R"({"options":{}})", "problem", -1},
           Case{R"({"problem":{"n":1,"g":[1]},"options":{"num_starts":"x"}})", "options.num_starts", -1},
           Case{R"({"problem":{"n":1,"g":[1]},"options":{"strts":1}})", "options.strts", -1},
           Case{R"({"problem":{"n":1,"g":[1]},"options":{"num_starts":0}})", "options.num_starts", -1},
           Case{R"({"problem":{"n":1,"g":[1]},"options":7})", "options", -1},
           Case{R"({"problem":{"n":1,"g":[1]},"options":[]})", "options", -1},
           Case{R"({"problem":{"n":1,"g":[1]},"nonsense":7})", "nonsense", -1},
           Case{R"({"n":1,"g":[1],"options":{}})", "options", -1},
           Case{R"({"problem":{"n":1,"g":[1]},"problem":{"n":1,"g":[1]}})", "problem", -1},
           Case{R"({"problem":{"n":1,"g":[1]},"warm_start":{"z":[1,2]}})", "warm_start.z", -1},
           Case{R"([])", "", -1},
           Case{R"({)", "", -1},
           Case{"", "", -1},
       }) {
    const auto answer = post(wrong.text);
    EXPECT_EQ(answer->status, 400) << wrong.text;
    const Json error = error_of(answer);
    EXPECT_EQ(error.at("code"), "invalid_argument") << wrong.text;
    EXPECT_EQ(error.at("field"), wrong.field) << wrong.text << answer->body;
    EXPECT_EQ(error.at("index"), wrong.index) << wrong.text << answer->body;
  }
  EXPECT_EQ(counters().accepted_total(), 0);
  EXPECT_EQ(counters().refused_total(), 18) << "they are counted as gRPC's are";
}

TEST_F(HttpSubmit, AnErrorRepeatsOnlySoMuchOfWhatWasSent) {
  start();
  const std::string x(60000, 'x'), text = R"({"problem":{"n":1,"g":[1]},"options":)";
  for (const std::string& rest :
       {R"({"num_starts":")" + x + "\"}}", "{\"" + x + "\":1}}", "\"" + x + "\"}", "1,\"" + x + "\":1}"}) {
    const auto refused = post(text + rest);
    EXPECT_EQ(refused->status, 400);
    EXPECT_LT(refused->body.size(), 2000U) << rest.substr(0, 20);
  }
}

TEST_F(HttpSubmit, HoweverDeepATextIsItIsReadInOnePass) {
  start();
  for (const char* key : {"a", "options", "problem"}) {
    for (const char* opening : {"[", "{\"x\":"}) {
      std::string deep;
      for (int k = 0; k < 100000; ++k) deep += opening;
      EXPECT_EQ(post(std::string("{\"") + key + "\":" + deep)->status, 400) << key;
    }
  }
  EXPECT_TRUE(lives());
}

TEST_F(HttpSubmit, AnAnswerThatIsNotThereYetIsAConflictAndAWaitEndsWithTheJob) {
  start();
  const std::string id = posted(as_json(long_request()));
  for (const char* query : {"", "?wait=0", "?wait=0.05"}) {
    const auto early = result_of(id, query);
    EXPECT_EQ(early->status, 409) << query;
    EXPECT_EQ(error_of(early).at("code"), "failed_precondition");
    EXPECT_EQ(early->get_header_value("Retry-After"), "1");
  }
  auto waiting = std::async(std::launch::async, [&] { return result_of(id); });
  ASSERT_TRUE(eventually([&] { return job(id).job().state() == v1::JOB_STATE_RUNNING; }));
  EXPECT_EQ(cancel(id)->status, 200);
  const auto result = waiting.get();
  ASSERT_EQ(result->status, 200) << result->body;
  EXPECT_EQ(Json::parse(result->body).at("solution").at("status"), "STATUS_CANCELLED");
  for (const char* query : {"?wait=61", "?wait=-1", "?wait=x", "?wait=", "?wait=nan", "?weight=1"})
    EXPECT_EQ(result_of(id, query)->status, 400) << query;
}

TEST_F(HttpSubmit, WhatEndedWithoutASolutionReportsWhy) {
  start({"--solve-bytes", std::to_string(1 << 20)});
  const std::string id = posted(as_json(long_request()));
  const auto result = result_of(id);
  ASSERT_EQ(result->status, 200) << result->body;
  const Json reported = Json::parse(result->body);
  EXPECT_EQ(reported.at("job_id"), id);
  EXPECT_EQ(reported.at("error").at("code"), "resource_exhausted");
  EXPECT_FALSE(reported.contains("solution"));
}

TEST_F(HttpSubmit, ADeletedJobIsGoneForThoseWhoWaitToo) {
  start();
  const std::string id = posted(as_json(long_request()));
  auto waiting = std::async(std::launch::async, [&] { return result_of(id); });
  ASSERT_TRUE(eventually([&] { return job(id).job().state() == v1::JOB_STATE_RUNNING; }));
  EXPECT_EQ(client().Delete("/api/jobs/" + id)->status, 200);
  EXPECT_EQ(waiting.get()->status, 404);
  EXPECT_EQ(client().Delete("/api/jobs/" + id)->status, 404);
  EXPECT_EQ(get("/api/jobs/" + id)->status, 404);
  EXPECT_TRUE(eventually_idle());
}

TEST_F(HttpSubmit, RolesAreThoseOfGrpc) {
  const Token owner = new_token("owner:solve"), other = new_token("other:solve"),
              viewer = new_token("viewer:observe"), chief = new_token("chief:admin");
  start({"--tokens", write("tokens", owner.line + other.line + viewer.line + chief.line)});
  const std::string text = as_json(example_request()).dump();
  EXPECT_EQ(post(text)->status, 401);
  EXPECT_EQ(post(text)->get_header_value("WWW-Authenticate"), "Bearer");
  EXPECT_EQ(post(text, bearer_header(viewer.secret))->status, 403);
  const std::string id = posted(as_json(example_request()), bearer_header(owner.secret));
  EXPECT_EQ(result_of(id)->status, 401);
  EXPECT_EQ(result_of(id, "", bearer_header(other.secret))->status, 404) << "not its own";
  EXPECT_EQ(result_of(id, "", bearer_header(viewer.secret))->status, 404) << "answers are their owner's";
  EXPECT_EQ(result_of(id, "?wait=60", bearer_header(owner.secret))->status, 200);
  EXPECT_EQ(result_of(id, "", bearer_header(chief.secret))->status, 200);
  const std::string path = "/api/jobs/" + id;
  EXPECT_EQ(client().Delete(path)->status, 401);
  EXPECT_EQ(client().Delete(path, bearer_header(other.secret))->status, 404);
  EXPECT_EQ(client().Delete(path, bearer_header(viewer.secret))->status, 403);
  EXPECT_EQ(client().Delete(path, bearer_header(owner.secret))->status, 200);
}

TEST_F(HttpSubmit, QuotasAndTheQueueAreThoseOfGrpc) {
  start({"--workers", "1", "--client-queued", "1"});
  const Json request = as_json(long_request());
  const std::string running = posted(request);
  ASSERT_TRUE(eventually([&] { return job(running).job().state() == v1::JOB_STATE_RUNNING; }));
  const std::string queued = posted(request);
  const auto refused = post(request.dump());
  EXPECT_EQ(refused->status, 429) << refused->body;
  EXPECT_EQ(error_of(refused).at("code"), "resource_exhausted");
  EXPECT_GE(std::stoi(refused->get_header_value("Retry-After")), 1);
  EXPECT_EQ(counters().refused_total(), 1);
  EXPECT_EQ(posted(request, {{"Marble-Client", "another"}}).empty(), false) << "has a quota of its own";
}

TEST_F(HttpSubmit, AMessageThatIsTooLargeForGrpcIsTooLargeHereToo) {
  start({"--message-bytes", "1024"});
  Json problem = {{"n", 200}, {"g", std::vector<double>(200, 0.0)}};
  const auto refused = post(problem.dump());
  EXPECT_EQ(refused->status, 429) << refused->body;
  EXPECT_EQ(error_of(refused).at("field"), "message_bytes");
}

TEST_F(HttpSubmit, ABodyHasItsBounds) {
  start({"--http-body-bytes", "200000"});
  Json request = as_json(example_request().problem());
  request["pad"] = std::string(150000, 'x');
  EXPECT_FALSE(posted(request).empty()) << "longer than what else is sent here";
  request["pad"] = std::string(200000, 'x');
  const auto refused = post(request.dump());
  EXPECT_EQ(refused->status, 413);
  EXPECT_EQ(error_of(refused).at("bound"), "must have at most 200000 bytes");
  const std::string text = as_json(example_request()).dump();
  const httplib::Headers ours = {{"Marble-Request", "1"}};
  EXPECT_EQ(client().Post("/api/jobs", ours, text, "text/plain")->status, 415);
  EXPECT_EQ(client().Post("/api/jobs", ours, text, "multipart/form-data; boundary=x")->status, 415);
  EXPECT_EQ(client().Post("/api/jobs", {{"Content-Encoding", "gzip"}}, text, "application/json")->status,
            415);
  const auto in_pieces = [&](std::size_t, httplib::DataSink& sink) {
    sink.write(text.data(), text.size());
    sink.done();
    return true;
  };
  EXPECT_EQ(client().Post("/api/jobs", httplib::Headers{}, in_pieces, "application/json")->status, 411);
}

TEST_F(HttpSubmit, ABodyThatDoesNotComeHoldsNothingForLong) {
  start({"--http-line-s", "0.1", "--http-body-rate", "1e12"});
  const std::string answer = answer_to_head("Content-Length: 100000\r\n\r\n{\"n\":");
  EXPECT_NE(answer.find(" 408 "), std::string::npos) << answer;
}

TEST_F(HttpSubmit, NothingIsReadOfWhoeverIsNotKnownOrMayNot) {
  const Token viewer = new_token("viewer:observe");
  start({"--tokens", write("tokens", viewer.line), "--http-line-s", "3600"});
  const std::string length = "Content-Length: 60000000\r\n";
  EXPECT_NE(answer_to_head(length + "\r\n").find(" 401 "), std::string::npos) << "before any of it has come";
  EXPECT_NE(answer_to_head(length + "Authorization: Bearer " + viewer.secret + "\r\n\r\n").find(" 403 "),
            std::string::npos);
}

TEST_F(HttpSubmit, OtherSitesPagesCannotSubmitOrDelete) {
  start();
  const std::string text = as_json(example_request()).dump();
  EXPECT_EQ(client().Post("/api/jobs", text, "text/plain")->status, 403) << "all that a form can send";
  EXPECT_EQ(post(text, {{"Sec-Fetch-Site", "cross-site"}})->status, 403);
  EXPECT_EQ(client().Delete("/api/jobs/x", {{"Sec-Fetch-Site", "same-site"}})->status, 403);
  EXPECT_EQ(post(text, {{"Host", "evil.example"}})->status, 403);
}

TEST_F(HttpSubmit, ThoseWhoWaitLeaveThreadsToOthers) {
  start({"--http-connections", "8"});
  const std::string id = posted(as_json(long_request()));
  std::vector<std::future<httplib::Result>> waiting;
  for (int k = 0; k < 6; ++k) {
    waiting.push_back(std::async(std::launch::async, [&] {
      httplib::Result result = result_of(id);
      while (result->status == 429) result = result_of(id);  // who looks below may have had the last place
      return result;
    }));
  }
  EXPECT_TRUE(eventually([&] { return result_of(id, "?wait=0.01")->status == 429; }));
  EXPECT_EQ(get("/api/jobs/" + id)->status, 200) << "others are served";
  EXPECT_FALSE(posted(as_json(example_request())).empty());
  EXPECT_EQ(cancel(id)->status, 200);
  for (auto& one : waiting) EXPECT_EQ(one.get()->status, 200);
}

TEST_F(HttpSubmit, AServerThatStopsTakesNothingAndAnswersThoseWhoWait) {
  start({"--workers", "1", "--drain-grace-s", "3600"});
  const std::string id = posted(as_json(long_request()));
  auto waiting = std::async(std::launch::async, [&] { return result_of(id); });
  ASSERT_TRUE(eventually([&] { return job(id).job().state() == v1::JOB_STATE_RUNNING; }));
  server().terminate();
  ASSERT_TRUE(eventually([&] { return health() == "NOT_SERVING"; }));
  const auto refused = post(as_json(example_request()).dump());
  EXPECT_EQ(refused->status, 503);
  EXPECT_FALSE(refused->get_header_value("Retry-After").empty());
  server().terminate();  // no more grace
  const auto result = waiting.get();
  ASSERT_TRUE(result) << httplib::to_string(result.error());
  EXPECT_EQ(Json::parse(result->body).at("solution").at("status"), "STATUS_CANCELLED") << result->body;
}

TEST_F(HttpSubmit, JobsOnDiskOutliveTheServer) {
  const std::string folder = directory_.file("state");
  start({"--state-dir", folder});
  const std::string id = posted(as_json(example_request()));
  const auto before = result_of(id);
  ASSERT_EQ(before->status, 200);
  server().send(SIGKILL);
  server().wait();
  start({"--state-dir", folder});
  EXPECT_EQ(result_of(id)->body, before->body);
}

// GET /api/jobs/ID/results: an array's results, page by page.
using Json = nlohmann::json;

class HttpArrays : public ::testing::Test {
 protected:
  [[nodiscard]] httplib::Result get(const std::string& id, const std::string& query = "") {
    httplib::Client client(node_.server().http());
    client.set_read_timeout(120);
    auto answer = client.Get("/api/jobs/" + id + "/results" + query);
    EXPECT_TRUE(answer);
    return answer;
  }
  static std::vector<Json> lines_of(const std::string& body) {
    std::istringstream text(body);
    std::vector<Json> lines;
    for (std::string line; std::getline(text, line);) lines.push_back(Json::parse(line));
    return lines;
  }

  Node node_{{"--workers", "2", "--http", "127.0.0.1:0", "--http-wait-s", "60"}};
};

TEST_F(HttpArrays, EachResultComesOnceAsOneLine) {
  constexpr std::int64_t kElements = 40;
  const std::string id = submit_array(node_.jobs(), elements_of(kElements));
  std::int64_t after = 0;
  std::set<std::string> indices;
  while (after < kElements) {
    const auto page = get(id, "?wait=60&after=" + std::to_string(after));
    ASSERT_EQ(page->status, 200) << page->body;
    EXPECT_EQ(page->get_header_value("Content-Type"), "application/x-ndjson");
    for (const Json& line : lines_of(page->body)) {
      EXPECT_EQ(line["sequence"], std::to_string(++after));
      const std::string index = line["index"];
      EXPECT_TRUE(indices.insert(index).second);
      EXPECT_NEAR(line["result"]["solution"]["z"][0].get<double>(), std::stod(index), 1e-6);
    }
  }
  const auto end = get(id, "?wait=60&after=40");
  EXPECT_EQ(end->status, 204) << end->body;
  EXPECT_EQ(get(id, "?after=20")->status, 200) << "without a wait too";
}

TEST_F(HttpArrays, WhatIsNotThereYetIsNoResultAndAnEarlyEndIsAnError) {
  std::vector<v1::ArrayElement> elements = elements_of(10, [](std::int64_t) { return long_element(); });
  const std::string id = submit_array(node_.jobs(), elements);
  const auto none = get(id);
  EXPECT_EQ(none->status, 409) << none->body;
  EXPECT_TRUE(none->has_header("Retry-After"));
  ASSERT_TRUE(eventually([&] { return node_.counters().running() == 2; }));
  EXPECT_TRUE(node_.cancel(id).ok());
  ASSERT_TRUE(eventually([&] { return node_.job(id).state() == v1::JOB_STATE_FINISHED; }));
  const std::size_t there = lines_of(get(id)->body).size();
  EXPECT_GE(there, 2U);
  const auto end = get(id, "?after=" + std::to_string(there));
  EXPECT_EQ(Json::parse(end->body)["error"]["code"], "cancelled") << end->body;
}

TEST_F(HttpArrays, ARequestThatIsWrongIsRefusedInWords) {
  const std::string id = submit_array(node_.jobs(), elements_of(2));
  const std::string other = node_.submit(example_request());
  for (const char* query : {"?after=-1", "?after=3", "?after=1x", "?after=", "?after=99999999999999999999",
                            "?wait=61", "?wait=nan", "?before=1"})
    EXPECT_EQ(get(id, query)->status, 400) << query;
  for (const std::string& one : {other, std::string("none"), id + "x"})
    EXPECT_EQ(get(one)->status, 404) << one;
  EXPECT_TRUE(node_.remove(id).ok());
  EXPECT_EQ(get(id)->status, 404);
}

}  // namespace
}  // namespace marble::testing
