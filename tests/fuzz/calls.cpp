// Every RPC of the contract on a gRPC server within the process: the real services, workers and streams. An
// input names the method and holds the messages that the client sends; some calls are cancelled after a few
// responses. A first message that is a SolveRequest is submitted before a call of the service Jobs, and its
// job is the one that the job_id "0" names. An array that is taken is read to its end. Every response parses;
// solutions are judged.
#include <google/protobuf/stubs/logging.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/server_builder.h>

#include <algorithm>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

#include "base/wire.h"
#include "calls/jobs_service.h"
#include "calls/solver_service.h"
#include "expect.h"
#include "marble/convert.h"
#include "requests/findings.h"
#include "requests/judge.h"
#include "requests/make.h"
#include "requests/mutate.h"
#include "requests/work.h"
#include "service/info_service.h"

using namespace marble;

namespace {

constexpr int kMostMessages = 12;
constexpr int kMostResponses = 64;

struct Received {
  std::vector<std::string> responses;
  grpc::Status status;
};

// The services without a port. Its jobs outlive an input: answers are dropped when there are too many.
class InProcessServer {
 public:
  InProcessServer() {
    grpc::ServerBuilder builder;
    for (grpc::Service* service : {static_cast<grpc::Service*>(&solver_), static_cast<grpc::Service*>(&jobs_),
                                   static_cast<grpc::Service*>(&info_)})
      builder.RegisterService(service);
    server_ = builder.BuildAndStart();
    FUZZ_EXPECT(server_ != nullptr);
    stub_ = std::make_unique<grpc::GenericStub>(server_->InProcessChannel({}));
  }

  // The new job's id, or none.
  [[nodiscard]] std::string submit(const std::string& bytes) {
    v1::SolveRequest request;
    if (!request.ParseFromString(bytes)) return {};
    fuzz::limit_budgets(&request);
    const Received received = call("Jobs/Submit", {request.SerializeAsString()}, kMostResponses);
    v1::SubmitResponse response;
    if (received.responses.empty() || !response.ParseFromString(received.responses[0])) return {};
    return response.job_id();
  }

  void remove(const std::string& job_id) {
    v1::DeleteJobRequest request;
    request.set_job_id(job_id);
    (void)call("Jobs/Delete", {request.SerializeAsString()}, kMostResponses);
  }

  // Sends the messages while it reads responses. Cancels after `most` responses, or after a time.
  [[nodiscard]] Received call(const std::string& method, const std::vector<std::string>& messages, int most) {
    enum Tag : std::intptr_t { start, write, writes_done, read, finish };
    const auto tag = [](Tag value) { return reinterpret_cast<void*>(static_cast<std::intptr_t>(value) + 1); };
    grpc::ClientContext context;
    const bool endless = method == "Jobs/Watch";
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::milliseconds(endless ? 40 : 60000));
    grpc::CompletionQueue events;
    const auto stream = stub_->PrepareCall(&context, "/marble.v1." + method, &events);
    Received received;
    std::size_t sent = 0;
    grpc::ByteBuffer response;
    const auto send = [&] {
      if (sent == messages.size()) return stream->WritesDone(tag(writes_done));
      const grpc::Slice slice(messages[sent++]);
      stream->Write(grpc::ByteBuffer(&slice, 1), tag(write));
    };
    stream->StartCall(tag(start));
    int pending = 1;
    bool is_finished = false;
    void* got = nullptr;
    bool ok = false;
    while (pending > 0 && events.Next(&got, &ok)) {
      --pending;
      switch (static_cast<Tag>(reinterpret_cast<std::intptr_t>(got) - 1)) {
        case start:
          if (ok) send(), stream->Read(&response, tag(read)), pending += 2;
          break;
        case write:
          if (ok) send(), ++pending;
          break;
        case read:
          if (!ok) break;
          received.responses.push_back(server::bytes_of(response));
          if (static_cast<int>(received.responses.size()) == most) context.TryCancel();
          stream->Read(&response, tag(read));
          ++pending;
          break;
        case writes_done:
        case finish:
          break;
      }
      if (pending == 0 && !is_finished) {
        is_finished = true;
        stream->Finish(&received.status, tag(finish));
        ++pending;
      }
    }
    events.Shutdown();
    while (events.Next(&got, &ok)) continue;
    return received;
  }

