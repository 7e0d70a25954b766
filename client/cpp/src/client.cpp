#include "marble/client.h"

#include <grpcpp/grpcpp.h>

#include <cstdlib>

#include "grpc/health/v1/health.grpc.pb.h"
#include "marble/convert.h"
#include "marble/v1/service.grpc.pb.h"
#include "status.h"

namespace marble {
namespace {

// The server enforces its own limit; the client must not be the one that cannot read an answer.
constexpr int kNoLimit = -1;
constexpr std::chrono::seconds kQuickCall{5};  // for calls that no solve stands behind

std::shared_ptr<grpc::Channel> connect(const std::string& address) {
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(kNoLimit);
  arguments.SetMaxSendMessageSize(kNoLimit);
  return grpc::CreateCustomChannel(address, grpc::InsecureChannelCredentials(), arguments);
}

void apply(const RemoteControls& controls, grpc::ClientContext& context) {
  if (!controls.deadline) return;
  const auto length = std::chrono::duration_cast<std::chrono::system_clock::duration>(*controls.deadline);
  context.set_deadline(std::chrono::system_clock::now() + length);
}

Expected<RemoteSolution> remote_solution(const v1::SolveResponse& response) {
  RemoteSolution remote;
  remote.solution = solution_of(response.solution());
  remote.job_id = response.job_id();
  remote.queue_s = response.solution().times().queue_s();
  remote.total_s = response.solution().times().total_s();
  return remote;
}

void deliver(const v1::SolveStreamResponse& event, const RemoteControls& controls) {
  if (event.has_accepted() && controls.events.accepted) {
    controls.events.accepted(event.accepted().job_id(), event.accepted().queue_position());
  } else if (event.has_started() && controls.events.started) {
    controls.events.started(event.started().queue_s());
  } else if (event.has_progress() && controls.progress != nullptr) {
    for (const v1::Progress& row : event.progress().rows()) controls.progress->report(progress_of(row));
  }
}

}  // namespace

std::string default_server_address() {
  const char* address = std::getenv("MARBLE_SERVER");
  return address != nullptr && *address != '\0' ? address : "127.0.0.1:50051";
}

struct Client::Connection {
  explicit Connection(std::string server_address)
      : address(std::move(server_address)),
        channel(connect(address)),
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
                                                  grpc::ClientContext& context,
                                                  const RemoteControls& controls) const {
    const auto reader = solver->SolveStream(&context, request);
    v1::SolveStreamResponse event;
    std::optional<RemoteSolution> answer;
    while (reader->Read(&event)) {
      deliver(event, controls);
      if (event.has_result()) answer = *remote_solution(event.result());
    }
    const grpc::Status status = reader->Finish();
    if (!status.ok()) return unexpected(client::to_error(status));
    if (!answer)
      return unexpected(Error{ErrorCode::internal, "", -1, "", "the stream ended without a result"});
    return std::move(*answer);
  }

  std::string address;
  std::shared_ptr<grpc::Channel> channel;
  std::unique_ptr<v1::Solver::Stub> solver;
  std::unique_ptr<v1::Server::Stub> server;
  std::unique_ptr<grpc::health::v1::Health::Stub> health;
};

Client::Client(const std::string& address) : connection_(std::make_unique<Connection>(address)) {}
Client::Client(Client&&) noexcept = default;
Client& Client::operator=(Client&&) noexcept = default;
Client::~Client() = default;

Expected<RemoteSolution> Client::solve(const ProblemView& problem, const Options& options,
                                       const RemoteControls& controls) {
  v1::SolveStreamRequest request;
  v1::SolveRequest* solve = request.mutable_solve();
  to_message(problem, solve->mutable_problem());
  solve->mutable_problem()->set_name(controls.problem_name);
  to_message(options, solve->mutable_options());
  solve->mutable_initial_point()->mutable_z()->Assign(controls.initial_z.begin(), controls.initial_z.end());
  solve->set_request_id(controls.request_id);
  request.set_progress_interval_s(controls.progress_interval_s);

  grpc::ClientContext context;
  apply(controls, context);
  const std::stop_callback cancel_on_stop(controls.stop, [&context] { context.TryCancel(); });
  const bool stream = controls.progress != nullptr || controls.events.accepted || controls.events.started;
  return stream ? connection_->streamed(request, context, controls) : connection_->unary(*solve, context);
}

Expected<bool> Client::healthy() {
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + kQuickCall);
  grpc::health::v1::HealthCheckResponse response;
  const grpc::Status status = connection_->health->Check(&context, {}, &response);
  if (!status.ok()) return unexpected(client::to_error(status));
  return response.status() == grpc::health::v1::HealthCheckResponse::SERVING;
}

Expected<ServerInfo> Client::info() {
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + kQuickCall);
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
                    .queued = counters.queued(),
                    .running = counters.running(),
                    .uptime_s = response.uptime_s()};
}

const std::string& Client::address() const { return connection_->address; }

}  // namespace marble
