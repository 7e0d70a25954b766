// What a start makes of a store's rows, those included that no server has written.
#include "submissions/recovery.h"

#include <gtest/gtest.h>

#include <random>

#include "marble/convert.h"
#include "problems.h"
#include "server/idle_parts.h"
#include "service/job_message.h"
#include "support/child_process.h"

namespace marble::server {
namespace {

using marble::testing::example_request;

class RecoveryTest : public ::testing::Test {
 protected:
  RecoveryTest() {
    EXPECT_TRUE(JobStore::open(directory_.file("state"), log_));  // the tables
  }
  void sql(const std::string& statement) const {
    auto database = Database::open(directory_.file("state") + "/jobs.sqlite");
    ASSERT_TRUE(database);
    const auto made =
        database->run("PRAGMA foreign_keys = OFF; PRAGMA ignore_check_constraints = ON;" + statement);
    ASSERT_TRUE(made) << made.error().message();
  }
  void insert(const std::string& id, const std::string& client, const std::string& rest) const {
    sql("INSERT INTO jobs (id, client, request_id, digest, peer, traceparent, priority, accepted_unix_s, "
        "cancelled,"
        " request, lost) VALUES (" +
        id + ", " + client + ", " + rest + ")");
  }

  struct Server {
    explicit Server(std::unique_ptr<JobStore> opened) : store(std::move(opened)) {
      auto begun = LocalSubmissions::begin(parts.all, store.get());
      EXPECT_TRUE(begun) << begun.error().message();
      submissions = std::move(*begun);
      parts.all.submissions = submissions.get();
    }
    ~Server() {
      parts.scheduler.drain(std::chrono::duration<double>(0.0));
      submissions->close();
    }
    /// Waits for it.
    [[nodiscard]] ResultStore::Shared result(const std::string& id) {
      EXPECT_TRUE(testing::eventually([&] { return parts.results.get(id) != nullptr; })) << id;
      return parts.results.get(id);
    }
    std::unique_ptr<JobStore> store;
    IdleParts parts{1 << 20, 1 << 20};
    std::unique_ptr<Submissions> submissions;
  };
  [[nodiscard]] std::unique_ptr<Server> start() const {
    auto store = JobStore::open(directory_.file("state"), log_);
    EXPECT_TRUE(store) << store.error().message();
    return std::make_unique<Server>(std::move(*store));
  }
  static void expect_readable(const JobRecord& record) {
    v1::GetJobResponse message;
    to_message(record, &message);
    EXPECT_TRUE(v1::GetJobResponse().ParseFromString(message.SerializeAsString())) << record.id();
  }

