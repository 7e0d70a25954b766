#include "calls/jobs_service.h"

#include "calls/result_call.h"
#include "calls/watch_call.h"
#include "messages/job_access.h"
#include "messages/job_requests.h"
#include "queue/job_log.h"
#include "service/read_first.h"
#include "service/unary_call.h"
#include "submissions/submission.h"

namespace marble::server {

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
                          Origin& origin) -> Expected<Afterwards> {
    const auto message = std::make_shared<v1::SolveRequest>();
    message->Swap(&parsed);
    origin.request_id = message->request_id();
    auto submitted = submit(parts_, caller, message, out);
    if (!submitted) return told(origin, submitted.error());
    return submitted;
  };
  return answer<v1::SolveRequest, v1::SubmitResponse>(parts_, context, request, response, who, handle,
                                                      parts_.scheduler.retry_delay_s());
}

grpc::ServerUnaryReactor* JobsService::Delete(grpc::CallbackServerContext* context,
                                              const grpc::ByteBuffer* request, grpc::ByteBuffer* response) {
  const auto handle = [&](const Identity& caller, const v1::DeleteJobRequest& message, v1::DeleteJobResponse*,
                          const Origin&) -> Expected<Afterwards> {
    const std::string& id = message.job_id();
    const std::string owner = parts_.results.owner(id);
    if (owner.empty() || !may_see(caller, owner)) return unexpected(no_such_job(id));
    if (!may_end(caller, owner)) return unexpected(not_to_end(id));
    if (!parts_.results.forget(id)) return unexpected(no_such_job(id));
    if (const auto record = parts_.board.find(id); record != nullptr) record->cancel();
    parts_.board.forget(id);
    return when_settled(parts_);
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
                          v1::CancelJobResponse* out, const Origin&) -> Expected<Afterwards> {
    return cancel_job(parts_, caller, message.job_id(), out);
  };
  return answer<v1::CancelJobRequest, v1::CancelJobResponse>(parts_, context, request, response,
                                                             of_any_role(parts_, *context), handle);
}

}  // namespace marble::server
