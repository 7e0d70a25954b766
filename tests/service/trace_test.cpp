// A client's trace through the server: taken up by every call, reported in answers, logs and jobs.
#include <functional>
#include <map>

#include "secure_service_test.h"

namespace marble::testing {
namespace {

const char* const kTraceId = "4bf92f3577b34da6a3ce929d0e0e4736";
const char* const kParent = "00f067aa0ba902b7";

class Trace : public SecureServiceTest {
 protected:
  void start(const std::vector<std::string>& flags = {}) {
    ServiceTest::start(flags);
    jobs_ = v1::Jobs::NewStub(channel());
  }
  static std::string traceparent() { return std::string("00-") + kTraceId + "-" + kParent + "-01"; }
  /// What a call's initial metadata says of the key; all of them, with commas.
  static std::string returned(const grpc::ClientContext& context, const char* key = "traceparent") {
    std::string result;
    const auto [begin, end] = context.GetServerInitialMetadata().equal_range(key);
    for (auto one = begin; one != end; ++one)
      result += (result.empty() ? "" : ",") + std::string(one->second.data(), one->second.size());
    return result;
  }
  /// The server's span, if the text is a traceparent of the client's trace with a span of the server's own.
  static std::string span_of(const std::string& text) {
    const std::string head = std::string("00-") + kTraceId + "-";
    const bool good = text.size() == 55 && text.rfind(head, 0) == 0 && text.substr(52) == "-01" &&
                      text.find(kParent) == std::string::npos;
    return good ? text.substr(head.size(), 16) : "";
  }

  using Call = std::function<grpc::Status(grpc::ClientContext*)>;
  /// Every method, with requests that are answered if `good`, and refused if not.
  std::map<std::string, Call> calls(bool good) {
    const v1::SolveRequest request = good ? example_request() : v1::SolveRequest();
    std::map<std::string, Call> all;
    all["Solve"] = [=, this](auto* context) {
      v1::SolveResponse response;
      return solver().Solve(context, request, &response);
    };
    all["SolveStream"] = [=, this](auto* context) {
      v1::SolveStreamRequest streamed;
      *streamed.mutable_solve() = request;
      return read_all<v1::SolveStreamResponse>(*solver().SolveStream(context, streamed));
    };
    all["SolveScenarios"] = [=, this](auto* context) {
      v1::SolveStreamRequest streamed;
      *streamed.mutable_solve() = request;
      if (good) {
        streamed.mutable_solve()->mutable_scenarios()->add_first_stage(0);
        v1::ScenarioSamples* samples = streamed.mutable_solve()->mutable_scenarios()->mutable_samples();
        samples->add_entries()->set_part(v1::PROBLEM_PART_CONSTANT);
        samples->add_values(1.0);
      }
      return read_all<v1::SolveStreamResponse>(*solver().SolveScenarios(context, streamed));
    };
    all["SolveBatch"] = [=, this](auto* context) {
      v1::SolveBatchRequest one;
      *one.mutable_solve() = request;
      return write_and_read<v1::SolveBatchResponse>(*solver().SolveBatch(context), one);
    };
    all["Session"] = [=, this](auto* context) {
      v1::SessionRequest setup;
      *setup.mutable_setup()->mutable_problem() = request.problem();
      return write_and_read<v1::SessionResponse>(*solver().Session(context), setup);
    };
    all["Submit"] = [=, this](auto* context) {
      v1::SubmitResponse response;
      return jobs_->Submit(context, request, &response);
    };
    all["Get"] = job_call<v1::GetJobRequest, v1::GetJobResponse>(good, &v1::Jobs::Stub::Get);
    all["Cancel"] = job_call<v1::CancelJobRequest, v1::CancelJobResponse>(good, &v1::Jobs::Stub::Cancel);
    all["Result"] = job_call<v1::JobResultRequest, v1::SolveResponse>(good, &v1::Jobs::Stub::Result);
    all["Watch"] = [=, this](auto* context) {
      v1::WatchJobsRequest watch;
      watch.set_job_id(good ? job_ : "none");
      return read_all<v1::WatchJobsResponse>(*jobs_->Watch(context, watch));
    };
    all["List"] = [=, this](auto* context) {
      v1::ListJobsRequest list;
      list.set_limit(good ? 1 : -1);
      v1::ListJobsResponse response;
      return jobs_->List(context, list, &response);
    };
    all["Delete"] = [=, this](auto* context) {
      v1::DeleteJobRequest message;
      message.set_job_id(good ? submitted("another") : "none");
      v1::DeleteJobResponse response;
      return jobs_->Delete(context, message, &response);
    };
    return all;
  }
  template <class Request, class Response>
  Call job_call(bool good,
                grpc::Status (v1::Jobs::Stub::*method)(grpc::ClientContext*, const Request&, Response*)) {
    return [=, this](grpc::ClientContext* context) {
      Request request;
      request.set_job_id(good ? job_ : "none");
      if constexpr (std::is_same_v<Request, v1::JobResultRequest>) request.set_wait(true);
      Response response;
      return (jobs_.get()->*method)(context, request, &response);
    };
  }
  template <class Response, class Reader>
  static grpc::Status read_all(Reader& reader) {
    Response response;
    while (reader.Read(&response)) {
    }
    return reader.Finish();
  }
  template <class Response, class Stream, class Request>
  static grpc::Status write_and_read(Stream& stream, const Request& request) {
    stream.Write(request);
    stream.WritesDone();
    return read_all<Response>(stream);
  }
  std::string submitted(const std::string& request_id) {
    grpc::ClientContext context;
    context.AddMetadata("traceparent", traceparent());
    v1::SolveRequest request = example_request();
    request.set_request_id(request_id);
    v1::SubmitResponse response;
    EXPECT_TRUE(jobs_->Submit(&context, request, &response).ok());
    span_ = span_of(returned(context));
    return response.job_id();
  }
  v1::JobInfo job(const std::string& id) {
    grpc::ClientContext context;
    v1::GetJobRequest request;
    request.set_job_id(id);
    v1::GetJobResponse response;
    EXPECT_TRUE(jobs_->Get(&context, request, &response).ok());
    return response.job();
  }

