#include "marble/session.h"

#include "session_state.h"

namespace marble {

Session::Session(std::unique_ptr<State> state) : state_(std::move(state)) {}
Session::Session(Session&&) noexcept = default;

Session& Session::operator=(Session&& other) noexcept {
  Session taken(std::move(other));
  std::swap(state_, taken.state_);  // cancels the overwritten session
  return *this;
}

Session::~Session() = default;

Expected<std::int64_t> Session::send(const ProblemUpdate& update, const UpdateControls& controls) {
  return or_out_of_memory([&] { return state_->send(update, controls); });
}

Expected<std::int64_t> Session::prepare(const ProblemUpdate& update, const UpdateControls& controls) {
  if (controls.sensitivity != nullptr)
    return unexpected(invalid("sensitivity", "must come with the second part of an update"));
  return or_out_of_memory([&] { return state_->prepare(update, controls); });
}

Expected<std::optional<SessionEvent>> Session::next() {
  return or_out_of_memory([&] { return state_->next(); });
}

Expected<RemoteSolution> Session::solve(const ProblemUpdate& update, const UpdateControls& controls) {
  return or_out_of_memory([&] { return state_->solve(update, controls); });
}

Expected<void> Session::close() {
  return or_out_of_memory([&] { return state_->close(); });
}

bool Session::is_open() const { return state_->is_open(); }
const std::string& Session::job_id() const { return state_->job_id; }
const std::string& Session::traceparent() const { return state_->traceparent; }
std::int64_t Session::memory_bytes() const { return state_->memory_bytes; }
double Session::setup_s() const { return state_->setup_s; }
double Session::idle_timeout_s() const { return state_->idle_timeout_s; }

}  // namespace marble
