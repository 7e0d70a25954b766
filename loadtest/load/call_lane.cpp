#include "call_lane.h"

#include "marble/v1/service.pb.h"
#include "reply.h"

namespace marble::load {

// Owns itself until it is done.
class UnaryCall {
 public:
  static void start(CallLane& lane, const Work& work) { (new UnaryCall(lane, work))->start(); }

 private:
  UnaryCall(CallLane& lane, const Work& work) : lane_(lane), work_(work) {}

  void start() {
    lane_.target_.prepare(context_, lane_.entry_.entry.deadline_s);
    lane_.begun(&context_);
    lane_.target_.stub(work_.client)
        .UnaryCall(&context_, "/marble.v1.Solver/Solve", {}, &lane_.entry_.requests[work_.variant],
                   &response_, [this](const grpc::Status& status) { finish(status); });
  }
  void finish(const grpc::Status& status) {
    Reply reply;
    v1::SolveResponse response;
    if (!status.ok()) {
      reply = error_reply(status);
    } else if (!parse(response_, &response) || !response.has_solution()) {
      reply = broken_reply("the answer is no SolveResponse with a solution");
    } else {
      reply.solution.Swap(response.mutable_solution());
    }
    CallLane& lane = lane_;
    lane.done_(work_, std::move(reply));
    // The lane may end as soon as it knows that this call has ended.
    const std::unique_ptr<UnaryCall> self(this);
    lane.over(&context_);
  }

  CallLane& lane_;
  const Work work_;
  grpc::ClientContext context_;
  grpc::ByteBuffer response_;
};

// The same for a stream of events.
class StreamedCall : public grpc::ClientBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer> {
 public:
  static void start(CallLane& lane, const Work& work) { (new StreamedCall(lane, work))->start(); }

  void OnReadDone(bool good) override {
    if (!good) return;
    v1::SolveStreamResponse event;
    if (!parse(bytes_, &event)) {
      broken_ = true;
      context_.TryCancel();
      return;
    }
    if (event.has_progress()) {
      reply_.progress_rows += event.progress().rows_size();
      reply_.progress_skipped = event.progress().skipped();
    }
    if (event.has_result()) {
      reply_.solution.Swap(event.mutable_result()->mutable_solution());
      answered_ = true;
    }
    StartRead(&bytes_);
  }
  void OnDone(const grpc::Status& status) override {
    if (broken_ || (status.ok() && !answered_)) {
      reply_ = broken_reply("the stream has no result");
    } else if (!status.ok()) {
      reply_ = error_reply(status);
    }
    CallLane& lane = lane_;
    lane.done_(work_, std::move(reply_));
    const std::unique_ptr<StreamedCall> self(this);
    lane.over(&context_);
  }

 private:
  StreamedCall(CallLane& lane, const Work& work) : lane_(lane), work_(work) {}

  void start() {
    lane_.target_.prepare(context_, lane_.entry_.entry.deadline_s);
    lane_.begun(&context_);
    lane_.target_.stub(work_.client)
        .PrepareBidiStreamingCall(&context_, "/marble.v1.Solver/SolveStream", {}, this);
    StartWriteLast(&lane_.entry_.requests[work_.variant], {});
    StartRead(&bytes_);
    StartCall();
  }

  CallLane& lane_;
  const Work work_;
  grpc::ClientContext context_;
  grpc::ByteBuffer bytes_;
  Reply reply_;
  bool answered_ = false, broken_ = false;
};

CallLane::CallLane(const Target& target, const LoadedEntry& entry, const Done& done)
    : target_(target), entry_(entry), done_(done) {}

CallLane::~CallLane() {
  cancel();
  const MutexLock lock(mutex_);
  while (!under_way_.empty()) ended_.wait(mutex_);
}

void CallLane::send(const Work& work) {
  if (entry_.mode == Mode::streamed) return StreamedCall::start(*this, work);
  UnaryCall::start(*this, work);
}

void CallLane::cancel() {
  const MutexLock lock(mutex_);
  for (grpc::ClientContext* context : under_way_) context->TryCancel();
}

void CallLane::begun(grpc::ClientContext* context) {
  const MutexLock lock(mutex_);
  under_way_.insert(context);
}

void CallLane::over(grpc::ClientContext* context) {
  const MutexLock lock(mutex_);
  under_way_.erase(context);
  if (under_way_.empty()) ended_.notify_all();
}

}  // namespace marble::load
