#include "marble/batch.h"

#include <new>
#include <thread>

#include "connection/connection.h"
#include "connection/patience.h"
#include "connection/traceparent.h"
#include "message/answer.h"
#include "message/request.h"
#include "message/status.h"
#include "remote/batch_queue.h"
#include "remote/calls.h"

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
  if (auto valid = check_traceparent(controls.traceparent); !valid) return unexpected(valid.error());
  return Batch(connection, source, sink, controls).run();
}

}  // namespace marble
