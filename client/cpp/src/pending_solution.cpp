#include "marble/pending_solution.h"

#include <algorithm>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <new>
#include <optional>
#include <stop_token>

#include "answer.h"
#include "pending_solve.h"
#include "request.h"
#include "solve_events.h"
#include "status.h"
#include "traceparent.h"

namespace marble {
namespace {

constexpr std::chrono::duration<double> kLongestWait{1e8};  // the clock's own range ends

}  // namespace

/// Reads on gRPC's threads; lives until the call is done, whoever holds the handle.
struct PendingSolution::State final : grpc::ClientReadReactor<v1::SolveStreamResponse> {
  State(std::shared_ptr<const client::Connection> to, const SolveControls& solve_controls,
        CallControls controls)
      : connection(std::move(to)),
        call(std::move(controls)),
        stop(solve_controls.stop),
        tells(solve_controls.progress != nullptr || call.accepted || call.moved || call.started),
        events(solve_controls.progress, call) {}

  // A unary call where nobody wants to be told: gRPC can repeat it elsewhere until it is answered.
  void begin(const std::shared_ptr<State>& self) {
    own = self;
    if (tells) {
      connection->solver().async()->SolveStream(&context, &request, this);
      StartRead(&event);
    } else {
      connection->solver().async()->Solve(&context, &request.solve(), &response,
                                          [this](const grpc::Status& ended) { OnDone(ended); });
    }
    cancel_on_stop.emplace(stop, [this] { context.TryCancel(); });
    if (tells) StartCall();
  }

  void OnReadDone(bool ok) override {
    if (!ok) return;
    try {
      events.take(event);
    } catch (const std::bad_alloc&) {  // must not end in gRPC's threads
      out_of_memory = true;
      context.TryCancel();
    }
    StartRead(&event);
  }

  void OnDone(const grpc::Status& ended) override {
    const std::shared_ptr<State> last = std::move(own);  // lets go after the lock
    const std::lock_guard lock(mutex);
    status = ended;
    done = true;
    changed.notify_all();
  }

  [[nodiscard]] bool wait(std::chrono::duration<double> longest) {
    std::unique_lock lock(mutex);
    return changed.wait_for(lock, longest, [&] { return done; });
  }

  void wait() {
    std::unique_lock lock(mutex);
    changed.wait(lock, [&] { return done; });
  }

  // Once it is done.
  [[nodiscard]] Expected<RemoteSolution> take() {
    if (taken)
      return unexpected(Error{ErrorCode::failed_precondition, "", -1, "", "the answer was taken already"});
    taken = true;
    if (out_of_memory) return unexpected(client::out_of_memory());
    if (!status.ok()) return unexpected(client::to_error(status, stop));
    auto answer = tells ? events.answer() : client::remote_solution(response);
    if (answer) answer->traceparent = client::returned_traceparent(context);
    return answer;
  }

  const std::shared_ptr<const client::Connection> connection;
  const CallControls call;
  const std::stop_token stop;
  const bool tells;
  v1::SolveStreamRequest request;
  grpc::ClientContext context;
  v1::SolveResponse response;     // of a unary call
  v1::SolveStreamResponse event;  // of a stream
  client::SolveEvents events;
  bool out_of_memory = false;
  bool taken = false;
  std::optional<std::stop_callback<std::function<void()>>> cancel_on_stop;
  std::shared_ptr<State> own;  // while the call goes on

  std::mutex mutex;
  std::condition_variable changed;
  bool done = false;    // guarded by mutex, as is status; set last
  grpc::Status status;  // constant once done
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
  state->begin(state);
  return PendingSolution(state);
}

}  // namespace client

PendingSolution::PendingSolution(std::shared_ptr<State> state) : state_(std::move(state)) {}
PendingSolution::PendingSolution(PendingSolution&&) noexcept = default;

PendingSolution& PendingSolution::operator=(PendingSolution&& other) noexcept {
  PendingSolution taken(std::move(other));
  std::swap(state_, taken.state_);  // what was there is given up
  return *this;
}

PendingSolution::~PendingSolution() {
  if (state_ == nullptr) return;
  state_->context.TryCancel();
  state_->wait();
}

Expected<RemoteSolution> PendingSolution::get() try {
  state_->wait();
  return state_->take();
} catch (const std::bad_alloc&) {
  return unexpected(client::out_of_memory());
}

bool PendingSolution::wait_for(std::chrono::duration<double> longest) const {
  return state_->wait(std::min(longest, kLongestWait));
}

void PendingSolution::cancel() { state_->context.TryCancel(); }

}  // namespace marble
