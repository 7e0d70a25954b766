#include "marble/pending_solution.h"

#include <new>

#include "message/status.h"
#include "pending_solve.h"

namespace marble {

PendingSolution::PendingSolution(std::unique_ptr<State> state) : state_(std::move(state)) {}
PendingSolution::PendingSolution(PendingSolution&&) noexcept = default;

PendingSolution& PendingSolution::operator=(PendingSolution&& other) noexcept {
  PendingSolution taken(std::move(other));
  std::swap(state_, taken.state_);  // cancels the overwritten solve
  return *this;
}

PendingSolution::~PendingSolution() {
  if (state_ == nullptr) return;
  state_->cancel();
  state_->wait();
}

Expected<RemoteSolution> PendingSolution::get() {
  return or_out_of_memory([&]() -> Expected<RemoteSolution> {
    state_->wait();
    if (state_->taken)
      return unexpected(failure(ErrorCode::failed_precondition, "the answer was taken already"));
    state_->taken = true;
    return state_->answer();
  });
}

bool PendingSolution::wait_for(std::chrono::duration<double> longest) const { return state_->wait(longest); }

void PendingSolution::cancel() { state_->cancel(); }

}  // namespace marble
