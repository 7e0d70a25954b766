#include "service_test.h"

#include <grpcpp/generic/generic_stub.h>

#include "google/rpc/status.pb.h"

namespace marble::testing {
namespace {

template <class Detail>
std::optional<Detail> detail_of(const grpc::Status& status) {
  google::rpc::Status details;
  if (!details.ParseFromString(status.error_details())) return std::nullopt;
  for (const auto& any : details.details()) {
    Detail detail;
    if (any.UnpackTo(&detail)) return detail;
  }
  return std::nullopt;
}

void set_deadline(grpc::ClientContext& context, std::optional<std::chrono::milliseconds> deadline) {
  if (deadline) context.set_deadline(std::chrono::system_clock::now() + *deadline);
}

v1::SolveStreamRequest streamed(const v1::SolveRequest& request) {
  v1::SolveStreamRequest result;
  *result.mutable_solve() = request;
  return result;
}

}  // namespace

std::shared_ptr<grpc::Channel> connect(const std::string& address) {
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(-1);
  arguments.SetMaxSendMessageSize(-1);
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);  // a connection of its own
  return grpc::CreateCustomChannel(address, grpc::InsecureChannelCredentials(), arguments);
}

RawAnswer raw_call(const std::shared_ptr<grpc::Channel>& channel, const std::string& method,
                   const std::string& bytes, const std::string& token) {
  grpc::GenericStub stub(channel);
  grpc::ClientContext context;
  if (!token.empty()) context.AddMetadata("authorization", "Bearer " + token);
  grpc::CompletionQueue queue;
  const auto wait = [&] {
    void* tag = nullptr;
    bool ok = false;
    return queue.Next(&tag, &ok) && ok;
  };
  const auto call = stub.PrepareCall(&context, method, &queue);
  call->StartCall(nullptr);
  wait();
  const grpc::Slice slice(bytes);
  call->WriteLast(grpc::ByteBuffer(&slice, 1), grpc::WriteOptions(), nullptr);
  wait();
  grpc::ByteBuffer message;
  call->Read(&message, nullptr);
  RawAnswer answer;
  if (wait()) {
    grpc::Slice whole;
    if (message.DumpToSingleSlice(&whole).ok()) answer.bytes.assign(whole.begin(), whole.end());
  }
  call->Finish(&answer.status, nullptr);
  wait();
  return answer;
}

google::rpc::BadRequest::FieldViolation bad_field(const grpc::Status& status) {
  const auto bad_request = detail_of<google::rpc::BadRequest>(status);
  return bad_request && bad_request->field_violations_size() > 0 ? bad_request->field_violations(0)
                                                                 : google::rpc::BadRequest::FieldViolation();
}

std::optional<google::rpc::RetryInfo> retry_info(const grpc::Status& status) {
  return detail_of<google::rpc::RetryInfo>(status);
}

Stream::Stream(v1::Solver::Stub& stub, const v1::SolveRequest& request,
               std::optional<std::chrono::milliseconds> deadline) {
  set_deadline(context_, deadline);
  reader_ = stub.SolveStream(&context_, streamed(request));
}

Stream::Stream(v1::Solver::Stub& stub, const v1::SolveStreamRequest& request)
    : reader_(stub.SolveStream(&context_, request)) {}

Stream::~Stream() {
  if (finished_) return;
  cancel();
  finish();
}

std::optional<Event> Stream::next() {
  Event event;
  if (!reader_->Read(&event)) return std::nullopt;
  return event;
}

bool Stream::read_until(Event::EventCase kind) {
  while (const auto event = next()) {
    if (event->event_case() == kind) return true;
  }
  return false;
}

std::vector<Event> Stream::drain() {
  std::vector<Event> events;
  while (auto event = next()) events.push_back(*std::move(event));
  return events;
}

grpc::Status Stream::finish() {
  for (Event event; reader_->Read(&event);) {
  }
  finished_ = true;
  return reader_->Finish();
}

void ServiceTest::start(const std::vector<std::string>& flags) {
  server_ = std::make_unique<ServerProcess>(MARBLE_SERVER_BINARY, flags);
  channel_ = connect(server_->address());
  solver_ = v1::Solver::NewStub(channel_);
  info_ = v1::Server::NewStub(channel_);
}

void ServiceTest::TearDown() {
  if (server_ == nullptr) return;
  if (server_->running()) {
    server_->terminate();
    ASSERT_TRUE(eventually([&] { return !server_->log_lines({"draining"}).empty(); }));
    server_->terminate();  // no grace
    EXPECT_EQ(server_->wait(), 0);
  }
  EXPECT_TRUE(server_->log_lines({"Sanitizer"}).empty()) << server_->log();
}

grpc::Status ServiceTest::solve(const v1::SolveRequest& request, v1::SolveResponse* response,
                                std::optional<std::chrono::milliseconds> deadline) {
  grpc::ClientContext context;
  set_deadline(context, deadline);
  return solver_->Solve(&context, request, response);
}

bool ServiceTest::lives() {
  v1::SolveResponse response;
  return solve(example_request(), &response).ok() && response.solution().status() == v1::STATUS_SOLVED;
}

v1::Counters ServiceTest::counters() {
  grpc::ClientContext context;
  v1::GetInfoResponse response;
  const grpc::Status status = info_->GetInfo(&context, {}, &response);
  EXPECT_TRUE(status.ok()) << status.error_message();
  return response.counters();
}

bool ServiceTest::eventually_idle() {
  return eventually([&] {
    const v1::Counters now = counters();
    return now.queued() == 0 && now.running() == 0 &&
           now.accepted_total() == now.answered_total() + now.cancelled_total() + now.failed_total();
  });
}

std::string ServiceTest::health() {
  const RawAnswer answer = raw_call(channel_, "/grpc.health.v1.Health/Check", "");
  if (!answer.status.ok()) return answer.status.error_message();
  if (answer.bytes == std::string("\x08\x01")) return "SERVING";
  if (answer.bytes == std::string("\x08\x02")) return "NOT_SERVING";
  return "UNKNOWN";
}

}  // namespace marble::testing
