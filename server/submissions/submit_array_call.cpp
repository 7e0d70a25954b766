#include "submissions/submit_array_call.h"

#include <utility>

#include "base/status.h"
#include "base/wire.h"
#include "store/submissions.h"

namespace marble::server {

grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>* SubmitArrayCall::begin(
    const ServiceParts& parts, grpc::CallbackServerContext& context) {
  const std::shared_ptr<SubmitArrayCall> call(new SubmitArrayCall(parts));
  call->self_ = call;
  Origin origin = origin_of(context);
  auto caller = caller_of(parts, context, origin, Role::solve);
  if (!caller) {
    call->end_at_once(refused(parts, origin, caller.error()));
    return call.get();
  }
  call->caller_ = std::move(*caller);
  call->caller_.deadline = Clock::time_point::max();  // the call's deadline is not the array's
  parts.timer.add(call);
  call->go_on();
  return call.get();
}

void SubmitArrayCall::received(grpc::ByteBuffer* message) {
  if (message == nullptr) {
    {
      const MutexLock lock(mutex_);
      if (sealing_ || broken()) return;
    }
    return refuse(invalid("end", "must be the last message: without it nothing is kept"));
  }
  const auto take_it = [&] { return take(message); };
  if (const auto taken = or_out_of_memory(take_it); !taken) refuse(taken.error());
}

Expected<void> SubmitArrayCall::take(grpc::ByteBuffer* message) {
  v1::SubmitArrayRequest request;
  MARBLE_RETURN_IF_ERROR(parse(message, &request));
  std::shared_ptr<ArrayDraft> draft;
  {
    const MutexLock lock(mutex_);
    draft = draft_;
  }
  if (draft == nullptr) {
    if (!request.has_setup()) return unexpected(invalid("setup", "must be the first message"));
    return set_up(std::move(*request.mutable_setup()));
  }
  if (request.has_element())
    return draft->add(std::move(*request.mutable_element()), [self = self_] { self->go_on(); });
  if (!request.has_end()) return unexpected(invalid("request", "must be an element or the end"));
  seal(draft, request.end().elements());
  return {};
}

Expected<void> SubmitArrayCall::set_up(v1::ArraySetup setup) {
  caller_.origin.request_id = setup.request_id();
  auto begun = parts_.submissions->begin_array(caller_, std::move(setup));
  if (!begun) return unexpected(inside("setup", begun.error()));
  const MutexLock lock(mutex_);
  draft_ = std::move(*begun);
  return {};
}

void SubmitArrayCall::seal(const std::shared_ptr<ArrayDraft>& draft, std::int64_t elements) {
  {
    const MutexLock lock(mutex_);
    sealing_ = true;
  }
  draft->seal(elements, [self = self_](const Expected<v1::SubmitArrayResponse>& sealed) {
    if (!sealed) {
      self->refuse(sealed.error());
    } else {
      const MutexLock lock(self->mutex_);
      self->answer_ = *sealed;
    }
    self->go_on();
  });
}

void SubmitArrayCall::refuse(const Error& error) {
  std::shared_ptr<ArrayDraft> draft;
  {
    const MutexLock lock(mutex_);
    if (refused_) return;
    refused_ = error;
    draft.swap(draft_);
  }
  if (draft != nullptr) draft->drop();  // before its client is notified
  note_refusal(parts_, caller_.origin, error);
}

void SubmitArrayCall::on_timer(Clock::time_point /*now*/) {
  if (!parts_.scheduler.is_closed()) return;
  {
    const MutexLock lock(mutex_);
    if (finishing() || sealing_ || refused_) return;
    refused_ = draining();
  }
  go_on();
}

bool SubmitArrayCall::may_read() const {
  return !refused_ && !sealing_ && (draft_ == nullptr || !draft_->is_full());
}

bool SubmitArrayCall::next_event(v1::SubmitArrayResponse* event) {
  if (!answer_) return false;
  event->Swap(&*answer_);
  answer_.reset();
  answered_ = true;
  return true;
}

std::optional<grpc::Status> SubmitArrayCall::ending() {
  if (refused_) return to_status(*refused_, parts_.scheduler.retry_delay_s());
  if (answered_) return grpc::Status::OK;
  if (broken()) return to_status(failure(ErrorCode::cancelled, "the client gave up"));
  return std::nullopt;
}

}  // namespace marble::server
