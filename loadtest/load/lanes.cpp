#include "lanes.h"

#include <deque>
#include <map>
#include <set>
#include <string>
#include <utility>

#include "load_target.h"
#include "marble/v1/service.pb.h"
#include "mutex.h"
#include "reply.h"
#include "work.h"
#include "workload.h"

namespace marble::load {

// Sends requests as separate calls: Solve and SolveStream.
class CallLane : public Lane {
 public:
  /// All arguments outlive the lane. `entry` selects the method.
  CallLane(const Target& target, const LoadedEntry& entry, const Done& done);
  /// Cancels the calls in progress, and waits for their end.
  ~CallLane() override;

  void send(const Work& work) override;
  void cancel() override;

 private:
  friend class UnaryCall;
  friend class StreamedCall;
  void begun(grpc::ClientContext* context);
  void over(grpc::ClientContext* context);

  const Target& target_;
  const LoadedEntry& entry_;
  const Done& done_;
  Mutex mutex_;
  Condition ended_;
  std::set<grpc::ClientContext*> under_way_ ABSL_GUARDED_BY(mutex_);
};

// Sends requests that share a stream: updates of a session, problems of a batch.
class StreamLane : public Lane, private grpc::ClientBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer> {
 public:
  /// All arguments outlive the lane. `client` selects the connection.
  StreamLane(const Target& target, const LoadedEntry& entry, std::size_t client, const Done& done);
  /// Cancels what has no result.
  ~StreamLane() override;

  /// Opens the stream, and waits for a session to be ready. Called once, before anything is sent.
  [[nodiscard]] Expected<void> open();
  void send(const Work& work) override;
  void cancel() override;

 private:
  void OnReadDone(bool good) override;
  void OnWriteDone(bool good) override;
  void OnDone(const grpc::Status& status) override;

  struct Outcome {
    std::int64_t id = 0;
    Reply reply;
  };
  [[nodiscard]] grpc::ByteBuffer message(std::int64_t id, const Work& work) const;
  [[nodiscard]] Outcome outcome_of(grpc::ByteBuffer& bytes, bool& ready) const;
  void write_next() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void end_writing();

  const Target& target_;
  const LoadedEntry& entry_;
  const std::size_t client_;
  const Done& done_;
  grpc::ClientContext context_;
  grpc::ByteBuffer read_;
  bool opened_ = false;

