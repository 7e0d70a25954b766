#include <gtest/gtest.h>

#include "http_service_test.h"
#include "secure_service_test.h"
#include "service/job_requests.h"
#include "service_test.h"
#include "support/raw_http2.h"

namespace marble::testing {
namespace {

// Symptom: two Jobs.Bundle calls whose client took nothing kept everyone else from bundles, for as long as
// that client liked: RESOURCE_EXHAUSTED "bundles = 2". Cause: the server counted bundles in all, without a
// share of a client and without a time.
using Reader = std::unique_ptr<grpc::ClientReader<v1::JobBundleResponse>>;

class HeldBundles : public SecureServiceTest {
 protected:
  void start_with(std::vector<std::string> flags) {
    flags.insert(flags.end(), {"--tokens", write("tokens", alice_.line + bob_.line)});
    start(flags);
    jobs_ = v1::Jobs::NewStub(channel());
  }
  static std::unique_ptr<grpc::ClientContext> as(const Token& who) {
    auto context = std::make_unique<grpc::ClientContext>();
    context->AddMetadata("authorization", "Bearer " + who.secret);
    return context;
  }
  // A finished job with a request of some megabytes, more than what flow control lets through unasked.
  std::string finished(const Token& who) {
    v1::SolveRequest request = example_request();
    auto& problem = *request.mutable_problem();
    const int n = 200'000;
    problem.Clear();
    problem.mutable_hessian()->set_rows(n);
    problem.mutable_hessian()->set_columns(n);
    for (int i = 0; i < n; ++i) {
      problem.add_gradient(1.0 / (i + 3));
      problem.mutable_hessian()->add_column_pointers(i);
      problem.mutable_hessian()->add_row_indices(i);
      problem.mutable_hessian()->add_values(2.0);
    }
    problem.mutable_hessian()->add_column_pointers(n);
    request.clear_initial_point();
    const auto context = as(who);
    v1::SubmitResponse submitted;
    EXPECT_TRUE(jobs_->Submit(context.get(), request, &submitted).ok());
    const auto waiting = as(who);
    v1::JobResultRequest which;
    which.set_job_id(submitted.job_id());
    which.set_wait(true);
    v1::SolveResponse answer;
    EXPECT_TRUE(jobs_->Result(waiting.get(), which, &answer).ok());
    return submitted.job_id();
  }
  // A call of its own connection that takes nothing: no window is ever opened.
  std::unique_ptr<RawHttp2> hold(const Token& who, const std::string& id) {
    auto raw = std::make_unique<RawHttp2>(server().address());
    raw->begin();
    v1::JobBundleRequest request;
    request.set_job_id(id);
    raw->call(1, "/marble.v1.Jobs/Bundle", {{"authorization", "Bearer " + who.secret}});
    raw->send(RawHttp2::frame(RawHttp2::kData, RawHttp2::kEndStream, 1,
                              RawHttp2::message(request.SerializeAsString())));
    return raw;
  }
  // All of a bundle.
  grpc::Status take(const Token& who, const std::string& id, std::size_t* bytes = nullptr) {
    const auto context = as(who);
    v1::JobBundleRequest request;
    request.set_job_id(id);
    const Reader reader = jobs_->Bundle(context.get(), request);
    for (v1::JobBundleResponse piece; reader->Read(&piece);) {
      if (bytes != nullptr) *bytes += piece.request().size() + piece.answer().size();
    }
    return reader->Finish();
  }

  const Token alice_ = new_token("alice:solve"), bob_ = new_token("bob:solve");
  std::unique_ptr<v1::Jobs::Stub> jobs_;
};

TEST_F(HeldBundles, LeaveAPlaceToOtherClients) {
  start_with({"--bundle-idle-s", "86400"});
  const std::string hers = finished(alice_), his = finished(bob_);
  const auto first = hold(alice_, hers), second = hold(alice_, hers), third = hold(alice_, hers);
  for (const auto& held : {&first, &second, &third}) ASSERT_TRUE((*held)->eventually_answered(1));
  const grpc::Status refused = take(alice_, hers);
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_NE(refused.error_message().find("client_bundles"), std::string::npos) << refused.error_message();
  std::size_t bytes = 0;
  const grpc::Status status = take(bob_, his, &bytes);
  EXPECT_TRUE(status.ok()) << status.error_message();
  EXPECT_GT(bytes, 3'000'000U);
}

TEST_F(HeldBundles, EndAfterATime) {
  start_with({"--bundle-idle-s", "0.2", "--bundles", "1"});
  const std::string hers = finished(alice_), his = finished(bob_);
  const auto held = hold(alice_, hers);
  EXPECT_TRUE(held->eventually_ended(1)) << "it is cut off in the end";
  EXPECT_FALSE(held->is_closed()) << "and its connection stays";
  EXPECT_TRUE(eventually([&] { return take(bob_, his).ok(); }));
  EXPECT_TRUE(eventually([&] { return take(alice_, hers).ok(); }));
}

TEST_F(HeldBundles, ReportAClientThatReadsOnWhyTheyEnded) {
  start_with({"--bundle-idle-s", "0.2", "--bundles", "1"});
  const std::string hers = finished(alice_), his = finished(bob_);
  const auto context = as(alice_);
  v1::JobBundleRequest request;
  request.set_job_id(hers);
  grpc::ChannelArguments narrow;  // or all of it may come before it is read
  narrow.SetInt(GRPC_ARG_HTTP2_BDP_PROBE, 0);
  narrow.SetInt(GRPC_ARG_HTTP2_STREAM_LOOKAHEAD_BYTES, 1 << 16);
  const auto jobs = v1::Jobs::NewStub(
      grpc::CreateCustomChannel(server().address(), grpc::InsecureChannelCredentials(), narrow));
  const Reader reader = jobs->Bundle(context.get(), request);
  v1::JobBundleResponse piece;
  ASSERT_TRUE(reader->Read(&piece));
  ASSERT_TRUE(eventually([&] { return take(bob_, his).ok(); })) << "its place was not given back";
  while (reader->Read(&piece)) {
  }
  const grpc::Status status = reader->Finish();
  EXPECT_TRUE((status.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED &&
               status.error_message().find("bundle_idle_s") != std::string::npos) ||
              status.error_code() == grpc::StatusCode::CANCELLED)
      << status.error_code() << " " << status.error_message();
}

}  // namespace
}  // namespace marble::testing

