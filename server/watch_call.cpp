#include "watch_call.h"

#include <utility>

#include "admission.h"
#include "status.h"
#include "wire.h"

namespace marble::server {

grpc::ServerWriteReactor<grpc::ByteBuffer>* WatchCall::begin(const ServiceParts& parts,
                                                             grpc::CallbackServerContext& context,
                                                             const grpc::ByteBuffer* request) {
  const std::shared_ptr<WatchCall> call(new WatchCall(parts));
  call->self_ = call;
  if (const auto started = call->start(context, request); !started) {
    {
      const MutexLock lock(call->mutex_);
      call->finishing_ = true;  // a client that goes away before it has heard must not end it again
    }
    call->Finish(to_status(started.error(), parts.scheduler.retry_delay_s()));
    return call.get();
  }
  parts.pulse.add(call);
  call->go_on();
  return call.get();
}

Expected<void> WatchCall::start(grpc::CallbackServerContext& context, const grpc::ByteBuffer* request) {
  Origin origin = origin_of(context);
  const auto caller = identify(parts_, context, origin);
  if (!caller) return unexpected(caller.error());
  v1::WatchJobsRequest message;
  if (auto parsed = parse(request, &message); !parsed) return parsed;
  auto feed =
      JobFeed::open(parts_.board, parts_.feeds, *caller, parts_.access.quota_of(caller->client), message);
  if (!feed) return unexpected(feed.error());
  const MutexLock lock(mutex_);
  feed_ = std::move(*feed);
  return {};
}

void WatchCall::OnWriteDone(bool ok) {
  {
    const MutexLock lock(mutex_);
    writing_ = false;
    if (!ok) broken_ = true;
    if (!broken_ && !feed_->is_over() && !feed_->has_more()) return;  // the pulse looks again
  }
  go_on();
}

void WatchCall::OnCancel() {
  {
    const MutexLock lock(mutex_);
    broken_ = true;
  }
  go_on();
}

void WatchCall::OnDone() { const auto last = std::move(self_); }

void WatchCall::pulse(Clock::time_point /*now*/) { go_on(); }

// gRPC may react within StartWrite or Finish, on this very thread: no lock is held there.
void WatchCall::go_on() {
  v1::WatchJobsResponse response;
  grpc::Status status;
  bool write = false;
  {
    const MutexLock lock(mutex_);
    if (writing_ || finishing_) return;
    const bool drained = parts_.scheduler.is_drained();  // before the last look
    write = !broken_ && feed_->next(&response);
    const bool over = feed_->is_over();
    if (!write && !over && !broken_ && !drained) return;
    if (!write && !over)
      status = end_of_stream(parts_, failure(ErrorCode::unavailable, "the server has drained"));
    writing_ = write;
    finishing_ = !write;
  }
  if (write) {
    bytes_ = serialize(response);
    StartWrite(&bytes_);
  } else {
    Finish(status);
  }
}

}  // namespace marble::server
