// Symptom: at SIGTERM under load one to three calls ended with CANCELLED, which nobody retries, instead of
// UNAVAILABLE; streams that the drain ended said UNAVAILABLE without when to come back.
// Cause: gRPC answers a call that arrives during its shutdown with CANCELLED. 200 ms were left for those who
// had just been refused to be refused again: but a client that goes on asking is never done.
// Then connections were cut under those who go on asking: one call of most clients ended with "Socket
// closed", and some of these had been refused, or solved, by a server whose words came too late; so had a
// call whose message was still on its way.
#include <grpcpp/generic/generic_stub.h>
#include <httplib.h>

#include <regex>
#include <thread>

#include "service/bidi.h"
#include "service/service_test.h"

namespace marble::testing {
namespace {

using grpc::StatusCode;

class StopUnderLoad : public ServiceTest {
 protected:
  /// What its last line in the log says of this.
  int reported_at_the_end(const std::string& field) {
    const std::vector<std::string> lines = server().log_lines({" stopped "});
    std::smatch match;
    if (lines.size() != 1 || !std::regex_search(lines[0], match, std::regex(" " + field + "=([0-9]+)")))
      return -1;
    return std::stoi(match[1]);
  }
};

TEST_F(StopUnderLoad, WhoeverGoesOnAskingHearsWhateverWasAnswered) {
  for (int restart = 0; restart < 5; ++restart) {
    start({"--workers", "2", "--client-queued", "0"});
    constexpr int kClients = 16;
    std::atomic<bool> ended = false;
    std::atomic<int> solved = 0, refused = 0;
    std::vector<std::thread> clients;
    for (int c = 0; c < kClients; ++c) {
      clients.emplace_back([&, one = connect(server().address())] {
        const auto stub = v1::Solver::NewStub(one);
        while (!ended) {
          grpc::ClientContext context;
          v1::SolveResponse response;
          const grpc::Status status = stub->Solve(&context, example_request(), &response);
          if (status.ok()) {
            ++solved;
            continue;
          }
          EXPECT_EQ(status.error_code(), StatusCode::UNAVAILABLE)
              << status.error_code() << " " << status.error_message();
          if (!retry_info(status)) break;  // nobody is there any more
          ++refused;
        }
      });
    }
    EXPECT_TRUE(eventually([&] { return solved > 10 * kClients; }));
    server().terminate();
    EXPECT_EQ(server().wait(), 0);
    ended = true;
    for (std::thread& client : clients) client.join();
    EXPECT_EQ(reported_at_the_end("answered"), solved) << server().log();
    EXPECT_EQ(reported_at_the_end("refused"), refused) << server().log();
  }
}

TEST_F(StopUnderLoad, ACallWhoseMessageHasNotComeIsReportedWhenToComeBack) {
  start({"--http", "127.0.0.1:0"});
  grpc::GenericStub stub(channel());
  grpc::ClientContext context;
  grpc::CompletionQueue queue;
  const auto call = stub.PrepareCall(&context, "/marble.v1.Solver/Solve", &queue);
  const auto wait = [&] {
    void* tag = nullptr;
    bool ok = false;
    return queue.Next(&tag, &ok) && ok;
  };
  call->StartCall(nullptr);
  ASSERT_TRUE(wait());
  httplib::Client http(server().http());
  ASSERT_TRUE(eventually([&] {
    const auto metrics = http.Get("/metrics");
    return metrics &&
           metrics->body.find("marble_rpcs_open{method=\"marble.v1.Solver/Solve\"} 1") != std::string::npos;
  })) << http.Get("/metrics")->body;
  server().terminate();
  grpc::Status status;
  call->Finish(&status, nullptr);
  EXPECT_TRUE(wait());
  EXPECT_EQ(status.error_code(), StatusCode::UNAVAILABLE) << status.error_message();
  EXPECT_TRUE(retry_info(status)) << status.error_message();
  EXPECT_EQ(server().wait(), 0);
}

TEST_F(StopUnderLoad, EveryStreamThatItEndsIsReportedWhenToComeBack) {
  start({"--workers", "1", "--drain-grace-s", "3600"});
  Stream running(solver(), long_request());  // until the second signal
  ASSERT_TRUE(running.read_until(Event::kStarted));
  Bidi<v1::SessionRequest, v1::SessionResponse> session(
      [this](grpc::ClientContext* context) { return solver().Session(context); });
  Bidi<v1::SolveBatchRequest, v1::SolveBatchResponse> batch(
      [this](grpc::ClientContext* context) { return solver().SolveBatch(context); });
  const auto jobs = v1::Jobs::NewStub(channel());
  grpc::ClientContext watching;
  const auto watch = jobs->Watch(&watching, v1::WatchJobsRequest());
  v1::WatchJobsResponse event;
  ASSERT_TRUE(watch->Read(&event)) << "it is open";
  server().terminate();
  const grpc::Status of_session = session.finish(), of_batch = batch.finish();
  server().terminate();
  while (watch->Read(&event)) {
  }
  for (const grpc::Status& status : {of_session, of_batch, watch->Finish()}) {
    EXPECT_EQ(status.error_code(), StatusCode::UNAVAILABLE) << status.error_message();
    EXPECT_TRUE(retry_info(status)) << status.error_message();
  }
  EXPECT_EQ(server().wait(), 0);
}

}  // namespace
}  // namespace marble::testing
