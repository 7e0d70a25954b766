// What every call with a stream does with gRPC: one read and one write in flight, and an end after both.
#pragma once

#include <grpcpp/server_context.h>
#include <grpcpp/support/byte_buffer.h>
#include <grpcpp/support/status.h>

#include <memory>
#include <optional>
#include <type_traits>
#include <utility>

#include "mutex.h"
#include "wire/wire.h"

namespace marble::server {

/// `Reactor` is gRPC's, of bytes, with reads or without. `Event` is what is written: a message, or bytes that
/// were made of one. A `Call` owns itself until gRPC is done with it; whoever works for it may own it too.
/// It says what is due (the hooks), and calls go_on() whenever that may have changed.
template <class Call, class Reactor, class Event>
class StreamPump : public Reactor {
 public:
  void OnWriteDone(bool ok) final ABSL_LOCKS_EXCLUDED(mutex_) {
    bool look = true;
    {
      const MutexLock lock(mutex_);
      writing_ = false;
      broken_ = broken_ || !ok;
      look = wrote() || broken_;
    }
    if (look) go_on();
  }
  void OnCancel() final ABSL_LOCKS_EXCLUDED(mutex_) {
    {
      const MutexLock lock(mutex_);
      broken_ = true;
    }
    gone();
    go_on();
  }
  void OnDone() final {
    done();
    const auto last = std::move(self_);
  }

 protected:
  // Hooks. The lock is held while the pump asks.

  /// Whether there is room for one more message.
  [[nodiscard]] virtual bool may_read() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return false; }
  /// The next to be written, if there is one. Not asked when nobody reads any more.
  [[nodiscard]] virtual bool next_event(Event* event) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) = 0;
  /// How the call ends, if it does; asked when nothing is left to be written.
  [[nodiscard]] virtual std::optional<grpc::Status> ending() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) = 0;
  /// A write has ended. False: there is nothing new to look for yet.
  [[nodiscard]] virtual bool wrote() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return true; }

  // Hooks without the lock.

  /// A message, one at a time; null: the client has closed its side, or is gone.
  virtual void received(grpc::ByteBuffer* /*message*/) ABSL_LOCKS_EXCLUDED(mutex_) {}
  /// One thing of the call's own that is due besides reads and writes. Whether there may be more.
  virtual bool work() ABSL_LOCKS_EXCLUDED(mutex_) { return false; }
  /// The client is gone.
  virtual void gone() ABSL_LOCKS_EXCLUDED(mutex_) {}
  /// gRPC is done with the call.
  virtual void done() ABSL_LOCKS_EXCLUDED(mutex_) {}

  /// Everything that is due.
  void go_on() ABSL_LOCKS_EXCLUDED(mutex_) {
    do {
      while (work()) {
      }
    } while (step());
  }
  /// Ends a call that was never begun: nothing else happens to it.
  void end_at_once(const grpc::Status& status) ABSL_LOCKS_EXCLUDED(mutex_) {
    {
      const MutexLock lock(mutex_);
      finishing_ = true;  // a client that goes away before it has heard must not end it again
    }
    this->Finish(status);
  }
  /// Cancels a call whose client takes nothing; it may have ended meanwhile.
  void cut(grpc::CallbackServerContext& context) ABSL_LOCKS_EXCLUDED(mutex_) {
    {
      const MutexLock lock(mutex_);
      if (finishing_) return;
      ++starting_;  // the context is there until the call ends
    }
    context.TryCancel();
    const MutexLock lock(mutex_);
    --starting_;
  }
  /// For OnReadDone(), which not every reactor has.
  void read_done(bool ok) ABSL_LOCKS_EXCLUDED(mutex_) {
    received(ok ? &incoming_ : nullptr);
    {
      const MutexLock lock(mutex_);
      reading_ = false;
      read_all_ = read_all_ || !ok;
      incoming_.Clear();
    }
    go_on();
  }

  [[nodiscard]] bool read_all() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return read_all_; }
  /// Nobody reads any more.
  [[nodiscard]] bool broken() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return broken_; }
  /// A write is in flight.
  [[nodiscard]] bool writing() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return writing_; }
  [[nodiscard]] bool finishing() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return finishing_; }

  Mutex mutex_;
  std::shared_ptr<Call> self_;

 private:
  static constexpr bool kReads = requires(Reactor & reactor, grpc::ByteBuffer* bytes) {
    reactor.StartRead(bytes);
  };

  // gRPC may react within StartRead, StartWrite or Finish, on this very thread: no lock is held there.
  [[nodiscard]] bool step() ABSL_LOCKS_EXCLUDED(mutex_) {
    Event event;
    bool read = false;
    bool write = false;
    std::optional<grpc::Status> end;
    {
      const MutexLock lock(mutex_);
      if constexpr (kReads) {
        read = !reading_ && !read_all_ && !broken_ && !finishing_ && may_read();
        reading_ = reading_ || read;
        starting_ += read ? 1 : 0;
      }
      if (!writing_ && !finishing_) {
        write = !broken_ && next_event(&event);
        writing_ = write;
        if (!write && starting_ == 0) end = ending();
        finishing_ = end.has_value();
      }
    }
    if constexpr (kReads) {
      if (read) this->StartRead(&incoming_);
    }
    if (write) {
      start_write(event);
    } else if (end) {
      this->Finish(*end);
    }
    if (!read) return false;
    const MutexLock lock(mutex_);
    --starting_;
    return true;
  }

  void start_write(Event& event) ABSL_LOCKS_EXCLUDED(mutex_) {
    grpc::ByteBuffer bytes;
    if constexpr (std::is_same_v<Event, grpc::ByteBuffer>) {
      bytes.Swap(&event);
    } else {
      bytes = serialize(event);
    }
    {
      const MutexLock lock(mutex_);  // the next write comes from any thread
      outgoing_.Swap(&bytes);
    }
    this->StartWrite(&outgoing_);
  }

  grpc::ByteBuffer incoming_;  // the read in flight
  grpc::ByteBuffer outgoing_;  // the write in flight
  bool reading_ ABSL_GUARDED_BY(mutex_) = false;
  // Reads, or an end, that gRPC is about to be asked for. A thread of ours may do so while gRPC's tells that
  // the client is gone. Finishing waits until it has: afterwards gRPC may be done with the call, and asking
  // would use memory it has freed.
  int starting_ ABSL_GUARDED_BY(mutex_) = 0;
  bool writing_ ABSL_GUARDED_BY(mutex_) = false;
  bool read_all_ ABSL_GUARDED_BY(mutex_) = false;  // the client has closed its side
  bool broken_ ABSL_GUARDED_BY(mutex_) = false;
  bool finishing_ ABSL_GUARDED_BY(mutex_) = false;
};

}  // namespace marble::server
