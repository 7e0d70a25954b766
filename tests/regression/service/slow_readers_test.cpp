// Symptom: a large answer over HTTP took forty times its message, and no longer counted once a client read it
// slowly: with transport_bytes 512 MB, a hundred slow readers of 3 MB brought the server to 2.5 GB. Cause:
// protobuf makes a tree of all numbers and then the whole text, and the reservation ended with the handler.
#include <list>

#include "service/http_service_test.h"
#include "support/raw_http2.h"

namespace marble::testing {
namespace {

constexpr int kNumbers = 400'000;
constexpr std::int64_t kAnswer = 8 * kNumbers;  // bytes
constexpr std::int64_t kTransport = 64 << 20;
constexpr std::int64_t kReader = 768 << 10;  // a thread, a socket, two pieces of text

// Connections that ask for an answer, and read no more of it than its status.
class SlowReaders : public HttpServiceTest {
 protected:
  ~SlowReaders() override {
    for (const int one : readers_) close(one);
  }
  static v1::SolveRequest large_request() {
    v1::SolveRequest request;
    auto& problem = *request.mutable_problem();
    auto& hessian = *problem.mutable_hessian();
    hessian.set_rows(kNumbers);
    hessian.set_columns(kNumbers);
    for (int i = 0; i < kNumbers; ++i) {
      problem.add_gradient(1.0 / (i + 3));
      hessian.add_column_pointers(i);
      hessian.add_row_indices(i);
      hessian.add_values(2.0);
    }
    hessian.add_column_pointers(kNumbers);
    return request;
  }
  std::string kept_answer() {
    std::string id = submit(large_request());
    EXPECT_TRUE(eventually_finished(id));
    EXPECT_EQ(whole_answer(id)->status, 200);
    return id;
  }
  httplib::Result whole_answer(const std::string& id) {
    httplib::Client patient = client();
    patient.set_read_timeout(60);
    return patient.Get("/api/jobs/" + id + "/result?wait=60", {{"Marble-Client", "alice"}});
  }
  // The status of its answer.
  int begin_to_read(const std::string& id, const std::string& client, const std::string& what = "/result") {
    const int one = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const int room = 4096;
    setsockopt(one, SOL_SOCKET, SO_RCVBUF, &room, sizeof room);
    connect_to(server().http(), one);
    const std::string text = "GET /api/jobs/" + id + what +
                             " HTTP/1.1\r\nHost: localhost\r\nMarble-Client: " + client + "\r\n\r\n";
    EXPECT_EQ(send(one, text.data(), text.size(), MSG_NOSIGNAL), static_cast<ssize_t>(text.size()));
    char status[12] = {};
    EXPECT_EQ(recv(one, status, sizeof status, MSG_WAITALL), 12);
    readers_.push_back(one);
    return std::atoi(status + 9);
  }
  std::list<int> readers_;
};

TEST_F(SlowReaders, TakeNoMoreThanTransportBytesTogether) {
  // The slowest rate that may be set: they are not closed meanwhile.
  start({"--transport-bytes", std::to_string(kTransport), "--http-answer-rate", "1024"});
  const std::string id = kept_answer();
  std::ofstream("/proc/" + std::to_string(server().pid()) + "/clear_refs") << "5";
  const std::int64_t before = resident_bytes(server().pid(), "VmRSS");
  int taken = 0, refused = 0;
  for (int k = 0; k < 40; ++k) {
    const int status = begin_to_read(id, "client " + std::to_string(k));
    EXPECT_TRUE(status == 200 || status == 429) << status;
    ++(status == 200 ? taken : refused);
  }
  EXPECT_GE(taken, 5);
  EXPECT_GE(refused, 5);
  EXPECT_LE(taken, kTransport / kAnswer) << "what is being sent counts";
  EXPECT_LT(resident_bytes(server().pid()) - before, kTransport + taken * kReader + (16 << 20));
  EXPECT_EQ(get("/api/info")->status, 200);
}

TEST_F(SlowReaders, LeaveHalfOfItToOtherClients) {
  start({"--transport-bytes", std::to_string(kTransport), "--http-answer-rate", "1024"});
  const std::string id = kept_answer();
  int taken = 0;
  while (begin_to_read(id, "alice") == 200) ASSERT_LT(++taken, 40);
  EXPECT_GE(taken, 2);
  EXPECT_EQ(begin_to_read(id, "bob"), 200);
}

TEST_F(SlowReaders, GiveItBackWhenTheyGo) {
  start({"--transport-bytes", std::to_string(kTransport), "--http-answer-rate", "1024"});
  const std::string id = kept_answer();
  while (begin_to_read(id, "alice") == 200) ASSERT_LT(readers_.size(), 40U);
  for (const int one : readers_) close(one);
  readers_.clear();
  EXPECT_TRUE(eventually([&] { return whole_answer(id)->status == 200; }));
}

TEST_F(SlowReaders, AreClosedWhereTheyTakeTooLittle) {
  start({"--transport-bytes", std::to_string(kTransport), "--http-answer-rate", "1e9"});
  const std::string id = kept_answer();
  while (begin_to_read(id, "alice") == 200) ASSERT_LT(readers_.size(), 40U);
  // They read on, byte by byte: each write of the server succeeds.
  EXPECT_TRUE(eventually([&] {
    for (const int one : readers_) {
      char byte = 0;
      static_cast<void>(recv(one, &byte, 1, MSG_DONTWAIT));
    }
    return whole_answer(id)->status == 200;
  }));
}

TEST_F(SlowReaders, DoNotHoldUpTheEndOfTheServer) {
  start({"--http-answer-rate", "1024", "--drain-grace-s", "3600"});
  const std::string id = kept_answer();
  for (int k = 0; k < 8; ++k) EXPECT_EQ(begin_to_read(id, "client " + std::to_string(k)), 200);
  server().terminate();
  EXPECT_EQ(server().wait(), 0);
}

TEST_F(SlowReaders, GetTheRestWhenTheServerStops) {
  start();
  const std::string id = kept_answer();
  const std::size_t size = whole_answer(id)->body.size();
  const int one = begin_to_read(id, "alice") == 200 ? readers_.back() : -1;
  server().terminate();
  ASSERT_TRUE(eventually([&] { return !server().log_lines({"draining"}).empty(); }));
  std::size_t all = 0;
  std::vector<char> bytes(1 << 20);
  for (ssize_t got = 1; got > 0; all += static_cast<std::size_t>(got))
    got = std::max<ssize_t>(0, recv(one, bytes.data(), bytes.size(), 0));
  EXPECT_GT(all, size);
  EXPECT_EQ(server().wait(), 0);
}

TEST_F(SlowReaders, GetAllOfItInTheEnd) {
  start();
  const std::string id = kept_answer();
  const auto whole = whole_answer(id);
  EXPECT_EQ(std::stoull(whole->get_header_value("Content-Length")), whole->body.size());
  EXPECT_EQ(Json::parse(whole->body).at("solution").at("z").size(), static_cast<std::size_t>(kNumbers));
  const auto head = client().Head("/api/jobs/" + id + "/result");
  EXPECT_EQ(head->get_header_value("Content-Length"), whole->get_header_value("Content-Length"));
}

}  // namespace
}  // namespace marble::testing
