// GET /api/jobs/ID/results: an array's results, page by page.
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "array_client.h"
#include "fleet_node.h"

namespace marble::testing {
namespace {

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