namespace marble::server {
namespace {

// A client that listed jobs "before" another client's job learned whether it exists: an empty page if it did,
// NOT_FOUND if it did not. The page was cut at any job of the board, whichever client's it was.
TEST(JobIds, AnothersJobIsAnsweredLikeNoneWhenItIsThePagesEnd) {
  JobBoard board({});
  board.add(board.make({.id = "hers", .client = "alice"}, {}));
  board.add(board.make({.id = "his", .client = "bob"}, {}));
  const Identity bob{"bob", {Role::solve}};
  const auto list = [&](const std::string& before) {
    v1::ListJobsRequest request;
    request.set_before_job_id(before);
    v1::ListJobsResponse response;
    return list_jobs(board, bob, request, &response);
  };
  EXPECT_TRUE(list("his").has_value());
  ASSERT_FALSE(list("hers").has_value());
  const Error foreign = list("hers").error(), unknown = list("none").error();
  EXPECT_EQ(foreign.code, unknown.code);
  EXPECT_EQ(foreign.field, unknown.field);
  EXPECT_EQ(foreign.bound, unknown.bound);
  EXPECT_EQ(foreign.value, "hers");
}

}  // namespace
}  // namespace marble::server

namespace marble::testing {
namespace {

// Symptom: a thousand calls of Jobs.Result for one kept answer of 4 MB, on a connection that read none of
// them, took 3.9 GB for as long as it liked: each call had a copy of its own.
class KeptAnswer : public HttpServiceTest {};

TEST_F(KeptAnswer, IsHeldOnceForAllWhoAskForIt) {
  start();
  constexpr int kVariables = 500'000;
  constexpr int kCalls = 1000;
  v1::SolveRequest request;
  v1::Problem& problem = *request.mutable_problem();
  problem.mutable_gradient()->Resize(kVariables, -1.0);
  v1::SparseMatrix& hessian = *problem.mutable_hessian();
  hessian.set_rows(kVariables);
  hessian.set_columns(kVariables);
  for (int i = 0; i < kVariables; ++i) {
    hessian.add_column_pointers(i);
    hessian.add_row_indices(i);
    hessian.add_values(2.0);
  }
  hessian.add_column_pointers(kVariables);
  const auto jobs = v1::Jobs::NewStub(channel());
  v1::SubmitResponse submitted;
  {
    grpc::ClientContext context;
    ASSERT_TRUE(jobs->Submit(&context, request, &submitted).ok());
  }
  v1::JobResultRequest wanted;
  wanted.set_job_id(submitted.job_id());
  wanted.set_wait(true);
  {
    grpc::ClientContext context;
    v1::SolveResponse response;
    ASSERT_TRUE(jobs->Result(&context, wanted, &response).ok());
    ASSERT_GT(response.ByteSizeLong(), 4'000'000U);
  }
  const std::int64_t before = resident_bytes(server().pid(), "VmRSS");
  RawHttp2 raw(server().address());
  raw.begin();
  for (std::uint32_t i = 0; i < kCalls; ++i) {
    raw.call(2 * i + 1, "/marble.v1.Jobs/Result");
    raw.send(RawHttp2::frame(RawHttp2::kData, RawHttp2::kEndStream, 2 * i + 1,
                             RawHttp2::message(wanted.SerializeAsString())));
  }
  const std::string all_reported =
      "marble_rpcs_total{code=\"OK\",method=\"marble.v1.Jobs/Result\"} " + std::to_string(kCalls + 1);
  ASSERT_TRUE(eventually([&] { return get("/metrics")->body.find(all_reported) != std::string::npos; }));
  EXPECT_LT(resident_bytes(server().pid(), "VmRSS") - before, 256 << 20);
  EXPECT_TRUE(lives());
}

// Symptom: a job id of 9 kB and more got RESOURCE_EXHAUSTED "received metadata size exceeds" and not
// NOT_FOUND: the error contained the whole id, and did not fit into the trailers.
class LongId : public ServiceTest {};

TEST_F(LongId, IsReportedByItsBeginningAndItsLength) {
  start();
  const auto jobs = v1::Jobs::NewStub(channel());
  v1::GetJobRequest get;
  get.set_job_id(std::string(63, 'x') + "\u00e4" + std::string(100'000, 'x'));  // cut within a character
  v1::GetJobResponse job;
  grpc::ClientContext context;
  const grpc::Status status = jobs->Get(&context, get, &job);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::NOT_FOUND) << status.error_message();
  EXPECT_EQ(status.error_message(),
            "job_id = " + std::string(63, 'x') + "... (100065 bytes): is no job that is remembered");
  v1::ListJobsRequest list;
  list.set_before_job_id(std::string(100'000, 'y'));
  v1::ListJobsResponse page;
  grpc::ClientContext another;
  EXPECT_EQ(jobs->List(&another, list, &page).error_code(), grpc::StatusCode::NOT_FOUND);
}

}  // namespace
}  // namespace marble::testing
