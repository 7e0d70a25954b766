#include "calls/waiting_updates.h"

#include <utility>

namespace marble::server {

std::optional<std::int64_t> WaitingUpdates::push(std::shared_ptr<Update> update,
                                                 std::unique_ptr<Scheduler::Held> room) {
  std::optional<std::int64_t> superseded;
  if (!updates_.empty() && (latest_only_ || updates_.back().update->prepares())) {
    Update& last = *updates_.back().update;
    if (!last.prepares()) superseded = last.sequence();
    update->take_along(std::move(last));
    updates_.pop_back();
  }
  if (left_behind_) update->take_along(std::move(*std::exchange(left_behind_, std::nullopt)));
  updates_.push_back({std::move(update), std::move(room)});
  return superseded;
}

std::shared_ptr<Update> WaitingUpdates::pop() {
  std::shared_ptr<Update> update = std::move(updates_.front().update);
  updates_.pop_front();
  return update;
}

void WaitingUpdates::leave_behind(Update update) {
  update.forget_sensitivity();  // of a result that will never exist
  if (!updates_.empty()) return updates_.front().update->take_along(std::move(update));
  left_behind_ = std::move(update);
}

void WaitingUpdates::clear() {
  updates_.clear();
  left_behind_.reset();
}

}  // namespace marble::server
