#include "marble/batch.h"

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <new>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "connection/connection.h"
#include "connection/patience.h"
#include "connection/traceparent.h"
#include "marble/error.h"
#include "marble/v1/service.pb.h"
#include "message/answer.h"
#include "message/request.h"
#include "message/status.h"
#include "mutex.h"
#include "remote/calls.h"

namespace marble::client {

// Holds the problems of a batch that must be sent or wait for their result, over a sequence of streams if
// servers are lost.

/// Is thread-safe: one thread puts, each stream has one thread that sends, and one thread receives results.
/// Problems have their own numbers on the wire, because the caller's tags may be equal.
class BatchQueue {
 public:
  using Request = std::shared_ptr<const v1::SolveBatchRequest>;
  using Clock = std::chrono::steady_clock;

  /// Adds a problem once the last one was sent. Returns false if no more are accepted.
  [[nodiscard]] bool put(std::int64_t tag, v1::SolveBatchRequest request) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Records a problem that cannot be sent.
  void refuse(std::int64_t tag, Error error) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Marks the end of the source.
  void exhaust() ABSL_LOCKS_EXCLUDED(mutex_);

  /// Returns the number of the next stream, which first sends everything without a result, then new problems.
  [[nodiscard]] int begin_stream() ABSL_LOCKS_EXCLUDED(mutex_);
  /// Marks the end of that stream.
  void end_stream() ABSL_LOCKS_EXCLUDED(mutex_);
  /// Waits for the stream's next request; null at its end, or once all have results.
  [[nodiscard]] Request next(int stream) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Ends all waits.
  void close() ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] bool is_closed() ABSL_LOCKS_EXCLUDED(mutex_);

  /// Marks a problem as done and returns its tag; nothing if it is done already.
  [[nodiscard]] std::optional<std::int64_t> answered(std::int64_t number) ABSL_LOCKS_EXCLUDED(mutex_);
  /// Schedules a problem for another send, on the same stream not before this time.
  void send_again(std::int64_t number, Clock::time_point when) ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] bool done() ABSL_LOCKS_EXCLUDED(mutex_);
  /// Returns the problems that could not be sent since the last call.
  [[nodiscard]] std::vector<std::pair<std::int64_t, Error>> refused() ABSL_LOCKS_EXCLUDED(mutex_);
  /// Returns the tags of all problems without a result, at the end.
  [[nodiscard]] std::vector<std::int64_t> unanswered() ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  struct Open {
    std::int64_t tag = 0;
    Request request;
  };

  Mutex mutex_;
  Condition changed_;
  std::map<std::int64_t, Open> open_ ABSL_GUARDED_BY(mutex_);  // by number
  std::deque<std::int64_t> due_ ABSL_GUARDED_BY(mutex_);       // numbers to be sent, the new one last
  std::multimap<Clock::time_point, std::int64_t> later_ ABSL_GUARDED_BY(mutex_);
  std::vector<std::pair<std::int64_t, Error>> refused_ ABSL_GUARDED_BY(mutex_);
  std::int64_t numbers_ ABSL_GUARDED_BY(mutex_) = 0;
  std::int64_t sent_ ABSL_GUARDED_BY(mutex_) = 0;  // numbers sent at least once
  int stream_ ABSL_GUARDED_BY(mutex_) = 0;
  bool is_open_ ABSL_GUARDED_BY(mutex_) = false;  // whether the stream is open
  bool exhausted_ ABSL_GUARDED_BY(mutex_) = false;
  bool closed_ ABSL_GUARDED_BY(mutex_) = false;
};

bool BatchQueue::put(std::int64_t tag, v1::SolveBatchRequest request) {
  const MutexLock lock(mutex_);
  const std::int64_t number = numbers_++;
  request.set_tag(number);
  open_.emplace(number, Open{tag, std::make_shared<const v1::SolveBatchRequest>(std::move(request))});
  due_.push_back(number);
  changed_.notify_all();
  while (!closed_ && sent_ <= number) changed_.wait(mutex_);
  return !closed_;
}

void BatchQueue::refuse(std::int64_t tag, Error error) {
  const MutexLock lock(mutex_);
  refused_.emplace_back(tag, std::move(error));
}

void BatchQueue::exhaust() {
  const MutexLock lock(mutex_);
  exhausted_ = true;
  changed_.notify_all();
}

int BatchQueue::begin_stream() {
  const MutexLock lock(mutex_);
  due_.clear();
  later_.clear();
  for (const auto& [number, one] : open_) due_.push_back(number);
  is_open_ = true;
  changed_.notify_all();
  return ++stream_;
}