  Mutex mutex_;
  Condition changed_;
  grpc::ByteBuffer written_ ABSL_GUARDED_BY(mutex_);
  bool ready_ ABSL_GUARDED_BY(mutex_) = false, writing_ ABSL_GUARDED_BY(mutex_) = false;
  bool broken_ ABSL_GUARDED_BY(mutex_) = false;  // no more writes: the hold for other writers is gone
  bool over_ ABSL_GUARDED_BY(mutex_) = false;
  grpc::Status status_ ABSL_GUARDED_BY(mutex_);
  std::int64_t last_id_ ABSL_GUARDED_BY(mutex_) = 0;
  std::map<std::int64_t, Work> waiting_ ABSL_GUARDED_BY(mutex_);
  std::deque<grpc::ByteBuffer> unwritten_ ABSL_GUARDED_BY(mutex_);
};

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

StreamLane::StreamLane(const Target& target, const LoadedEntry& entry, std::size_t client, const Done& done)
    : target_(target), entry_(entry), client_(client), done_(done) {}

StreamLane::~StreamLane() {
  if (!opened_) return;
  cancel();
  const MutexLock lock(mutex_);
  while (!over_) changed_.wait(mutex_);
}

Expected<void> StreamLane::open() {
  const bool session = entry_.mode == Mode::session;
  target_.prepare(context_, 0.0);
  const char* const method = session ? "/marble.v1.Solver/Session" : "/marble.v1.Solver/SolveBatch";
  target_.stub(client_).PrepareBidiStreamingCall(&context_, method, {}, this);
  AddHold();  // threads other than its reactions write
  StartRead(&read_);
  opened_ = true;
  {
    const MutexLock lock(mutex_);
    ready_ = !session;
    if (session) {
      writing_ = true;
      written_ = entry_.setup;
      StartWrite(&written_);
    }
  }
  StartCall();
  const MutexLock lock(mutex_);
  while (!ready_ && !over_) changed_.wait(mutex_);
  if (!over_) return {};
  const Reply why = error_reply(status_);
  const bool away = why.error == "unavailable";
  return unexpected(Error{away ? ErrorCode::unavailable : ErrorCode::internal, entry_.entry.name, -1, "",
                          "a session was not set up: " + why.error + ": " + why.error_message});
}

grpc::ByteBuffer StreamLane::message(std::int64_t id, const Work& work) const {
  const grpc::ByteBuffer& request = entry_.requests[work.variant];
  if (entry_.mode == Mode::session) {
    v1::SessionRequest number;
    number.mutable_update()->set_sequence(id);
    return merged(request, number.SerializeAsString());
  }
  v1::SolveBatchRequest number;
  number.set_tag(id);
  return merged(request, number.SerializeAsString());
}

void StreamLane::send(const Work& work) {
  {
    const MutexLock lock(mutex_);
    if (!broken_) {
      const std::int64_t id = ++last_id_;
      waiting_.emplace(id, work);
      unwritten_.push_back(message(id, work));
      if (!writing_) write_next();
      return;
    }
  }
  done_(work, broken_reply("its stream has ended"));
}

void StreamLane::write_next() {
  if (unwritten_.empty() || broken_) return;
  writing_ = true;
  written_ = std::move(unwritten_.front());
  unwritten_.pop_front();
  StartWrite(&written_);
}

void StreamLane::OnWriteDone(bool good) {
  const MutexLock lock(mutex_);
  writing_ = false;
  if (good) write_next();
}

StreamLane::Outcome StreamLane::outcome_of(grpc::ByteBuffer& bytes, bool& ready) const {
  if (entry_.mode == Mode::session) {
    v1::SessionResponse response;
    if (!parse(bytes, &response)) return {-1, {}};
    ready = response.has_ready();
    if (response.has_error()) return {response.error().sequence(), error_reply(response.error().status())};
    Outcome outcome{response.answer().sequence(), {}};
    outcome.reply.solution.Swap(response.mutable_answer()->mutable_solution());
    return outcome;
  }
  v1::SolveBatchResponse response;
  if (!parse(bytes, &response)) return {-1, {}};
  if (response.has_error()) return {response.tag(), error_reply(response.error())};
  Outcome outcome{response.tag(), {}};
  outcome.reply.solution.Swap(response.mutable_result()->mutable_solution());
  return outcome;
}

void StreamLane::OnReadDone(bool good) {
  if (!good) return end_writing();
  bool ready = false;
  Outcome outcome = outcome_of(read_, ready);
  StartRead(&read_);
  Work work;
  {
    const MutexLock lock(mutex_);
    if (ready) {
      ready_ = true;
      changed_.notify_all();
      return;
    }
    const auto found = waiting_.find(outcome.id);
    if (found == waiting_.end()) {  // it matches no request: nothing that follows can be trusted
      context_.TryCancel();
      return;
    }
    work = found->second;
    waiting_.erase(found);
  }
  done_(work, std::move(outcome.reply));
}

void StreamLane::end_writing() {
  {
    const MutexLock lock(mutex_);
    if (broken_) return;
    broken_ = true;
  }
  RemoveHold();
}

void StreamLane::cancel() { context_.TryCancel(); }

void StreamLane::OnDone(const grpc::Status& status) {
  std::map<std::int64_t, Work> left;
  {
    const MutexLock lock(mutex_);
    left.swap(waiting_);
  }
  for (const auto& [id, work] : left) {
    Reply reply = status.ok() ? broken_reply("the stream ended without its answer") : error_reply(status);
    done_(work, std::move(reply));
  }
  const MutexLock lock(mutex_);
  status_ = status;
  over_ = true;
  changed_.notify_all();
}

Expected<Lanes> Lanes::open(const Target& target, const std::vector<LoadedEntry>& entries, const Plan& plan,
                            const Done& done) {
  Lanes result;
  result.of_entry_.resize(entries.size());
  for (std::size_t i = 0; i < entries.size(); ++i) {
    auto& lanes = result.of_entry_[i];
    if (entries[i].mode == Mode::unary || entries[i].mode == Mode::streamed) {
      lanes.push_back(std::make_unique<CallLane>(target, entries[i], done));
      continue;
    }
    const int streams = entries[i].mode == Mode::session ? plan.clients : target.connections();
    for (int client = 0; client < streams; ++client) {
      auto lane = std::make_unique<StreamLane>(target, entries[i], static_cast<std::size_t>(client), done);
      MARBLE_RETURN_IF_ERROR(lane->open());
      lanes.push_back(std::move(lane));
    }
  }
  return result;
}

}  // namespace marble::load