 private:
  fuzz::SmallParts parts_{1 << 20, 1 << 20};
  server::SolverService solver_{parts_.all};
  server::JobsService jobs_{parts_.all};
  server::InfoService info_{parts_.all};
  std::unique_ptr<grpc::Server> server_;
  std::unique_ptr<grpc::GenericStub> stub_;
};

// Bytes of a Message with small budgets and the id of the submitted job; other bytes stay as they are.
template <class Message>
std::string limited(const std::string& bytes, const std::string& job_id) {
  Message message;
  if (!message.ParseFromString(bytes)) return bytes;
  if constexpr (requires { message.mutable_element(); }) {
    if (message.has_setup()) fuzz::limit_budgets(message.mutable_setup()->mutable_options());
    if (message.has_element()) fuzz::limit_budgets(message.mutable_element()->mutable_solve());
  } else if constexpr (requires { message.set_job_id(job_id); }) {
    if (message.job_id() == "0") message.set_job_id(job_id);
  } else if constexpr (requires { fuzz::limit_budgets(&message); }) {
    fuzz::limit_budgets(&message);
  } else if constexpr (requires { message.mutable_solve(); }) {
    fuzz::limit_budgets(message.mutable_solve());
  } else if constexpr (requires { message.mutable_setup(); }) {
    if (message.has_setup()) fuzz::limit_budgets(message.mutable_setup()->mutable_options());
    if (message.has_update()) fuzz::limit_budgets(message.mutable_update()->mutable_options());
  }
  return message.SerializeAsString();
}

template <class Message>
Message parsed(const std::string& bytes) {
  Message message;
  FUZZ_EXPECT(message.ParseFromString(bytes));
  return message;
}

void judge(const v1::SolveRequest& request, const v1::SolveResponse& response) {
  const auto options = options_of(request.options());
  FUZZ_EXPECT(options.has_value());
  fuzz::judge_request(request, *options, response.solution());
}

void judge_solve(const std::vector<std::string>& sent, const Received& received) {
  if (sent.empty() || received.responses.empty()) return;
  judge(parsed<v1::SolveRequest>(sent[0]), parsed<v1::SolveResponse>(received.responses[0]));
}

void judge_stream(const std::vector<std::string>& sent, const Received& received) {
  for (std::size_t k = 0; k < received.responses.size(); ++k) {
    const auto event = parsed<v1::SolveStreamResponse>(received.responses[k]);
    FUZZ_EXPECT(event.has_accepted() == (k == 0));
    if (!event.has_result()) continue;
    FUZZ_EXPECT(k + 1 == received.responses.size());
    judge(parsed<v1::SolveStreamRequest>(sent[0]).solve(), event.result());
  }
}

void judge_batch(const std::vector<std::string>& sent, const Received& received) {
  FUZZ_EXPECT(received.responses.size() <= sent.size());
  for (const std::string& bytes : received.responses) {
    const auto response = parsed<v1::SolveBatchResponse>(bytes);
    if (response.has_error()) {
      FUZZ_EXPECT(response.error().code() != 0 && !response.error().message().empty());
      continue;
    }
    std::vector<v1::SolveBatchRequest> same_tag;
    for (const std::string& request : sent) {
      v1::SolveBatchRequest message;
      if (message.ParseFromString(request) && message.tag() == response.tag())
        same_tag.push_back(std::move(message));
    }
    FUZZ_EXPECT(!same_tag.empty());
    if (same_tag.size() == 1) judge(same_tag[0].solve(), response.result());
  }
}

// Each element once, in the order of the numbers; what has a problem of its own is judged.
void judge_answers(const std::vector<std::string>& sent, const Received& received) {
  std::vector<v1::ArrayElement> elements;
  v1::ArraySetup setup;
  for (const std::string& bytes : sent) {
    v1::SubmitArrayRequest message;
    if (!message.ParseFromString(bytes)) continue;
    if (message.has_setup()) setup = message.setup();
    if (message.has_element()) elements.push_back(message.element());
    if (message.has_end()) break;  // nothing is read after it
  }
  std::vector<bool> answered(elements.size());
  std::int64_t sequence = 0;
  for (const std::string& bytes : received.responses) {
    const auto response = parsed<v1::ArrayResultsResponse>(bytes);
    FUZZ_EXPECT(response.sequence() == ++sequence);
    const auto index = static_cast<std::size_t>(response.index());
    FUZZ_EXPECT(index < answered.size() && !answered[index]);
    answered[index] = true;
    FUZZ_EXPECT(response.has_result() || response.error().code() != 0);
    v1::SolveRequest request = elements[index].solve();
    if (!response.has_result() || !request.has_problem()) continue;
    v1::SolveOptions options = setup.options();
    options.MergeFrom(request.options());
    *request.mutable_options() = options;
    judge(request, response.result());
  }
  const bool all = std::ranges::all_of(answered, [](bool one) { return one; });
  FUZZ_EXPECT(all == received.status.ok() || received.status.error_code() == grpc::StatusCode::CANCELLED);
}

