#include "calls/jobs_service.h"

#include "calls/result_call.h"
#include "calls/watch_call.h"
#include "messages/job_access.h"
#include "messages/job_requests.h"
#include "messages/reply.h"
#include "queue/job_log.h"
#include "service/read_first.h"
#include "service/unary_call.h"
#include "wire/wire.h"

namespace marble::server {
namespace {

// Keeps the answer of a submitted job.
class ResultKeeper final : public JobObserver {
 public:
  ResultKeeper(ResultStore& results, std::shared_ptr<JobRecord> record)
      : results_(results), record_(std::move(record)) {}

  void finished(Outcome outcome) override {
    v1::SolveResponse response;
    ResultStore::Result result{unexpected(Error{}), outcome.retry_delay_s};
    if (const auto filled = fill_response(*record_, outcome, &response); filled) {
      result.answer = serialize(response);
    } else {
      result.answer = unexpected(filled.error());
    }
    const auto bytes = result.answer ? static_cast<std::int64_t>(result.answer->Length()) : 0;
    record_->set_result_bytes(bytes);  // before who waits for it hears of it
    if (!results_.put(record_->id(), std::move(result), Clock::now())) record_->set_result_bytes(0);
  }

 private:
  ResultStore& results_;
  const std::shared_ptr<JobRecord> record_;
};

}  // namespace

JobsService::JobsService(const ServiceParts& parts) : parts_(parts) {
  const auto unary = [&](const char* name, auto method) {
    MarkMethodStreamed(method_number("Jobs", name), unary_read_first(parts, [this, method](auto... given) {
                         return (this->*method)(given...);
                       }));
  };
  unary("Submit", &JobsService::Submit);
  unary("Delete", &JobsService::Delete);
  unary("List", &JobsService::List);
  unary("Get", &JobsService::Get);
  unary("Cancel", &JobsService::Cancel);
  MarkMethodStreamed(method_number("Jobs", "Result"),
                     unary_read_first(parts, [&parts](auto* from, auto... bytes) {
                       return ResultCall::begin(parts, *from, bytes...);
                     }));
  MarkMethodStreamed(method_number("Jobs", "Watch"),
                     stream_read_first(parts, [&parts](auto* from, const auto* request) {
                       return WatchCall::begin(parts, *from, request);
                     }));
}

grpc::ServerUnaryReactor* JobsService::Submit(grpc::CallbackServerContext* context,
                                              const grpc::ByteBuffer* request, grpc::ByteBuffer* response) {
  const auto told = [&](const Origin& origin, const Error& error) {
    note_refusal(parts_, origin, error);
    return unexpected(error);
  };
  const auto who = [&](Origin& origin) -> Expected<Caller> {
    auto caller = caller_of(parts_, *context, origin, Role::solve);
    if (!caller) return told(origin, caller.error());
    caller->deadline = Clock::time_point::max();  // the call's is not the job's
    return caller;
  };
  const auto handle = [&](const Caller& caller, v1::SolveRequest& parsed, v1::SubmitResponse* out,
                          Origin& origin) -> Expected<void> {
    const auto message = std::make_shared<v1::SolveRequest>();
    message->Swap(&parsed);
    origin.request_id = message->request_id();
    auto submitted = submit(caller, message, out);
    if (!submitted) return told(origin, submitted.error());
    return submitted;
  };
  return answer<v1::SolveRequest, v1::SubmitResponse>(parts_, context, request, response, who, handle,
                                                      parts_.scheduler.retry_delay_s());
}

Expected<void> JobsService::submit(const Caller& caller, std::shared_ptr<v1::SolveRequest> request,
                                   v1::SubmitResponse* response) const {
  const auto job = make_job(parts_, caller, JobKind::submitted, std::move(request));
  if (!job) return unexpected(job.error());
  const std::shared_ptr<JobRecord> record = (*job)->record;
  (*job)->observer = std::make_shared<ResultKeeper>(parts_.results, record);
  parts_.results.expect(record->id(), caller.identity.client);
  const auto place = parts_.scheduler.admit(*job);
  if (!place) {
    parts_.results.forget(record->id());
    return unexpected(place.error());
  }
  response->set_job_id(record->id());
  response->set_queue_position(place->position);
  response->set_estimated_wait_s(place->estimated_wait_s);
  return {};
}

grpc::ServerUnaryReactor* JobsService::Delete(grpc::CallbackServerContext* context,
                                              const grpc::ByteBuffer* request, grpc::ByteBuffer* response) {
  const auto handle = [&](const Identity& caller, const v1::DeleteJobRequest& message, v1::DeleteJobResponse*,
                          const Origin&) -> Expected<void> {
    const std::string& id = message.job_id();
    const std::string owner = parts_.results.owner(id);
    if (owner.empty() || !may_see(caller, owner)) return unexpected(no_such_job(id));
    if (!may_end(caller, owner)) return unexpected(not_to_end(id));
    if (!parts_.results.forget(id)) return unexpected(no_such_job(id));
    if (const auto record = parts_.board.find(id); record != nullptr) record->cancel();
    parts_.board.forget(id);
    return {};
  };
  return answer<v1::DeleteJobRequest, v1::DeleteJobResponse>(parts_, context, request, response,
                                                             of_any_role(parts_, *context), handle);
}

grpc::ServerUnaryReactor* JobsService::List(grpc::CallbackServerContext* context,
                                            const grpc::ByteBuffer* request, grpc::ByteBuffer* response) {
  const auto handle = [&](const Identity& caller, const v1::ListJobsRequest& message,
                          v1::ListJobsResponse* out, const Origin&) -> Expected<void> {
    return list_jobs(parts_.board, caller, message, out);
  };
  return answer<v1::ListJobsRequest, v1::ListJobsResponse>(parts_, context, request, response,
                                                           of_any_role(parts_, *context), handle);
}

grpc::ServerUnaryReactor* JobsService::Get(grpc::CallbackServerContext* context,
                                           const grpc::ByteBuffer* request, grpc::ByteBuffer* response) {
  const auto handle = [&](const Identity& caller, const v1::GetJobRequest& message, v1::GetJobResponse* out,
                          const Origin&) -> Expected<void> {
    return get_job(parts_.board, caller, message.job_id(), out);
  };
  return answer<v1::GetJobRequest, v1::GetJobResponse>(parts_, context, request, response,
                                                       of_any_role(parts_, *context), handle);
}

grpc::ServerUnaryReactor* JobsService::Cancel(grpc::CallbackServerContext* context,
                                              const grpc::ByteBuffer* request, grpc::ByteBuffer* response) {
  const auto handle = [&](const Identity& caller, const v1::CancelJobRequest& message,
                          v1::CancelJobResponse* out, const Origin&) -> Expected<void> {
    return cancel_job(parts_.board, caller, message.job_id(), out);
  };
  return answer<v1::CancelJobRequest, v1::CancelJobResponse>(parts_, context, request, response,
                                                             of_any_role(parts_, *context), handle);
}

}  // namespace marble::server
