#include "calls/watch_call.h"

#include <utility>

#include "base/status.h"
#include "base/wire.h"
#include "service/admission.h"

namespace marble::server {

grpc::ServerWriteReactor<grpc::ByteBuffer>* WatchCall::begin(const ServiceParts& parts,
                                                             grpc::CallbackServerContext& context,
                                                             const grpc::ByteBuffer* request) {
  const std::shared_ptr<WatchCall> call(new WatchCall(parts));
  call->self_ = call;
  if (const auto started = call->start(context, request); !started) {
    call->end_at_once(to_status(started.error(), parts.scheduler.retry_delay_s()));
    return call.get();
  }
  call->StartSendInitialMetadata();  // a client that waits for it misses no later event
  parts.timer.add(call);
  call->go_on();
  return call.get();
}

Expected<void> WatchCall::start(grpc::CallbackServerContext& context, const grpc::ByteBuffer* request) {
  Origin origin = origin_of(context);
  MARBLE_ASSIGN_OR_RETURN(const auto caller, identify(parts_, context, origin));
  v1::WatchJobsRequest message;
  MARBLE_RETURN_IF_ERROR(parse(request, &message));
  MARBLE_ASSIGN_OR_RETURN(auto feed, JobFeed::open(parts_.board, parts_.feeds, caller,
                                                   parts_.access.quota_of(caller.client), message));
  const MutexLock lock(mutex_);
  feed_ = std::move(feed);
  return {};
}

void WatchCall::on_timer(Clock::time_point /*now*/) { go_on(); }

bool WatchCall::next_event(v1::WatchJobsResponse* event) {
  drained_ = parts_.scheduler.is_drained();
  return feed_->next(event);
}

// If there is nothing new now, the timer checks again.
bool WatchCall::wrote() { return feed_->is_over() || feed_->has_more(); }

std::optional<grpc::Status> WatchCall::ending() {
  if (feed_->is_over()) return grpc::Status::OK;
  if (!drained_ && !broken()) return std::nullopt;
  return end_of_stream(parts_, failure(ErrorCode::unavailable, "the server has drained"));
}

}  // namespace marble::server