template <class Message>
void expect_messages(const std::vector<std::string>& /*sent*/, const Received& received) {
  for (const std::string& bytes : received.responses) (void)parsed<Message>(bytes);
}

// One element of a batch, or the only message of another call.
template <class Message>
Message make_message(fuzz::Draw& draw) {
  Message message;
  if constexpr (std::is_same_v<Message, v1::SolveRequest>) {
    message = fuzz::make_any_solve(draw);
  } else if constexpr (requires { message.mutable_solve(); }) {
    *message.mutable_solve() = fuzz::make_any_solve(draw);
    if constexpr (requires { message.set_tag(0); }) message.set_tag(draw.between(0, 9));
    if constexpr (requires { message.set_iterate_every(0); }) message.set_iterate_every(draw.between(0, 2));
  } else if constexpr (requires { message.set_job_id("0"); }) {
    message.set_job_id("0");
  }
  return message;
}

void make_array(fuzz::Draw& draw, fuzz::Script* script) {
  v1::SubmitArrayRequest message;
  if (draw.chance(60)) *message.mutable_setup()->mutable_problem() = fuzz::make_problem(draw);
  const v1::Problem base = message.setup().problem();
  if (draw.chance(20)) message.mutable_setup()->set_request_id("again");
  message.mutable_setup()->set_priority(static_cast<v1::Priority>(draw.between(0, 3)));
  script->add_details()->PackFrom(message);
  const int elements = draw.between(1, 4);
  for (int k = 0; k < elements; ++k) {
    v1::ArrayElement& element = *message.mutable_element();
    element.Clear();
    if (base.gradient_size() == 0 || draw.chance(30)) {
      *element.mutable_solve() = fuzz::make_any_solve(draw);
      element.mutable_solve()->clear_request_id();
      element.mutable_solve()->clear_priority();
    } else if (draw.chance(90)) {
      *element.mutable_update()->mutable_gradient() = base.gradient();
      for (double& value : *element.mutable_update()->mutable_gradient()) value += draw.between(-2, 2);
    }
    script->add_details()->PackFrom(message);
  }
  message.mutable_end()->set_elements(draw.chance(95) ? elements : draw.between(0, 9));
  script->add_details()->PackFrom(message);
}

template <class Message>
void make_messages(fuzz::Draw& draw, fuzz::Script* script) {
  if constexpr (std::is_same_v<Message, v1::SubmitArrayRequest>) {
    make_array(draw, script);
  } else if constexpr (std::is_same_v<Message, v1::SessionRequest>) {
    *script = fuzz::make_session(draw);
  } else {
    if (script->message().starts_with("Jobs/") && draw.chance(80))
      script->add_details()->PackFrom(fuzz::make_any_solve(draw));
    const int most = std::is_same_v<Message, v1::SolveBatchRequest> ? 4 : 1;
    for (int k = draw.between(1, most); k > 0; --k)
      script->add_details()->PackFrom(make_message<Message>(draw));
  }
}