void BatchQueue::end_stream() {
  const MutexLock lock(mutex_);
  is_open_ = false;
  changed_.notify_all();
}

BatchQueue::Request BatchQueue::next(int stream) {
  const MutexLock lock(mutex_);
  while (!closed_ && is_open_ && stream == stream_ && !(exhausted_ && open_.empty())) {
    for (const auto now = Clock::now(); !later_.empty() && later_.begin()->first <= now;) {
      due_.push_back(later_.begin()->second);
      later_.erase(later_.begin());
    }
    while (!due_.empty()) {
      const std::int64_t number = due_.front();
      due_.pop_front();
      const auto found = open_.find(number);
      if (found == open_.end()) continue;
      sent_ = std::max(sent_, number + 1);
      changed_.notify_all();
      return found->second.request;
    }
    if (later_.empty()) {
      changed_.wait(mutex_);
    } else {
      const Clock::time_point end = later_.begin()->first;  // the entry may be gone by then
      changed_.wait_until(mutex_, end);
    }
  }
  return nullptr;
}

void BatchQueue::close() {
  const MutexLock lock(mutex_);
  closed_ = true;
  changed_.notify_all();
}

bool BatchQueue::is_closed() {
  const MutexLock lock(mutex_);
  return closed_;
}

std::optional<std::int64_t> BatchQueue::answered(std::int64_t number) {
  const MutexLock lock(mutex_);
  const auto found = open_.find(number);
  if (found == open_.end()) return std::nullopt;
  const std::int64_t tag = found->second.tag;
  open_.erase(found);
  changed_.notify_all();
  return tag;
}

void BatchQueue::send_again(std::int64_t number, Clock::time_point when) {
  const MutexLock lock(mutex_);
  if (open_.find(number) == open_.end()) return;
  later_.emplace(when, number);
  changed_.notify_all();
}

bool BatchQueue::done() {
  const MutexLock lock(mutex_);
  return exhausted_ && open_.empty();
}

std::vector<std::pair<std::int64_t, Error>> BatchQueue::refused() {
  const MutexLock lock(mutex_);
  return std::exchange(refused_, {});
}

std::vector<std::int64_t> BatchQueue::unanswered() {
  const MutexLock lock(mutex_);
  std::vector<std::int64_t> tags;
  for (const auto& [number, one] : open_) tags.push_back(one.tag);
  return tags;
}

}  // namespace marble::client

namespace marble {
namespace {

using client::BatchQueue;
using Clock = BatchQueue::Clock;
using Seconds = std::chrono::duration<double>;
using Stream = grpc::ClientReaderWriter<v1::SolveBatchRequest, v1::SolveBatchResponse>;

// A draining server accepts no more problems: they go to the next stream, or to this one again.
constexpr Seconds kLeaving(1.0);

// Reads the source on its own thread: the source may wait for results, on whichever stream they arrive.
class Reader {
 public:
  Reader(const BatchSource& source, const BatchControls& controls, BatchQueue& queue)
      : source_(source), controls_(controls), queue_(queue), thread_([this] { read(); }) {}
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;
  /// Waits for the source, if a call of it is in progress.
  ~Reader() {
    queue_.close();
    thread_.join();
  }

  [[nodiscard]] bool out_of_memory() const { return out_of_memory_; }

 private:
  void read() {
    try {
      while (!controls_.stop.stop_requested()) {
        const std::optional<BatchProblem> problem = source_();
        if (!problem || !take(*problem)) break;
      }
    } catch (const std::bad_alloc&) {
      out_of_memory_ = true;
      queue_.close();
    }
    queue_.exhaust();
  }

  bool take(const BatchProblem& p) {
    v1::SolveBatchRequest request;
    const client::RequestParts parts{p.problem,     p.options,    p.initial_z,    nullptr,
                                     p.sensitivity, p.request_id, p.problem_name, controls_.priority};
    auto filled = client::fill_request(parts, request.mutable_solve());
    if (filled) filled = client::check_size(request);
    if (filled) return queue_.put(p.tag, std::move(request));
    queue_.refuse(p.tag, filled.error());
    return true;
  }

