#include "remote/session_wire.h"

#include <grpc/support/time.h>

#include <algorithm>
#include <utility>

namespace marble::client {
namespace {

gpr_timespec until(SessionWire::Clock::time_point end) {
  if (end == SessionWire::kForever) return gpr_inf_future(GPR_CLOCK_MONOTONIC);
  const auto left = std::chrono::ceil<std::chrono::nanoseconds>(end - SessionWire::Clock::now());
  return gpr_time_add(gpr_now(GPR_CLOCK_MONOTONIC),
                      gpr_time_from_nanos(std::max<std::int64_t>(left.count(), 0), GPR_TIMESPAN));
}

}  // namespace

SessionWire::SessionWire(v1::Solver::Stub& solver, grpc::ClientContext& context) : context_(context) {
  const MutexLock lock(mutex_);
  start(write_);  // messages follow the start of the call
  stream_ = solver.AsyncSession(&context_, &queue_, &write_);
}

SessionWire::~SessionWire() {
  {
    const MutexLock lock(mutex_);
    if (!finished_) context_.TryCancel();
  }
  static_cast<void>(finish());
  queue_.Shutdown();
  void* tag = nullptr;
  for (bool ok = false; queue_.Next(&tag, &ok);) {
  }
}

void SessionWire::write(v1::SessionRequest request) {
  const MutexLock lock(mutex_);
  // Polls once: a write that has completed is still pending until a thread polls the queue.
  if (!wait(write_, Clock::now())) return outbox_.push_back(std::move(request));
  start(write_);
  stream_->Write(request, &write_);
}

bool SessionWire::wait_room(Clock::time_point end) {
  const MutexLock lock(mutex_);
  return outbox_.size() < kMostUnsent || wait(write_, end) || outbox_.size() < kMostUnsent;
}

bool SessionWire::wait_written() {
  const MutexLock lock(mutex_);
  return wait(write_, kForever) && write_.ok;
}

void SessionWire::writes_done() {
  const MutexLock lock(mutex_);
  static_cast<void>(wait(write_, kForever));
  if (!write_.ok) return;
  start(write_);
  stream_->WritesDone(&write_);
}

SessionWire::Outcome SessionWire::read(v1::SessionResponse* response, Clock::time_point end) {
  const MutexLock lock(mutex_);
  if (!std::exchange(reads_, true)) {
    start(read_);
    stream_->Read(&incoming_, &read_);
  }
  if (!wait(read_, end)) return Outcome::late;
  if (!read_.ok) return Outcome::over;
  reads_ = false;
  response->Swap(&incoming_);
  return Outcome::done;
}

grpc::Status SessionWire::finish() {
  grpc::Status status;
  const MutexLock lock(mutex_);
  if (std::exchange(finished_, true)) return status;
  static_cast<void>(wait(read_, kForever));
  static_cast<void>(wait(write_, kForever));
  start(finish_);
  stream_->Finish(&status, &finish_);
  static_cast<void>(wait(finish_, kForever));
  return status;
}

// Returns true once the operation has ended, false if `end` comes first. Of the threads that wait, one waits
// at the queue and takes the events of all.
bool SessionWire::wait(const Operation& operation, Clock::time_point end) {
  while (operation.pending) {
    if (polls_) {
      if (end == kForever) {
        changed_.wait(mutex_);
      } else if (changed_.wait_until(mutex_, end) == std::cv_status::timeout) {
        break;
      }
      continue;
    }
    polls_ = true;
    void* tag = nullptr;
    bool ok = false;
    mutex_.unlock();
    const auto next = queue_.AsyncNext(&tag, &ok, until(end));
    mutex_.lock();
    polls_ = false;
    if (next == grpc::CompletionQueue::GOT_EVENT) ended(*static_cast<Operation*>(tag), ok);
    changed_.notify_all();
    if (next == grpc::CompletionQueue::TIMEOUT) break;
  }
  return !operation.pending;
}

void SessionWire::ended(Operation& operation, bool ok) {
  operation.pending = false;
  operation.ok = ok;
  if (&operation != &write_) return;
  if (!ok) return outbox_.clear();
  if (outbox_.empty()) return;
  start(write_);
  stream_->Write(outbox_.front(), &write_);
  outbox_.pop_front();
}

}  // namespace marble::client
