#include "marble/client.h"

#include <grpcpp/client_context.h>

#include <cstdlib>
#include <new>

#include "channel.h"
#include "grpc/health/v1/health.grpc.pb.h"
#include "marble/convert.h"
#include "marble/v1/service.grpc.pb.h"
#include "request.h"
#include "status.h"

namespace marble {
namespace {

constexpr std::chrono::duration<double> kQuickCall{5.0};  // for calls that no solve stands behind
constexpr std::chrono::duration<double> kLongestDeadline{std::int32_t{0x7fffffff}};

// gRPC takes a time before 1970 for "never": what is negative has passed now.
void set_deadline(std::chrono::duration<double> from_now, grpc::ClientContext& context) {
  if (!(from_now < kLongestDeadline)) from_now = kLongestDeadline;  // also NaN
  if (from_now.count() < 0.0) from_now = std::chrono::duration<double>::zero();
  context.set_deadline(std::chrono::system_clock::now() +
                       std::chrono::duration_cast<std::chrono::system_clock::duration>(from_now));
}

RemoteSolution remote_solution(const v1::SolveResponse& response) {
  const v1::Times& times = response.solution().times();
  return {solution_of(response.solution()), response.job_id(), times.queue_s(), times.total_s(), 0};
}

void deliver(const v1::SolveStreamResponse& event, ProgressSink* progress, const CallControls& call) {
  if (event.has_accepted() && call.accepted) {
    call.accepted(event.accepted().job_id(), event.accepted().queue_position());
  } else if (event.has_started() && call.started) {
    call.started(event.started().queue_s());
  } else if (event.has_progress() && progress != nullptr) {
    for (const v1::Progress& row : event.progress().rows()) progress->report(progress_of(row));
  }
}

Error out_of_memory() { return {ErrorCode::resource_exhausted, "", -1, "", "this process is out of memory"}; }

}  // namespace

std::string default_server_address() {
  const char* address = std::getenv("MARBLE_SERVER");
  return address != nullptr && *address != '\0' ? address : "127.0.0.1:50051";
}

struct Client::Connection {
  explicit Connection(const std::string& server_address)
      : address(server_address),
        channel(client::open_channel(address)),
        solver(v1::Solver::NewStub(channel)),
        server(v1::Server::NewStub(channel)),
        health(grpc::health::v1::Health::NewStub(channel)) {}

  [[nodiscard]] Expected<RemoteSolution> unary(const v1::SolveRequest& request,
                                               grpc::ClientContext& context) const {
    v1::SolveResponse response;
    const grpc::Status status = solver->Solve(&context, request, &response);
    if (!status.ok()) return unexpected(client::to_error(status));
    return remote_solution(response);
  }

  [[nodiscard]] Expected<RemoteSolution> streamed(const v1::SolveStreamRequest& request,
                                                  grpc::ClientContext& context, ProgressSink* progress,
                                                  const CallControls& call) const {
    const auto reader = solver->SolveStream(&context, request);
    v1::SolveStreamResponse event;
    std::optional<RemoteSolution> answer;
    std::int64_t skipped = 0;
    while (reader->Read(&event)) {
      deliver(event, progress, call);
      if (event.has_progress()) skipped = event.progress().skipped();
      if (event.has_result()) answer = remote_solution(event.result());
    }
    const grpc::Status status = reader->Finish();
    if (!status.ok()) return unexpected(client::to_error(status));
    if (!answer)
      return unexpected(Error{ErrorCode::internal, "", -1, "", "the stream ended without a result"});
    answer->progress_skipped = skipped;
    return std::move(*answer);
  }

  std::string address;
  std::shared_ptr<grpc::Channel> channel;
  std::unique_ptr<v1::Solver::Stub> solver;
  std::unique_ptr<v1::Server::Stub> server;
  std::unique_ptr<grpc::health::v1::Health::Stub> health;
};

Expected<Client> Client::connect(const std::string& address) {
  if (auto valid = client::check_address(address); !valid) return unexpected(valid.error());
  return Client(std::make_unique<Connection>(address));
}

Client::Client(std::unique_ptr<Connection> connection) : connection_(std::move(connection)) {}
Client::Client(Client&&) noexcept = default;
Client& Client::operator=(Client&&) noexcept = default;
Client::~Client() = default;

Expected<RemoteSolution> Client::solve(const ProblemView& problem, const Options& options,
                                       const SolveControls& controls, const CallControls& call) const try {
  const auto request = client::make_request(problem, options, controls, call);
  if (!request) return unexpected(request.error());
  grpc::ClientContext context;
  if (call.deadline) set_deadline(*call.deadline, context);
  const std::stop_callback cancel_on_stop(controls.stop, [&context] { context.TryCancel(); });
  const bool stream = controls.progress != nullptr || call.accepted || call.started;
  auto answer = stream ? connection_->streamed(*request, context, controls.progress, call)
                       : connection_->unary(request->solve(), context);
  if (!answer && answer.error().code == ErrorCode::cancelled && controls.stop.stop_requested())
    answer.error().bound = "cancelled by the caller";
  return answer;
} catch (const std::bad_alloc&) {
  return unexpected(out_of_memory());
}

Expected<bool> Client::healthy() const {
  grpc::ClientContext context;
  set_deadline(kQuickCall, context);
  grpc::health::v1::HealthCheckResponse response;
  const grpc::Status status = connection_->health->Check(&context, {}, &response);
  if (!status.ok()) return unexpected(client::to_error(status));
  return response.status() == grpc::health::v1::HealthCheckResponse::SERVING;
}

Expected<ServerInfo> Client::info() const {
  grpc::ClientContext context;
  set_deadline(kQuickCall, context);
  v1::GetInfoResponse response;
  const grpc::Status status = connection_->server->GetInfo(&context, {}, &response);
  if (!status.ok()) return unexpected(client::to_error(status));
  const v1::Limits& limits = response.limits();
  const v1::Counters& counters = response.counters();
  return ServerInfo{.version = response.version(),
                    .workers = response.workers(),
                    .message_bytes = limits.message_bytes(),
                    .queue_bytes = limits.queue_bytes(),
                    .queue_jobs = limits.queue_jobs(),
                    .accepted = counters.accepted_total(),
                    .answered = counters.answered_total(),
                    .solved = counters.solved_total(),
                    .refused = counters.refused_total(),
                    .cancelled = counters.cancelled_total(),
                    .failed = counters.failed_total(),
                    .queued = counters.queued(),
                    .running = counters.running(),
                    .uptime_s = response.uptime_s()};
}

const std::string& Client::address() const { return connection_->address; }

}  // namespace marble
