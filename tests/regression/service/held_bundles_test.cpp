// Symptom: two Jobs.Bundle calls whose client took nothing kept everyone else from bundles, for as long as
// that client liked: RESOURCE_EXHAUSTED "bundles = 2". Cause: the server counted bundles in all, without a
// share of a client and without a time.
#include "secure_service_test.h"
#include "support/raw_http2.h"

namespace marble::testing {
namespace {

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
