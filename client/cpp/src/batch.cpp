#include "marble/batch.h"

#include <exception>
#include <new>
#include <set>
#include <thread>
#include <vector>

#include "connection/connection.h"
#include "connection/traceparent.h"
#include "in_process/in_process.h"
#include "marble/client.h"
#include "message/answer.h"
#include "message/request.h"
#include "message/status.h"
#include "mutex.h"

namespace marble {
namespace {

using Stream = grpc::ClientReaderWriter<v1::SolveBatchRequest, v1::SolveBatchResponse>;

// Writes on a thread of its own: flow control may stop the writing until answers have been read.
class BatchWriter {
 public:
  BatchWriter(const BatchSource& source, const BatchControls& controls, grpc::ClientContext& context,
              Stream& stream)
      : source_(source), controls_(controls), context_(context), stream_(stream), thread_([this] {
          write();
        }) {}

  /// False if the tag is none that waits for an answer.
  [[nodiscard]] bool answered(std::int64_t tag) {
    const MutexLock lock(mutex_);
    const auto found = open_.find(tag);
    if (found == open_.end()) return false;
    open_.erase(found);
    return true;
  }

  /// Waits for the end of the writing. Then all that was never sent, with the reason.
  struct Rest {
    std::vector<std::pair<std::int64_t, Error>> unsent;
    std::multiset<std::int64_t> unanswered;
    bool out_of_memory = false;
  };
  [[nodiscard]] Rest finish() {
    thread_.join();
    const MutexLock lock(mutex_);
    rest_.unanswered = std::move(open_);
    return std::move(rest_);
  }

 private:
  void write() try {
    while (!controls_.stop.stop_requested()) {
      const std::optional<BatchProblem> problem = source_();
      if (!problem) break;
      if (!send(*problem)) return;
    }
    stream_.WritesDone();
  } catch (const std::bad_alloc&) {
    rest_.out_of_memory = true;
    context_.TryCancel();
  }

  // False if the stream is broken.
  bool send(const BatchProblem& p) {
    v1::SolveBatchRequest request;
    request.set_tag(p.tag);
    const client::RequestParts parts{p.problem,     p.options,    p.initial_z,    nullptr,
                                     p.sensitivity, p.request_id, p.problem_name, controls_.priority};
    auto filled = client::fill_request(parts, request.mutable_solve());
    if (filled) filled = client::check_size(request);
    if (!filled) {
      rest_.unsent.emplace_back(p.tag, filled.error());
      return true;
    }
    {
      const MutexLock lock(mutex_);
      open_.insert(p.tag);
    }
    return stream_.Write(request);
  }

  const BatchSource& source_;
  const BatchControls& controls_;
  grpc::ClientContext& context_;
  Stream& stream_;
  Rest rest_;
  Mutex mutex_;
  std::multiset<std::int64_t> open_ ABSL_GUARDED_BY(mutex_);
  std::thread thread_;  // the last member: it uses the others
};

Expected<RemoteSolution> answer_of(const v1::SolveBatchResponse& response) {
  if (response.has_error()) return unexpected(client::to_error(response.error()));
  return client::remote_solution(response.result());
}

}  // namespace

Expected<void> Client::solve_batch(const BatchSource& source, const BatchSink& sink,
                                   const BatchControls& controls) const {
  if (connection_ == nullptr) return client::solve_batch_here(source, sink, controls);
  grpc::ClientContext context;
  if (auto ready = connection_->prepare(context, controls.traceparent, std::nullopt); !ready)
    return unexpected(ready.error());
  const std::stop_callback cancel_on_stop(controls.stop, [&context] { context.TryCancel(); });
  const auto stream = connection_->solver().SolveBatch(&context);
  BatchWriter writer(source, controls, context, *stream);
  v1::SolveBatchResponse response;
  while (stream->Read(&response)) {
    if (!writer.answered(response.tag())) continue;
    auto answer = answer_of(response);
    if (answer) answer->traceparent = client::returned_traceparent(context);
    sink(response.tag(), std::move(answer));
  }
  const BatchWriter::Rest rest = writer.finish();
  const grpc::Status status = stream->Finish();
  for (const auto& [tag, error] : rest.unsent) sink(tag, unexpected(error));
  if (status.ok() && rest.unanswered.empty()) return {};
  Error error = failure(ErrorCode::internal, "the stream ended without all answers");
  if (!status.ok()) error = rest.out_of_memory ? out_of_memory() : client::to_error(status, controls.stop);
  for (const std::int64_t tag : rest.unanswered) sink(tag, unexpected(error));
  return unexpected(error);
}

Expected<void> Client::solve_batch(std::span<const BatchProblem> problems, const BatchSink& sink,
                                   const BatchControls& controls) const {
  std::size_t next = 0;
  const BatchSource source = [&]() -> std::optional<BatchProblem> {
    if (next == problems.size()) return std::nullopt;
    return problems[next++];
  };
  return solve_batch(source, sink, controls);
}

}  // namespace marble
