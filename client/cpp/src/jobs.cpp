#include "marble/jobs.h"

#include <new>

#include "connection/connection.h"
#include "connection/traceparent.h"
#include "in_process/in_process.h"
#include "marble/convert_coupled.h"
#include "message/answer.h"
#include "message/job_message.h"
#include "message/request.h"
#include "message/status.h"
#include "remote/composite_request.h"
#include "remote/has_server.h"
#include "remote/queue_wait.h"

namespace marble {
namespace {

using client::has_server;

Expected<SubmittedJob> send(const client::Connection& connection, v1::SolveRequest request,
                            const std::stop_token& stop, const CallControls& call) {
  if (request.request_id().empty()) request.set_request_id(client::random_request_id());
  MARBLE_ASSIGN_OR_RETURN(
      auto wait,
      client::QueueWait::create(call.queue_wait, connection.deadline_of(call.deadline), stop, call.waiting));
  while (true) {
    grpc::ClientContext context;
    MARBLE_RETURN_IF_ERROR(connection.prepare(context, call.traceparent, wait.left()));
    const std::stop_callback cancel_on_stop(stop, [&context] { context.TryCancel(); });
    v1::SubmitResponse response;
    const grpc::Status status = connection.jobs().Submit(&context, request, &response);
    if (status.ok()) {
      return SubmittedJob{response.job_id(), response.queue_position(), response.estimated_wait_s(),
                          client::returned_traceparent(context)};
    }
    if (!wait.pause(status)) return unexpected(wait.error(status));
  }
}

Expected<SubmittedJob> send_coupled(const client::Connection& connection,
                                    Expected<v1::SolveStreamRequest> request, const std::stop_token& stop,
                                    const CallControls& call) {
  if (!request) return unexpected(request.error());
  auto job = send(connection, std::move(*request->mutable_solve()), stop, call);
  if (!job) return unexpected(of_field(coupled_core_field(job.error().field), job.error()));
  return job;
}

Expected<v1::SolveResponse> response_of(const client::Connection* connection, const std::string& job_id,
                                        const ResultControls& controls) {
  MARBLE_RETURN_IF_ERROR(has_server(connection));
  grpc::ClientContext context;
  connection->prepare(context, connection->deadline_of(controls.deadline));
  const std::stop_callback cancel_on_stop(controls.stop, [&context] { context.TryCancel(); });
  v1::JobResultRequest request;
  request.set_job_id(job_id);
  request.set_wait(controls.wait);
  v1::SolveResponse response;
  const grpc::Status status = connection->jobs().Result(&context, request, &response);
  if (!status.ok()) return unexpected(client::to_error(status, controls.stop));
  return response;
}

}  // namespace

Expected<SubmittedJob> Jobs::submit(const ProblemView& problem, const Options& options,
                                    const SolveControls& controls, const CallControls& call) const try {
  MARBLE_RETURN_IF_ERROR(has_server(connection_.get()));
  v1::SolveRequest request;
  const client::RequestParts parts{
      problem,         options,           controls.initial_z, controls.warm_start, controls.sensitivity,
      call.request_id, call.problem_name, call.priority};
  MARBLE_RETURN_IF_ERROR(client::fill_request(parts, &request));
  return send(*connection_, std::move(request), controls.stop, call);
} catch (const std::bad_alloc&) {
  return unexpected(out_of_memory());
}

Expected<SubmittedJob> Jobs::submit(const ScenarioProblem& problem, const ScenarioSettings& settings,
                                    const SolveControls& controls, const CallControls& call) const try {
  MARBLE_RETURN_IF_ERROR(has_server(connection_.get()));
  MARBLE_ASSIGN_OR_RETURN(auto request, client::make_request(problem, nullptr, settings, call));
  return send(*connection_, std::move(*request.mutable_solve()), controls.stop, call);
} catch (const std::bad_alloc&) {
  return unexpected(out_of_memory());
}

Expected<SubmittedJob> Jobs::submit(const CoupledView& view, const CoupledOptions& options,
                                    const CoupledControls& controls, const CallControls& call) const try {
  MARBLE_RETURN_IF_ERROR(has_server(connection_.get()));
  return send_coupled(*connection_, client::make_request(view, options, controls, call), controls.stop, call);
} catch (const std::bad_alloc&) {
  return unexpected(out_of_memory());
}

Expected<SubmittedJob> Jobs::submit_in_segments(const Problem& problem,
                                                std::span<const Index> stage_of_variable,
                                                const SegmentsOptions& options,
                                                const CoupledControls& controls,
                                                const CallControls& call) const try {
  MARBLE_RETURN_IF_ERROR(has_server(connection_.get()));
  return send_coupled(*connection_, client::make_request(problem, stage_of_variable, options, call),
                      controls.stop, call);
} catch (const std::bad_alloc&) {
  return unexpected(out_of_memory());
}

Expected<RemoteSolution> Jobs::result(const std::string& job_id, const ResultControls& controls) const try {
  MARBLE_ASSIGN_OR_RETURN(const auto response, response_of(connection_.get(), job_id, controls));
  return client::remote_solution(response);
} catch (const std::bad_alloc&) {
  return unexpected(out_of_memory());
}

Expected<RemoteScenarios> Jobs::scenarios(const std::string& job_id, const ResultControls& controls) const
    try {
  MARBLE_ASSIGN_OR_RETURN(const auto response, response_of(connection_.get(), job_id, controls));
  return client::remote_scenarios(response);
} catch (const std::bad_alloc&) {
  return unexpected(out_of_memory());
}

Expected<RemoteCoupledSolution> Jobs::coupled(const std::string& job_id, const CoupledView& view,
                                              const ResultControls& controls) const try {
  MARBLE_ASSIGN_OR_RETURN(const auto response, response_of(connection_.get(), job_id, controls));
  return client::remote_coupled(response, view);
} catch (const std::bad_alloc&) {
  return unexpected(out_of_memory());
}

Expected<RemoteSegmentsSolution> Jobs::segments(const std::string& job_id,
                                                const ResultControls& controls) const try {
  MARBLE_ASSIGN_OR_RETURN(const auto response, response_of(connection_.get(), job_id, controls));
  return client::remote_segments(response);
} catch (const std::bad_alloc&) {
  return unexpected(out_of_memory());
}

Expected<JobBundle> Jobs::bundle(const std::string& job_id, const std::stop_token& stop) const try {
  MARBLE_RETURN_IF_ERROR(has_server(connection_.get()));
  grpc::ClientContext context;
  connection_->prepare(context);
  const std::stop_callback cancel_on_stop(stop, [&context] { context.TryCancel(); });
  v1::JobBundleRequest request;
  request.set_job_id(job_id);
  const auto reader = connection_->jobs().Bundle(&context, request);
  JobBundle bundle;
  v1::JobBundleResponse piece;
  while (reader->Read(&piece)) {
    if (piece.has_bundle()) bundle.facts = piece.bundle().SerializeAsString();
    bundle.request += piece.request();
    bundle.answer += piece.answer();
  }
  const grpc::Status status = reader->Finish();
  if (!status.ok()) return unexpected(client::to_error(status, stop));
  return bundle;
} catch (const std::bad_alloc&) {
  return unexpected(out_of_memory());
}

Expected<void> Jobs::remove(const std::string& job_id) const {
  MARBLE_RETURN_IF_ERROR(has_server(connection_.get()));
  grpc::ClientContext context;
  connection_->prepare(context, client::kQuickCall);
  v1::DeleteJobRequest request;
  request.set_job_id(job_id);
  v1::DeleteJobResponse response;
  const grpc::Status status = connection_->jobs().Delete(&context, request, &response);
  if (!status.ok()) return unexpected(client::to_error(status));
  return {};
}

Expected<JobPage> Jobs::list(const JobQuery& query, const std::stop_token& stop) const {
  MARBLE_RETURN_IF_ERROR(has_server(connection_.get()));
  grpc::ClientContext context;
  connection_->prepare(context, client::kQuickCall);
  const std::stop_callback cancel_on_stop(stop, [&context] { context.TryCancel(); });
  v1::ListJobsRequest request;
  for (const JobState state : query.states) request.add_states(client::to_message(state));
  request.set_client(query.client);
  request.set_limit(query.limit);
  request.set_before_job_id(query.before_job_id);
  v1::ListJobsResponse response;
  const grpc::Status status = connection_->jobs().List(&context, request, &response);
  if (!status.ok()) return unexpected(client::to_error(status, stop));
  JobPage page{{}, response.more()};
  for (const v1::JobInfo& job : response.jobs()) page.jobs.push_back(client::job_info(job));
  return page;
}

Expected<JobDetails> Jobs::get(const std::string& job_id) const {
  MARBLE_RETURN_IF_ERROR(has_server(connection_.get()));
  grpc::ClientContext context;
  connection_->prepare(context, client::kQuickCall);
  v1::GetJobRequest request;
  request.set_job_id(job_id);
  v1::GetJobResponse response;
  const grpc::Status status = connection_->jobs().Get(&context, request, &response);
  if (!status.ok()) return unexpected(client::to_error(status));
  connection_->note_reached();
  MARBLE_ASSIGN_OR_RETURN(auto options, options_of(response.options()));
  JobDetails details{client::job_info(response.job()), options, client::job_trace(response.trace())};
  if (response.has_infeasibility()) details.infeasibility = client::infeasibility(response.infeasibility());
  return details;
}

Expected<JobInfo> Jobs::cancel(const std::string& job_id) const {
  MARBLE_RETURN_IF_ERROR(has_server(connection_.get()));
  grpc::ClientContext context;
  connection_->prepare(context, client::kQuickCall);
  v1::CancelJobRequest request;
  request.set_job_id(job_id);
  v1::CancelJobResponse response;
  const grpc::Status status = connection_->jobs().Cancel(&context, request, &response);
  if (!status.ok()) return unexpected(client::to_error(status));
  return client::job_info(response.job());
}

Expected<void> Jobs::watch(const std::string& job_id, const std::function<void(const JobEvent&)>& happened,
                           const WatchControls& controls) const {
  MARBLE_RETURN_IF_ERROR(has_server(connection_.get()));
  grpc::ClientContext context;
  connection_->prepare(context);
  const std::stop_callback cancel_on_stop(controls.stop, [&context] { context.TryCancel(); });
  v1::WatchJobsRequest request;
  request.set_job_id(job_id);
  request.set_progress_interval_s(controls.progress_interval_s);
  const auto reader = connection_->jobs().Watch(&context, request);
  v1::WatchJobsResponse response;
  while (reader->Read(&response)) {
    for (const v1::JobEvent& event : response.events()) {
      JobEvent reported{
          client::job_info(event.job()), client::progress_rows(event.rows()), {}, response.skipped()};
      if (event.has_trace()) reported.trace = client::job_trace(event.trace());
      happened(reported);
    }
  }
  const grpc::Status status = reader->Finish();
  if (!status.ok()) return unexpected(client::to_error(status, controls.stop));
  return {};
}

}  // namespace marble
