#include "solver_service.h"

#include <cmath>

#include "admission.h"
#include "marble/convert.h"
#include "solve_stream.h"
#include "status.h"

namespace marble::server {
namespace {

// A unary call: finished by the scheduler, cancelled by gRPC. Deletes itself when gRPC is done with it.
class SolveCall final : public grpc::ServerUnaryReactor, public JobObserver {
 public:
  SolveCall(Scheduler& scheduler, const Log& log, const grpc::CallbackServerContext& context,
            const v1::SolveRequest& request, v1::SolveResponse* response)
      : scheduler_(scheduler), response_(response) {
    auto job = make_job(request, context);
    if (!job) {
      scheduler_.count_refused();
      log_refusal(log, context.peer(), request, job.error());
      Finish(to_status(job.error()));
      return;
    }
    job_ = *job;
    job_->observer = this;
    if (auto admitted = scheduler_.admit(job_); !admitted) {
      log_refusal(log, context.peer(), request, admitted.error());
      Finish(to_status(admitted.error(), scheduler_.retry_delay_s()));
    }
  }

  void OnCancel() override {
    if (job_ != nullptr) scheduler_.cancel(job_);
  }
  void OnDone() override { delete this; }

  void finished(Outcome outcome) override {
    Finish(fill_response(*job_, std::move(outcome), scheduler_, response_));
  }

 private:
  Scheduler& scheduler_;
  v1::SolveResponse* response_;
  std::shared_ptr<Job> job_;
};

}  // namespace

grpc::Status fill_response(const Job& job, Outcome outcome, const Scheduler& scheduler,
                           v1::SolveResponse* response) {
  if (!outcome.solution) {
    Error error = outcome.solution.error();
    if (error.code == ErrorCode::internal) error.bound += " (job " + job.id + ")";
    return to_status(error, scheduler.retry_delay_s());
  }
  response->set_job_id(job.id);
  v1::Solution* solution = response->mutable_solution();
  to_message(*outcome.solution, solution);
  to_message(job.options, solution->mutable_options());
  solution->mutable_times()->set_queue_s(outcome.queue_s);
  solution->mutable_times()->set_total_s(outcome.total_s);
  return grpc::Status::OK;
}

void log_refusal(const Log& log, const std::string& peer, const v1::SolveRequest& request,
                 const Error& error) {
  // The id may be what is wrong with the request: show no more of it than a good one may have.
  log.info("refused", {{"request", request.request_id().substr(0, 128)},
                       {"peer", peer},
                       {"code", std::string(to_string(error.code))},
                       {"reason", error.message()}});
}

grpc::ServerUnaryReactor* SolverService::Solve(grpc::CallbackServerContext* context,
                                               const v1::SolveRequest* request, v1::SolveResponse* response) {
  return new SolveCall(scheduler_, log_, *context, *request, response);
}

grpc::ServerWriteReactor<v1::SolveStreamResponse>* SolverService::SolveStream(
    grpc::CallbackServerContext* context, const v1::SolveStreamRequest* request) {
  return new SolveStreamCall(scheduler_, log_, *context, *request);
}

}  // namespace marble::server
