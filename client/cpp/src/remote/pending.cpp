// Runs an asynchronous solve on a server.
#include <functional>
#include <new>
#include <optional>
#include <stop_token>

#include "connection/traceparent.h"
#include "message/answer.h"
#include "message/request.h"
#include "message/solve_events.h"
#include "message/status.h"
#include "pending_solve.h"

namespace marble::client {
namespace {

// Reads on gRPC's threads. Only the handle owns it and waits for the end: these threads must never be the
// last owner of a channel, because its destructor joins them.
class RemotePending final : public PendingSolution::State,
                            private grpc::ClientReadReactor<v1::SolveStreamResponse> {
 public:
  RemotePending(std::shared_ptr<const Connection> to, v1::SolveStreamRequest request,
                const SolveControls& controls, CallControls call)
      : connection_(std::move(to)),
        request_(std::move(request)),
        call_(std::move(call)),
        stop_(controls.stop),
        reports_(wants_events(controls.progress, controls.activity, call_)),
        events_(controls.progress, controls.activity, call_) {}

  // Makes a unary call if no events are requested: gRPC can retry it elsewhere until it has a response.
  [[nodiscard]] Expected<void> begin() {
    MARBLE_RETURN_IF_ERROR(connection_->prepare(context_, call_));
    if (reports_) {
      connection_->solver().async()->SolveStream(&context_, &request_, this);
      StartRead(&event_);
    } else {
      connection_->solver().async()->Solve(&context_, &request_.solve(), &response_,
                                           [this](const grpc::Status& ended) { OnDone(ended); });
    }
    cancel_on_stop_.emplace(stop_, [this] { context_.TryCancel(); });
    if (reports_) StartCall();
    return {};
  }

  void cancel() override { context_.TryCancel(); }

  Expected<RemoteSolution> answer() override {
    if (out_of_memory_) return unexpected(out_of_memory());
    if (!status_.ok()) return unexpected(to_error(status_, stop_));
    auto answer = reports_ ? events_.answer() : remote_solution(response_);
    if (answer) answer->traceparent = returned_traceparent(context_);
    return answer;
  }

 private:
  void OnReadDone(bool ok) override {
    if (!ok) return;
    try {
      events_.take(event_);
    } catch (const std::bad_alloc&) {  // must not leave gRPC's threads
      out_of_memory_ = true;
      context_.TryCancel();
    }
    StartRead(&event_);
  }

  void OnDone(const grpc::Status& ended) override {
    status_ = ended;
    end();
  }

  const std::shared_ptr<const Connection> connection_;
  const v1::SolveStreamRequest request_;
  const CallControls call_;
  const std::stop_token stop_;
  const bool reports_;
  grpc::ClientContext context_;
  v1::SolveResponse response_;     // of a unary call
  v1::SolveStreamResponse event_;  // of a stream
  SolveEvents events_;
  bool out_of_memory_ = false;
  std::optional<std::stop_callback<std::function<void()>>> cancel_on_stop_;
  grpc::Status status_;  // set at the end
};

}  // namespace

Expected<PendingSolution> begin_solve(const std::shared_ptr<const Connection>& connection,
                                      const ProblemView& problem, const Options& options,
                                      const SolveControls& controls, const CallControls& call) {
  MARBLE_ASSIGN_OR_RETURN(auto request, make_request(problem, options, controls, call));
  auto state = std::make_unique<RemotePending>(connection, std::move(request), controls, call);
  MARBLE_RETURN_IF_ERROR(state->begin());
  return PendingSolution(std::move(state));
}

}  // namespace marble::client
