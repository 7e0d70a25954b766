#include "calls/jobs_service.h"

#include "calls/bundle_call.h"
#include "calls/result_call.h"
#include "calls/watch_call.h"
#include "jobs/job_log.h"
#include "service/job_requests.h"
#include "service/read_first.h"
#include "service/unary_call.h"
#include "store/submissions.h"
#include "submissions/array_results_call.h"
#include "submissions/submit_array_call.h"

namespace marble::server {
namespace {

// First refreshes this server's state of the job that a request names, or of all jobs. A request that cannot
// be parsed ends here: each further parse would make protobuf log the same error again.
template <class Request>
void look_at(const ServiceParts& parts, const grpc::ByteBuffer& bytes, CompletionCallback then) {
  std::string id;
  if constexpr (requires(Request request) { request.job_id(); }) {
    Request request;
    const grpc::ByteBuffer copy(bytes);  // reading removes a buffer's bytes
    if (auto parsed = parse(&copy, &request); !parsed) return then(parsed);
    id = request.job_id();
  }
  parts.submissions->look(id, std::move(then));
}

}  // namespace

JobsService::JobsService(const ServiceParts& parts) : parts_(parts) {
  const auto unary = [&](const char* name, auto method, ReadFirstLook look) {
    MarkMethodStreamed(method_number("Jobs", name),
                       unary_read_first(
                           parts, [this, method](auto... given) { return (this->*method)(given...); }, look));
  };
  unary("Submit", &JobsService::Submit, nullptr);
  unary("Delete", &JobsService::Delete, look_at<v1::DeleteJobRequest>);
  unary("List", &JobsService::List, look_at<v1::ListJobsRequest>);
  unary("Get", &JobsService::Get, look_at<v1::GetJobRequest>);
  unary("Cancel", &JobsService::Cancel, look_at<v1::CancelJobRequest>);
  MarkMethodStreamed(
      method_number("Jobs", "Result"),
      unary_read_first(
          parts, [&parts](auto* from, auto... bytes) { return ResultCall::begin(parts, *from, bytes...); },
          look_at<v1::JobResultRequest>));
  MarkMethodStreamed(method_number("Jobs", "SubmitArray"),
                     new grpc::internal::CallbackBidiHandler<grpc::ByteBuffer, grpc::ByteBuffer>(
                         [&parts](grpc::CallbackServerContext* context) {
                           return SubmitArrayCall::begin(parts, *context);
                         }));
  MarkMethodStreamed(method_number("Jobs", "ArrayResults"),
                     stream_read_first(parts, [&parts](auto* from, const auto* request) {
                       return ArrayResultsCall::begin(parts, *from, request);
                     }));
  MarkMethodStreamed(method_number("Jobs", "Watch"), stream_read_first(
                                                         parts,
                                                         [&parts](auto* from, const auto* request) {
                                                           return WatchCall::begin(parts, *from, request);
                                                         },
                                                         look_at<v1::WatchJobsRequest>));
  MarkMethodStreamed(method_number("Jobs", "Bundle"), stream_read_first(
                                                          parts,
                                                          [&parts](auto* from, const auto* request) {
                                                            return BundleCall::begin(parts, *from, request);
                                                          },
                                                          look_at<v1::JobBundleRequest>));
}

grpc::ServerUnaryReactor* JobsService::Submit(grpc::CallbackServerContext* context,
                                              const grpc::ByteBuffer* request, grpc::ByteBuffer* response) {
  const auto reported = [&](const Origin& origin, const Error& error) {
    note_refusal(parts_, origin, error);
    return unexpected(error);
  };
  const auto who = [&](Origin& origin) -> Expected<Caller> {
    auto caller = caller_of(parts_, *context, origin, Role::solve);
    if (!caller) return reported(origin, caller.error());
    caller->deadline = Clock::time_point::max();  // the call's deadline is not the job's
    return caller;
  };
  const auto handle = [&](const Caller& caller, v1::SolveRequest& parsed, v1::SubmitResponse* out,
                          Origin& origin) -> Expected<OnFinished> {
    const auto message = std::make_shared<v1::SolveRequest>();
    message->Swap(&parsed);
    origin.request_id = message->request_id();
    auto submitted = parts_.submissions->submit(caller, message, out);
    if (!submitted) return reported(origin, submitted.error());
    if (!*submitted) return submitted;
    return [this, origin, wait = std::move(*submitted)](const CompletionCallback& settled) {
      wait([this, origin, settled](const Expected<void>& ended) {
        if (!ended) note_refusal(parts_, origin, ended.error());
        settled(ended);
      });
    };
  };
  return answer<v1::SolveRequest, v1::SubmitResponse>(parts_, context, request, response, who, handle,
                                                      parts_.scheduler.retry_delay_s());
}

grpc::ServerUnaryReactor* JobsService::Delete(grpc::CallbackServerContext* context,
                                              const grpc::ByteBuffer* request, grpc::ByteBuffer* response) {
  const auto handle = [&](const Identity& caller, const v1::DeleteJobRequest& message, v1::DeleteJobResponse*,
                          const Origin&) -> Expected<OnFinished> {
    return parts_.submissions->remove(caller, message.job_id());
  };
  return answer<v1::DeleteJobRequest, v1::DeleteJobResponse>(parts_, context, request, response,
                                                             of_any_role(parts_, *context), handle,
                                                             parts_.scheduler.retry_delay_s());
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
                          v1::CancelJobResponse* out, const Origin&) -> Expected<OnFinished> {
    return parts_.submissions->cancel(caller, message.job_id(), out);
  };
  return answer<v1::CancelJobRequest, v1::CancelJobResponse>(parts_, context, request, response,
                                                             of_any_role(parts_, *context), handle,
                                                             parts_.scheduler.retry_delay_s());
}

}  // namespace marble::server
