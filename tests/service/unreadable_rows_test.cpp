// Rows in a shared store that no server has written: each is one failed job, and every server goes on.
#include <gmock/gmock.h>

#include "fleet_node.h"
#include "support/postgres_process.h"

namespace marble::testing {
namespace {

// The database has no encoding: its texts hold any bytes.
class UnreadableRows : public ::testing::Test {
 protected:
  [[nodiscard]] std::unique_ptr<Node> start() const {
    return std::make_unique<Node>(std::vector<std::string>{"--workers", "1", "--state-lease-s", "1", "--http",
                                                           "127.0.0.1:0", "--state", database_.uri()});
  }
  /// The client's name is that of the jobs that this test submits.
  void insert(const std::string& id, const std::string& columns, const std::string& values,
              const std::string& request = "'\\xffffffff'") const {
    (void)database_.ask("WITH job AS (INSERT INTO marble_jobs (id, " + columns + ") SELECT '" + id + "', " +
                        values + " RETURNING number) INSERT INTO marble_requests SELECT number, " + request +
                        "::bytea FROM job");
  }

  PostgresProcess database_{MARBLE_POSTGRES_DIR, false, "SQL_ASCII"};
};

constexpr const char* kColumns = "client, request_id, digest, peer, traceparent, priority, bytes, info";

TEST_F(UnreadableRows, AreFailedJobsEach) {
  auto a = start(), b = start();
  const std::string first = a->submit(numbered(1));
  expect_answer(*a, first, 1);
  const std::string own = "'" + database_.ask("SELECT client FROM marble_jobs") + "'";
  const std::string rest = ", '', '', '', '', 1, 4, ";
  insert("garbage", kColumns, own + rest + "'\\xffffffff'");
  insert("empty", kColumns, own + rest + "''", "''");
  insert("far-priority", kColumns, own + ", '', '', '', '', 32767, -5, ''");
  insert("low-priority", kColumns, own + ", '', '', '', '', -32768, 9223372036854775807, ''");
  insert("times", std::string(kColumns) + ", accepted, lost", own + rest + "'', 'infinity', -7");
  insert("past", std::string(kColumns) + ", accepted, lost", own + rest + "'', '-infinity', 1");
  insert("lost", std::string(kColumns) + ", lost", own + rest + "'\\xffffffff', 2147483647");
  insert("bytes", kColumns, own + ", E'\\xff\\xfe', '\\xff', E'p\\xff', E'00-\\xff', 1, 4, '\\xffffffff'");
  insert("lease", std::string(kColumns) + ", state, server, lease",
         own + rest + "'', 1, E's\\xff', 'infinity'");
  insert("no-lease", std::string(kColumns) + ", state, token", own + rest + "'', 1, E'{\\xff,\"'");
  insert("state", std::string(kColumns) + ", state", own + rest + "'', -3");
  insert(R"(quo"ted\,{id})", kColumns, own + rest + "'\\xffffffff'");
  (void)database_.ask(
      "WITH job AS (INSERT INTO marble_jobs (id, client, request_id, digest, peer, traceparent, priority, "
      "bytes,"
      " info) SELECT 'no-request', " +
      own + rest + "'' RETURNING number) SELECT count(*) FROM job");
  (void)database_.ask("NOTIFY marble_jobs");
  for (const char* id : {"garbage", "empty", "far-priority", "low-priority", "times", "past", "lost", "bytes",
                         "lease", "no-lease", "state", R"(quo"ted\,{id})", "no-request"}) {
    v1::SolveResponse response;
    ASSERT_TRUE(eventually([&] {  // until the server has heard of it
      return a->result(id, true, &response).error_code() == grpc::StatusCode::INTERNAL;
    })) << id
        << database_.ask("SELECT * FROM marble_jobs") << a->server().log();
    EXPECT_EQ(b->result(id, true, &response).error_code(), grpc::StatusCode::INTERNAL) << id;
    EXPECT_EQ(b->get(id).job().state(), v1::JOB_STATE_FINISHED);
  }
  for (int i = 2; i < 6; ++i) expect_answer(*b, a->submit(numbered(i)), i);
  EXPECT_EQ(a->list().size(), 18U);
  EXPECT_TRUE(a->solves() && b->solves());
  EXPECT_EQ(database_.ask("SELECT count(*) FROM marble_jobs WHERE state <> 2"), "0");
}

// Without tokens every client sees all jobs.
TEST_F(UnreadableRows, NamesOfAnyBytesAreShownAsText) {
  auto a = start();
  insert("named", kColumns, "E'cert:\\xff\\xc3', E'r\\x80', '', E'\\xfe', '', 1, 4, ''");
  insert("also", kColumns, "E'\\xed\\xa0\\x80', '', '', '', '', 0, 4, '\\xffffffff'");
  (void)database_.ask("NOTIFY marble_jobs");
  ASSERT_TRUE(eventually([&] {
    return database_.ask("SELECT count(*) FROM marble_jobs WHERE state = 2") == "2";
  })) << a->server().log();
  expect_answer(*a, a->submit(numbered(1)), 1);
  EXPECT_EQ(a->list().size(), 3U);
  const auto page = httplib::Client(a->server().http()).Get("/api/jobs");
  ASSERT_TRUE(page);
  EXPECT_EQ(page->status, 200);
  EXPECT_THAT(page->body, ::testing::HasSubstr("named"));
  const auto b = start();
  EXPECT_EQ(b->list().size(), 3U);
}

TEST_F(UnreadableRows, AnswersAreErrorsOfTheirJobs) {
  auto a = start();
  std::vector<std::string> ids;
  for (int i = 0; i < 3; ++i) {
    ids.push_back(a->submit(numbered(i)));
    expect_answer(*a, ids.back(), i);
  }
  a->kill();
  const auto set = [&](int job, const std::string& columns) {
    (void)database_.ask("UPDATE marble_answers SET " + columns +
                        " FROM marble_jobs j WHERE j.number = marble_answers.number AND j.id = '" +
                        ids[static_cast<std::size_t>(job)] + "'");
  };
  set(0, "answer = '\\xffffffff', job = '\\xffffffff'");
  set(1, "error = '\\xffffffff'");
  (void)database_.ask("UPDATE marble_jobs SET info = '\\xffffffff', ended = 'infinity' WHERE id = '" +
                      ids[0] + "'");
  a = start();
  v1::SolveResponse response;
  for (const int job : {0, 1}) {
    const grpc::Status status = a->result(ids[static_cast<std::size_t>(job)], true, &response);
    EXPECT_TRUE(status.error_code() == grpc::StatusCode::INTERNAL ||
                (job == 0 && status.error_code() == grpc::StatusCode::NOT_FOUND))
        << status.error_message();
  }
  expect_answer(*a, ids[2], 2);
  EXPECT_LE(a->list().size(), 3U);
  expect_answer(*a, a->submit(numbered(7)), 7);
}

}  // namespace
}  // namespace marble::testing