  testing::TemporaryDirectory directory_;
  Log log_{"text", "off", 4096};
};

std::string hex(const std::string& bytes) {
  std::string text = "x'";
  for (const char c : bytes) {
    constexpr const char* kDigits = "0123456789abcdef";
    const auto byte = static_cast<unsigned char>(c);
    text += {kDigits[byte >> 4U], kDigits[byte & 15U]};
  }
  return text + "'";
}

TEST_F(RecoveryTest, EachUnreadableJobIsOneFailedJob) {
  const std::string request = hex(example_request().SerializeAsString());
  insert("'garbage'", "'c'", "'', x'', '', '', 1, 1.5, 0, x'ffffffff', 0");
  insert("'none'", "'c'", "'', x'', '', '', 1, 1.5, 0, NULL, 0");
  insert("'number'", "'c'", "'', x'', '', '', 1, 1.5, 0, 17, 0");
  insert("'good'", "x'ffc3'",
         "x'80', x'ff', x'ff', '00-' || x'ff', 'high', 'noon', 'no', " + request + ", -3");
  insert("'far'", "''", "'', 1e308, 3, 4, 9223372036854775807, 9e999, 0, " + request + ", 'none'");
  insert("'past'", "'c'", "'same', x'', '', '', -9223372036854775808, -9e999, 0, " + request + ", 0.5");
  insert("'same'", "'c'", "'same', x'00', '', '', 1, 0, 0, " + request + ", 1");
  insert("x'ff00fe'", "'c'", "'', x'', '', '', 1, 1.5, 0, " + request + ", 0");
  insert("42", "42", "42, 42, 42, 42, 1, 1.5, 0, " + request + ", 0");
  insert("'lost'", "'c'", "'', x'', '', '', 1, 1.5, 0, " + request + ", 9223372036854775807");
  const auto server = start();
  for (const char* id : {"garbage", "none", "number", "lost"}) {
    const auto result = server->result(id);
    ASSERT_NE(result, nullptr);
    ASSERT_FALSE(result->answer) << id;
    EXPECT_TRUE(result->answer.error().code == ErrorCode::internal ||
                result->answer.error().code == ErrorCode::not_found)
        << id << result->answer.error().message();
  }
  for (const std::string& id : {std::string("good"), std::string("far"), std::string("past"),
                                std::string("same"), std::string("\xff\0\xfe", 3), std::string("42")}) {
    const auto result = server->result(id);
    ASSERT_NE(result, nullptr);
    EXPECT_TRUE(result->answer) << id << result->answer.error().message();
    const auto record = server->parts.board.find(id);
    ASSERT_NE(record, nullptr);
    expect_readable(*record);
  }
}

TEST_F(RecoveryTest, EachUnreadableAnswerIsAnErrorOfItsJob) {
  const std::string answer = hex([] {
    v1::SolveResponse response;
    response.set_job_id("done");
    return response.SerializeAsString();
  }());
  const auto insert_answer = [&](const std::string& id, const std::string& client,
                                 const std::string& values) {
    insert(id, client, "'', x'', '', '', 1, 1.5, 0, NULL, 0");
    sql("INSERT INTO answers (id, finished_unix_s, job, answer, error) VALUES (" + id + ", " + values + ")");
  };
  v1::GetJobResponse job;
  job.mutable_job()->set_state(static_cast<v1::JobState>(1 << 30));
  job.mutable_job()->set_kind(static_cast<v1::JobKind>(-7));
  job.mutable_job()->set_priority(static_cast<v1::Priority>(-(1 << 30)));
  job.mutable_job()->set_accepted_unix_s(1e300);
  job.mutable_job()->set_finished_unix_s(-1e300);
  job.mutable_trace()->set_stride(-1);
  job.mutable_trace()->add_rows()->set_iteration(-5);
  const std::string odd = hex(job.SerializeAsString());
  insert_answer("'garbage'", "'c'", "4e9, x'ffffffff', x'ffffffff', x''");
  insert_answer("'error'", "'c'", "4e9, x'ffffffff', x'', x'ffffffff'");
  insert_answer("'nothing'", "'c'", "4e9, x'', x'', x''");
  insert_answer("'odd'", "x'ff'", "4e9, " + odd + ", " + answer + ", x''");
  insert_answer("'future'", "'c'", "9e999, x'', " + answer + ", x''");
  insert_answer("'past'", "'c'", "-9e999, x'', " + answer + ", x''");
  insert_answer("'text'", "'c'", "'noon', 'text', 'text', ''");
  const auto server = start();
  for (const char* id : {"garbage", "error", "nothing", "text"}) {
    const auto result = server->parts.results.get(id);
    ASSERT_NE(result, nullptr) << id;
    ASSERT_FALSE(result->answer) << id;
    EXPECT_EQ(result->answer.error().code, ErrorCode::internal) << id;
  }
  for (const char* id : {"odd", "future", "past"}) {
    const auto result = server->parts.results.get(id);
    ASSERT_NE(result, nullptr) << id;
    EXPECT_TRUE(result->answer) << id;
  }
  for (const char* id : {"garbage", "error", "nothing", "odd", "future", "past", "text"}) {
    const auto record = server->parts.board.find(id);
    ASSERT_NE(record, nullptr) << id;
    EXPECT_TRUE(record->is_finished()) << id;
    expect_readable(*record);
  }
}

// What a server of the version before has left.
TEST_F(RecoveryTest, TakesUpTablesWithoutStarts) {
  insert("'waits'", "'c'",
         "'', x'', '', '', 1, 1.5, 0, " + hex(example_request().SerializeAsString()) + ", 0");
  insert("'done'", "'c'", "'', x'', '', '', 1, 1.5, 0, NULL, 0");
  sql("INSERT INTO answers (id, finished_unix_s, job, answer, error) VALUES ('done', 4e9, x'', x'', x'08')");
  sql("DROP INDEX elements_answered; DROP TABLE elements; ALTER TABLE jobs DROP COLUMN elements;"
      "ALTER TABLE jobs DROP COLUMN lost; PRAGMA user_version = 1");
  std::filesystem::remove(directory_.file("state") + "/running");
  EXPECT_TRUE(JobStore::check(directory_.file("state")));
  for (int i = 0; i < 2; ++i) {
    const auto server = start();
    EXPECT_TRUE(server->result("waits")->answer);
    EXPECT_FALSE(server->result("done")->answer);
  }
}

// Any type in any column, any bytes in any message.
TEST_F(RecoveryTest, StartsWithRandomRows) {
  std::mt19937 random(5);
  const auto draw = [&](int most) { return static_cast<int>(random() % static_cast<unsigned>(most)); };
  v1::GetJobResponse whole;
  whole.mutable_job()->set_client("client");
  whole.mutable_job()->set_finished_unix_s(1e9);
  whole.mutable_trace()->add_rows()->set_kappa(0.5);
  v1::SolveResponse solved;
  solved.mutable_solution()->add_z(1.0);
  const std::vector<std::string> messages = {whole.SerializeAsString(), solved.SerializeAsString(),
                                             example_request().SerializeAsString(), ""};
  const auto value = [&]() -> std::string {
    switch (draw(7)) {
      case 0:
        return std::to_string(draw(5) - 1);
      case 1:
        return std::to_string(static_cast<std::int64_t>(random()) << 32);
      case 2:
        return draw(2) == 0 ? "9e999" : "1.7e9";
      case 3:
        return "'name" + std::to_string(draw(3)) + "'";
      case 4:
        return "''";
      default: {
        std::string bytes = messages[static_cast<std::size_t>(draw(4))];
        for (int i = draw(4); i > 0 && !bytes.empty(); --i)
          bytes[static_cast<std::size_t>(draw(static_cast<int>(bytes.size())))] = static_cast<char>(random());
        if (draw(4) == 0) bytes.resize(bytes.size() / 2);
        return hex(bytes);
      }
    }
  };
  constexpr int kRows = 400;
  std::string all = "BEGIN;";
  for (int i = 0; i < kRows; ++i) {
    const std::string id = draw(3) == 0 ? value() : std::to_string(i);
    all += "INSERT OR IGNORE INTO jobs VALUES (NULL";
    for (int column = 1; column < 11; ++column) all += ", " + (column == 1 ? id : value());
    all += ", " + std::to_string(draw(3)) + ", " + (draw(2) == 0 ? "NULL" : value()) + ");";
    const std::string of = "(job, place, request, lost, sequence, ended, iterations, factorizations, answer)";
    for (int element = draw(4); element > 0; --element) {
      all += "INSERT OR IGNORE INTO elements " + of + " VALUES (" + std::to_string(1 + draw(kRows));
      for (int column = 1; column < 9; ++column)
        all += ", " + (draw(3) == 0 ? std::to_string(element) : value());
      all += ");";
    }
    if (draw(2) == 0)
      all += "INSERT OR IGNORE INTO answers (id, finished_unix_s, job, answer, error) VALUES (" + id + ", " +
             value() + ", " + value() + ", " + value() + ", " + value() + ");";
  }
  sql(all + "COMMIT");
  const auto server = start();
  EXPECT_TRUE(testing::eventually([&] {
    const auto jobs = server->store->unanswered();
    EXPECT_TRUE(jobs);
    return jobs->empty();
  }));
  const auto page = server->parts.board.list([](const JobRecord&) { return true; },
                                             [](const JobRecord&) { return true; }, 2 * kRows, "");
  ASSERT_TRUE(page);
  EXPECT_FALSE(page->records.empty());
  for (const auto& record : page->records) expect_readable(*record);
}

}  // namespace
}  // namespace marble::server