struct Rpc {
  const char* name;
  void (*make)(fuzz::Draw&, fuzz::Script*);
  std::string (*limit)(const std::string& bytes, const std::string& job_id);
  void (*judge)(const std::vector<std::string>&, const Received&);
};
template <class Request, class Response>
constexpr Rpc rpc_of(const char* name) {
  return {name, make_messages<Request>, limited<Request>, expect_messages<Response>};
}
template <class Request>
constexpr Rpc rpc_of(const char* name, void (*judge)(const std::vector<std::string>&, const Received&)) {
  return {name, make_messages<Request>, limited<Request>, judge};
}
constexpr const char* kSubmitArray = "Jobs/SubmitArray";
constexpr Rpc kRpcs[] = {rpc_of<v1::SolveRequest>("Solver/Solve", judge_solve),
                         rpc_of<v1::SolveStreamRequest>("Solver/SolveStream", judge_stream),
                         rpc_of<v1::SolveStreamRequest>("Solver/SolveScenarios", judge_stream),
                         rpc_of<v1::SolveStreamRequest>("Solver/SolveCoupled", judge_stream),
                         rpc_of<v1::SolveBatchRequest>("Solver/SolveBatch", judge_batch),
                         rpc_of<v1::SessionRequest, v1::SessionResponse>("Solver/Session"),
                         rpc_of<v1::SolveRequest, v1::SubmitResponse>("Jobs/Submit"),
                         rpc_of<v1::JobResultRequest, v1::SolveResponse>("Jobs/Result"),
                         rpc_of<v1::DeleteJobRequest, v1::DeleteJobResponse>("Jobs/Delete"),
                         rpc_of<v1::ListJobsRequest, v1::ListJobsResponse>("Jobs/List"),
                         rpc_of<v1::GetJobRequest, v1::GetJobResponse>("Jobs/Get"),
                         rpc_of<v1::CancelJobRequest, v1::CancelJobResponse>("Jobs/Cancel"),
                         rpc_of<v1::WatchJobsRequest, v1::WatchJobsResponse>("Jobs/Watch"),
                         rpc_of<v1::JobBundleRequest, v1::JobBundleResponse>("Jobs/Bundle"),
                         rpc_of<v1::SubmitArrayRequest, v1::SubmitArrayResponse>(kSubmitArray),
                         rpc_of<v1::ArrayResultsRequest, v1::ArrayResultsResponse>("Jobs/ArrayResults"),
                         rpc_of<v1::GetInfoRequest, v1::GetInfoResponse>("Server/GetInfo")};

// A script's message is the method's name, its code the number of responses to read; 0 reads all.
fuzz::Script make_call(fuzz::Draw& draw) {
  const Rpc& method = kRpcs[draw.below(std::size(kRpcs))];
  fuzz::Script script;
  script.set_message(method.name);
  method.make(draw, &script);
  script.set_message(method.name);
  script.set_code(draw.chance(80) ? 0 : draw.between(1, 3));
  return script;
}

}  // namespace

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t most,
                                               unsigned seed) {
  return fuzz::mutate_bytes<fuzz::Script>(data, size, most, seed, make_call);
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return fuzz::judged(data, size, [&] {
    static const google::protobuf::LogSilencer silence;
    static InProcessServer server;
    fuzz::Script script;
    if (!script.ParseFromArray(data, static_cast<int>(size))) return;
    if (script.message().find('\0') != std::string::npos) return;  // gRPC's client ends the name there
    const auto* method = std::ranges::find(kRpcs, script.message(), &Rpc::name);
    const bool known = method != std::end(kRpcs);
    auto details = script.details().begin();
    std::string job_id;
    if (script.message().starts_with("Jobs/") && script.details_size() > 1 && details->Is<v1::SolveRequest>())
      job_id = server.submit((details++)->value());
    std::vector<std::string> messages;
    for (; details != script.details().end() && messages.size() < kMostMessages; ++details)
      messages.push_back(known ? method->limit(details->value(), job_id) : details->value());
    const int most = script.code() > 0 ? script.code() : kMostResponses;
    const Received received = server.call(script.message(), messages, most);
    if (!job_id.empty()) server.remove(job_id);
    FUZZ_EXPECT(known || !received.status.ok());
    FUZZ_EXPECT(received.status.error_code() != grpc::StatusCode::INTERNAL);
    FUZZ_EXPECT(received.status.error_code() != grpc::StatusCode::UNKNOWN);
    if (!received.status.ok()) {
      ++fuzz::tally().refused;
      FUZZ_EXPECT(!known || !received.status.error_message().empty());
    }
    if (known) method->judge(messages, received);
    if (script.message() != kSubmitArray || received.responses.empty()) return;
    v1::ArrayResultsRequest array;
    array.set_job_id(parsed<v1::SubmitArrayResponse>(received.responses[0]).job_id());
    judge_answers(messages, server.call("Jobs/ArrayResults", {array.SerializeAsString()}, kMostResponses));
    server.remove(array.job_id());
  });
}
