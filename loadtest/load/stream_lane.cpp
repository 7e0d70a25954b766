#include "stream_lane.h"

#include "marble/v1/service.pb.h"
#include "reply.h"

namespace marble::load {

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

}  // namespace marble::load
