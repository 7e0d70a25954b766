// Drives gRPC for every streaming call: one read and one write in progress, and the end after both.
#pragma once

#include <grpcpp/server_context.h>
#include <grpcpp/support/byte_buffer.h>
#include <grpcpp/support/status.h>

#include <memory>
#include <optional>
#include <type_traits>
#include <utility>

#include "base/wire.h"
#include "mutex.h"

namespace marble::server {

/// `Reactor` is gRPC's reactor of bytes, with or without reads. `Event` is what is written: a message, or
/// bytes made from one. A `Call` owns itself until gRPC is done with it; others that work for it may own it
/// too. It states what is due in the hooks, and calls go_on() whenever that may have changed.
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
  // Hooks that are called with the lock held.

  /// True if one more message may be read.
  [[nodiscard]] virtual bool may_read() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return false; }
  /// Takes the next event to write, if there is one. Not called once the client no longer reads.
  [[nodiscard]] virtual bool next_event(Event* event) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) = 0;
  /// Returns the call's status if it ends; called when nothing is left to write.
  [[nodiscard]] virtual std::optional<grpc::Status> ending() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) = 0;
  /// Called when a write has ended. False: there is nothing new to check yet.
  [[nodiscard]] virtual bool wrote() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return true; }

  // Hooks that are called without the lock.

  /// Receives the messages, one at a time; null: the client has closed its side, or has disconnected.
  virtual void received(grpc::ByteBuffer* /*message*/) ABSL_LOCKS_EXCLUDED(mutex_) {}
  /// Does one task of the call that is due besides reads and writes. Returns whether there may be more.
  virtual bool work() ABSL_LOCKS_EXCLUDED(mutex_) { return false; }
  /// The client has disconnected.
  virtual void gone() ABSL_LOCKS_EXCLUDED(mutex_) {}
  /// gRPC is done with the call.
  virtual void done() ABSL_LOCKS_EXCLUDED(mutex_) {}

  /// Does everything that is due.
  void go_on() ABSL_LOCKS_EXCLUDED(mutex_) {
    do {
      while (work()) {
      }
    } while (step());
  }
  /// Ends a call that was never begun; nothing else happens to it.
  void end_at_once(const grpc::Status& status) ABSL_LOCKS_EXCLUDED(mutex_) {
    {
      const MutexLock lock(mutex_);
      finishing_ = true;  // a client that disconnects now must not end the call again
    }
    this->Finish(status);
  }
  /// Notifies the client that the stream has begun; the call may have ended meanwhile.
  void send_metadata() ABSL_LOCKS_EXCLUDED(mutex_) {
    {
      const MutexLock lock(mutex_);
      if (finishing_) return;
      ++starting_;
    }
    this->StartSendInitialMetadata();
    const MutexLock lock(mutex_);
    --starting_;
  }
  /// Cancels a call whose client reads nothing; the call may have ended meanwhile.
  void cut(grpc::CallbackServerContext& context) ABSL_LOCKS_EXCLUDED(mutex_) {
    {
      const MutexLock lock(mutex_);
      if (finishing_) return;
      ++starting_;  // the context exists until the call ends
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
  /// True if the client no longer reads.
  [[nodiscard]] bool broken() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return broken_; }
  /// True if a write is in progress.
  [[nodiscard]] bool writing() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return writing_; }
  [[nodiscard]] bool finishing() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return finishing_; }

  Mutex mutex_;
  std::shared_ptr<Call> self_;

 private:
  static constexpr bool kReads = requires(Reactor & reactor, grpc::ByteBuffer* bytes) {
    reactor.StartRead(bytes);
  };

  // gRPC may react within StartRead, StartWrite or Finish, on this very thread, so no lock is held during
  // these calls.
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
      const MutexLock lock(mutex_);  // the next write may come from any thread
      outgoing_.Swap(&bytes);
    }
    this->StartWrite(&outgoing_);
  }

  grpc::ByteBuffer incoming_;  // the read in progress
  grpc::ByteBuffer outgoing_;  // the write in progress
  bool reading_ ABSL_GUARDED_BY(mutex_) = false;
  // Number of reads, metadata or ends that are about to be requested from gRPC. One of our threads may do so
  // while a gRPC thread reports that the client has disconnected. Finishing waits for them: after it, gRPC
  // may free the call, and the request would use freed memory.
  int starting_ ABSL_GUARDED_BY(mutex_) = 0;
  bool writing_ ABSL_GUARDED_BY(mutex_) = false;
  bool read_all_ ABSL_GUARDED_BY(mutex_) = false;  // the client has closed its side
  bool broken_ ABSL_GUARDED_BY(mutex_) = false;
  bool finishing_ ABSL_GUARDED_BY(mutex_) = false;
};

}  // namespace marble::server