  std::unique_ptr<v1::Jobs::Stub> jobs_;
  std::string job_;   // that calls of Jobs are about
  std::string span_;  // the server's, of the newest submission
};

TEST_F(Trace, GoesOnInEveryKindOfCall) {
  start();
  job_ = submitted("first");
  ASSERT_TRUE(eventually([&] { return job(job_).state() == v1::JOB_STATE_FINISHED; }))
      << "before it is cancelled";
  std::map<std::string, std::string> spans;
  for (const auto& [name, call] : calls(true)) {
    grpc::ClientContext context;
    context.AddMetadata("traceparent", traceparent());
    const grpc::Status status = call(&context);
    EXPECT_TRUE(status.ok()) << name << ": " << status.error_message();
    const std::string span = span_of(returned(context));
    EXPECT_NE(span, "") << name << ": " << returned(context);
    EXPECT_TRUE(spans.emplace(span, name).second) << name << " has the span of another call";
  }
}

TEST_F(Trace, GoesOnInRefusedCallsToo) {
  start();
  for (const auto& [name, call] : calls(false)) {
    grpc::ClientContext context;
    context.AddMetadata("traceparent", traceparent());
    const grpc::Status status = call(&context);
    EXPECT_EQ(status.ok(), name == "SolveBatch") << name << ": a batch refuses problem by problem";
    EXPECT_NE(span_of(returned(context)), "") << name << ": " << returned(context);
  }
}

TEST_F(Trace, GoesOnForThoseWhoAreNotKnown) {
  start({"--tokens", write("tokens", new_token("planner:solve").line)});
  for (const auto& [name, call] : calls(true)) {
    if (name == "Delete") continue;  // submits first
    grpc::ClientContext context;
    context.AddMetadata("traceparent", traceparent());
    EXPECT_EQ(call(&context).error_code(), grpc::StatusCode::UNAUTHENTICATED) << name;
    EXPECT_NE(span_of(returned(context)), "") << name << ": " << returned(context);
  }
  EXPECT_TRUE(eventually_logged({"refused component=access", std::string("trace_id=\"") + kTraceId + "\""}));
}

TEST_F(Trace, IsInTheLogAndInTheJob) {
  start();
  const std::string id = submitted("tick 17");
  ASSERT_TRUE(eventually_logged({"job component=job", "job=\"" + id + "\"", "request=\"tick 17\"",
                                 std::string("trace_id=\"") + kTraceId + "\"", "span_id=\"" + span_ + "\"",
                                 std::string("parent_span_id=\"") + kParent + "\""}))
      << server().log();
  EXPECT_EQ(job(id).trace_id(), kTraceId);
}

TEST_F(Trace, PassesItsStateOn) {
  start();
  grpc::ClientContext context;
  context.AddMetadata("traceparent", traceparent());
  context.AddMetadata("tracestate", "rojo=00f067aa0ba902b7");
  context.AddMetadata("tracestate", "congo=t61rcWkgMzE");
  v1::SolveResponse response;
  EXPECT_TRUE(solver().Solve(&context, example_request(), &response).ok());
  EXPECT_EQ(returned(context, "tracestate"), "rojo=00f067aa0ba902b7,congo=t61rcWkgMzE");
}

TEST_F(Trace, IsIgnoredWhereItIsNotValid) {
  start();
  const std::vector<Metadata> none = {{},
                                      {{"traceparent", "00-" + std::string(32, '0') + "-" + kParent + "-01"}},
                                      {{"traceparent", "ff" + traceparent().substr(2)}},
                                      {{"traceparent", traceparent() + "-more"}},
                                      {{"traceparent", std::string(100'000 / 16, 'a')}},
                                      {{"traceparent", traceparent()}, {"traceparent", traceparent()}},
                                      {{"tracestate", "rojo=1"}}};
  for (const Metadata& metadata : none) {
    grpc::ClientContext context;
    for (const auto& [key, value] : metadata) context.AddMetadata(key, value);
    v1::SolveResponse response;
    EXPECT_TRUE(solver().Solve(&context, example_request(), &response).ok());
    EXPECT_EQ(returned(context), "");
    EXPECT_EQ(returned(context, "tracestate"), "");
    EXPECT_EQ(job(response.job_id()).trace_id(), "");
  }
  EXPECT_TRUE(server().log_lines({"trace_id"}).empty()) << server().log();
}

}  // namespace
}  // namespace marble::testing