  const BatchSource& source_;
  const BatchControls& controls_;
  BatchQueue& queue_;
  std::atomic<bool> out_of_memory_ = false;
  std::thread thread_;  // the last member: it uses the others
};

// Returns after how long a problem with this error is sent again on the same stream; nothing if a retry does
// not help.
std::optional<Seconds> pause_after(const v1::SolveBatchResponse& response) {
  if (!response.has_error()) return std::nullopt;
  if (response.error().code() == grpc::StatusCode::UNAVAILABLE) return kLeaving;
  return client::retry_after(response.error());
}

Expected<RemoteSolution> answer_of(const v1::SolveBatchResponse& response) {
  if (response.has_error()) return unexpected(client::to_error(response.error()));
  return client::remote_solution(response.result());
}

class Batch {
 public:
  Batch(const client::Connection& connection, const BatchSource& source, const BatchSink& sink,
        const BatchControls& controls)
      : connection_(connection),
        source_(source),
        sink_(sink),
        controls_(controls),
        patience_(controls.wait, connection.reached()) {}

  Expected<void> run() {
    Expected<void> done;
    {
      const Reader reader(source_, controls_, queue_);
      done = to_the_end();
      if (reader.out_of_memory()) done = unexpected(out_of_memory());
    }
    report_refused();
    if (done) return done;
    for (const std::int64_t tag : queue_.unanswered()) sink_(tag, unexpected(done.error()));
    return done;
  }

 private:
  // Runs from server to server until all is done.
  Expected<void> to_the_end() {
    while (true) {
      const grpc::Status status = one_stream();
      if (status.ok() && queue_.done()) return {};
      Error error = status.ok() ? failure(ErrorCode::unavailable, "the stream ended without all answers")
                                : client::to_error(status, controls_.stop);
      if (status.error_code() != grpc::StatusCode::UNAVAILABLE && !status.ok()) return unexpected(error);
      if (queue_.done()) return {};
      if (queue_.is_closed()) return unexpected(error);  // there was no memory for more
      const auto pause = patience_.pause();
      if (!pause || connection_.pause(*pause, controls_.stop)) return unexpected(stopped().value_or(error));
    }
  }

  grpc::Status one_stream() {
    grpc::ClientContext context;
    if (auto ready = connection_.prepare(context, controls_.traceparent, std::nullopt); !ready)
      return {grpc::StatusCode::INVALID_ARGUMENT, ready.error().message()};
    const std::stop_callback cancel_on_stop(controls_.stop, [&context] { context.TryCancel(); });
    const auto stream = connection_.solver().SolveBatch(&context);
    const int number = queue_.begin_stream();
    // Flow control may block the writer until results have been read.
    std::thread writer([&] { write(*stream, number); });
    for (v1::SolveBatchResponse response; stream->Read(&response);) take(response, context);
    queue_.end_stream();
    writer.join();
    return stream->Finish();
  }

  void write(Stream& stream, int number) {
    while (const BatchQueue::Request request = queue_.next(number)) {
      if (!stream.Write(*request)) return;
    }
    stream.WritesDone();
  }

  void take(const v1::SolveBatchResponse& response, const grpc::ClientContext& context) {
    patience_.reached();
    connection_.note_reached();
    report_refused();
    if (const auto pause = pause_after(response)) {
      report_waiting(response.error());
      return queue_.send_again(response.tag(),
                               Clock::now() + std::chrono::duration_cast<Clock::duration>(*pause));
    }
    const std::optional<std::int64_t> tag = queue_.answered(response.tag());
    if (!tag) return;
    auto answer = answer_of(response);
    if (answer) answer->traceparent = client::returned_traceparent(context);
    sink_(*tag, std::move(answer));
  }

  void report_waiting(const google::rpc::Status& refusal) {
    if (has_waited_ || refusal.code() != grpc::StatusCode::RESOURCE_EXHAUSTED) return;
    has_waited_ = true;
    if (controls_.waiting) controls_.waiting(client::to_error(refusal));
  }

  void report_refused() {
    for (auto& [tag, error] : queue_.refused()) sink_(tag, unexpected(std::move(error)));
  }

  [[nodiscard]] std::optional<Error> stopped() const {
    if (!controls_.stop.stop_requested()) return std::nullopt;
    return failure(ErrorCode::cancelled, "cancelled by the caller");
  }

  const client::Connection& connection_;
  const BatchSource& source_;
  const BatchSink& sink_;
  const BatchControls& controls_;
  client::Patience patience_;
  BatchQueue queue_;
  bool has_waited_ = false;  // for a full server
};

}  // namespace

Expected<void> client::solve_batch_remotely(const Connection& connection, const BatchSource& source,
                                            const BatchSink& sink, const BatchControls& controls) {
  if (controls.wait && !(*controls.wait >= Seconds(0.0)))
    return unexpected(invalid("wait", "must be >= 0 seconds"));
  MARBLE_RETURN_IF_ERROR(check_traceparent(controls.traceparent));
  return Batch(connection, source, sink, controls).run();
}

}  // namespace marble
