#include "submissions/array_results_call.h"

#include <array>
#include <utility>

#include "base/status.h"
#include "base/wire.h"
#include "service/admission.h"
#include "service/job_access.h"
#include "store/submissions.h"

namespace marble::server {
namespace {

constexpr std::int64_t kPageBytes = 1 << 20;

// The message, after the field that it lacks: concatenated encodings are one message.
grpc::ByteBuffer reported(const ElementAnswer& answer) {
  v1::ArrayResultsResponse rest;
  if (!rest.ParseFromString(answer.message) ||
      rest.outcome_case() == v1::ArrayResultsResponse::OUTCOME_NOT_SET)
    return serialize(message_of(answer));
  v1::ArrayResultsResponse first;
  first.set_sequence(answer.sequence);
  const std::string sequence = first.SerializeAsString();
  const std::array slices = {grpc::Slice(sequence), grpc::Slice(answer.message)};
  return grpc::ByteBuffer(slices.data(), slices.size());
}

}  // namespace

grpc::ServerWriteReactor<grpc::ByteBuffer>* ArrayResultsCall::begin(const ServiceParts& parts,
                                                                    grpc::CallbackServerContext& context,
                                                                    const grpc::ByteBuffer* request) {
  const std::shared_ptr<ArrayResultsCall> call(new ArrayResultsCall(parts));
  call->self_ = call;
  if (const auto started = call->start(context, request); !started)
    call->end_at_once(to_status(started.error(), parts.scheduler.retry_delay_s()));
  return call.get();
}

ArrayResultsCall::~ArrayResultsCall() {
  if (!client_.empty()) parts_.feeds.leave(client_);
}

Expected<void> ArrayResultsCall::start(grpc::CallbackServerContext& context,
                                       const grpc::ByteBuffer* request) {
  Origin origin = origin_of(context);
  auto caller = identify(parts_, context, origin);
  if (!caller) return unexpected(caller.error());
  v1::ArrayResultsRequest message;
  MARBLE_RETURN_IF_ERROR(parse(request, &message));
  const auto self = self_;  // gRPC may be done with the call before this returns
  parts_.timer.add(self);
  parts_.submissions->find_array(
      message.job_id(), [self, message, caller = std::move(*caller)](const Expected<FoundArray>& found) {
        const auto opened = found ? self->open(caller, message, *found) : unexpected(found.error());
        if (opened) return self->go_on();
        {
          const MutexLock lock(self->mutex_);
          self->end_ = to_status(opened.error(), self->parts_.scheduler.retry_delay_s());
        }
        self->go_on();
      });
  return {};
}

Expected<void> ArrayResultsCall::open(const Identity& caller, const v1::ArrayResultsRequest& message,
                                      const FoundArray& found) {
  if (!may_end(caller, found.client)) return unexpected(no_array(message.job_id()));
  if (message.after() < 0 || message.after() > found.elements) {
    return unexpected(invalid("after", std::to_string(message.after()),
                              "must be in [0, " + std::to_string(found.elements) + "], the elements"));
  }
  MARBLE_RETURN_IF_ERROR(parts_.feeds.enter(caller.client, parts_.access.quota_of(caller.client).watchers));
  client_ = caller.client;
  send_metadata();
  found.results->listen(weak_from_this());
  const MutexLock lock(mutex_);
  array_ = found.results;
  read_ = message.after();
  return {};
}

// Reads on, one thread at a time, when everything read so far is sent.
bool ArrayResultsCall::work() {
  std::int64_t from = 0;
  std::shared_ptr<ArraySource> array;
  {
    const MutexLock lock(mutex_);
    again_ = again_ || reading_;
    if (array_ == nullptr || reading_ || end_ || broken() || finishing() || !page_.empty()) return false;
    reading_ = true;
    from = read_;
    array = array_;
  }
  auto news = array->news_after(from, kPageBytes);
  const MutexLock lock(mutex_);
  reading_ = false;
  const bool again = std::exchange(again_, false);
  if (!news) {
    end_ = to_status(news.error(), parts_.scheduler.retry_delay_s());
    return false;
  }
  for (ElementAnswer& answer : news->answers) {
    read_ = answer.sequence;
    page_.push_back(std::move(answer));
  }
  if (news->is_over) end_ = news->end ? to_status(*news->end) : grpc::Status::OK;
  return again && page_.empty() && !end_;
}

bool ArrayResultsCall::next_event(grpc::ByteBuffer* event) {
  if (page_.empty()) return false;
  *event = reported(page_.front());
  page_.pop_front();
  return true;
}

std::optional<grpc::Status> ArrayResultsCall::ending() {
  if (reading_) return std::nullopt;
  if (broken()) return to_status(failure(ErrorCode::cancelled, "the client gave up"));
  return end_;
}

// Sends results that a drain still finishes; after that there is nothing to wait for.
void ArrayResultsCall::on_timer(Clock::time_point /*now*/) {
  if (!parts_.scheduler.is_drained() || !parts_.submissions->is_settled()) return;
  go_on();
  {
    const MutexLock lock(mutex_);
    if (end_ || reading_ || writing() || !page_.empty()) return;
    end_ = end_of_stream(parts_, draining());
  }
  go_on();
}

}  // namespace marble::server
