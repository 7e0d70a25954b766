#include "marble/pending_solution.h"

#include <condition_variable>
#include <mutex>
#include <optional>
#include <stop_token>

#include "answer.h"
#include "pending_solve.h"
#include "request.h"
#include "solve_events.h"
#include "status.h"
#include "traceparent.h"

namespace marble {

/// Reads on gRPC's threads; lives until the call is done, whoever holds the handle.
struct PendingSolution::State final : grpc::ClientReadReactor<v1::SolveStreamResponse> {
  State(std::shared_ptr<const client::Connection> to, const SolveControls& solve_controls,
        CallControls controls)
      : connection(std::move(to)),
        call(std::move(controls)),
        stop(solve_controls.stop),
        events(solve_controls.progress, call) {}

  // A unary call where nobody wants to be told: gRPC can repeat it elsewhere to its end.
  void begin(const std::shared_ptr<State>& self, bool tells) {
    own = self;
    if (tells) {
      connection->solver().async()->SolveStream(&context, &request, this);
      StartRead(&event);
    } else {
      connection->solver().async()->Solve(&context, &request.solve(), &response,
                                          [this](const grpc::Status& status) { finish(status, answer()); });
    }
    cancel_on_stop.emplace(stop, [this] { context.TryCancel(); });
    if (tells) StartCall();
  }

  void OnReadDone(bool ok) override {
    if (!ok) return;
    events.take(event);
    StartRead(&event);
  }

  void OnDone(const grpc::Status& status) override { finish(status, events.answer()); }

  [[nodiscard]] Expected<RemoteSolution> answer() const { return client::remote_solution(response); }

  void finish(const grpc::Status& status, Expected<RemoteSolution> ended) {
    if (!status.ok()) ended = unexpected(client::to_error(status, stop));
    if (ended) ended->traceparent = client::returned_traceparent(context);
    const std::shared_ptr<State> last = std::move(own);
    const std::lock_guard lock(mutex);
    result = std::move(ended);
    done = true;
    changed.notify_all();
  }

  void wait() {
    std::unique_lock lock(mutex);
    changed.wait(lock, [&] { return done; });
  }

  const std::shared_ptr<const client::Connection> connection;
  const CallControls call;
  const std::stop_token stop;
  v1::SolveStreamRequest request;
  grpc::ClientContext context;
  v1::SolveResponse response;     // of a unary call
  v1::SolveStreamResponse event;  // of a stream
  client::SolveEvents events;
  std::optional<std::stop_callback<std::function<void()>>> cancel_on_stop;
  std::shared_ptr<State> own;  // while the call goes on

  std::mutex mutex;
  std::condition_variable changed;
  bool done = false;
  std::optional<Expected<RemoteSolution>> result;  // until it is taken
};

namespace client {

Expected<PendingSolution> begin_solve(const std::shared_ptr<const Connection>& connection,
                                      const ProblemView& problem, const Options& options,
                                      const SolveControls& controls, const CallControls& call) {
  auto request = make_request(problem, options, controls, call);
  if (!request) return unexpected(request.error());
  const auto state = std::make_shared<PendingSolution::State>(connection, controls, call);
  state->request = std::move(*request);
  if (auto ready = connection->prepare(state->context, call.traceparent, call.deadline); !ready)
    return unexpected(ready.error());
  const bool tells = controls.progress != nullptr || call.accepted || call.moved || call.started;
  state->begin(state, tells);
  return PendingSolution(state);
}

}  // namespace client

PendingSolution::PendingSolution(std::shared_ptr<State> state) : state_(std::move(state)) {}
PendingSolution::PendingSolution(PendingSolution&&) noexcept = default;

PendingSolution& PendingSolution::operator=(PendingSolution&& other) noexcept {
  std::swap(state_, other.state_);
  return *this;
}

PendingSolution::~PendingSolution() {
  if (state_ == nullptr) return;
  state_->context.TryCancel();
  state_->wait();
}

Expected<RemoteSolution> PendingSolution::get() {
  state_->wait();
  const std::lock_guard lock(state_->mutex);
  if (!state_->result)
    return unexpected(Error{ErrorCode::failed_precondition, "", -1, "", "the answer was taken already"});
  Expected<RemoteSolution> result = std::move(*state_->result);
  state_->result.reset();
  return result;
}

bool PendingSolution::wait_for(std::chrono::duration<double> duration) const {
  std::unique_lock lock(state_->mutex);
  return state_->changed.wait_for(lock, duration, [&] { return state_->done; });
}

void PendingSolution::cancel() { state_->context.TryCancel(); }

}  // namespace marble
